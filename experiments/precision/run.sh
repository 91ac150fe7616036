#!/usr/bin/env bash
# bfloat16 against float32: the plane sweep on a whole schedule of 1,000 steps, three seeds of each.
set -euo pipefail
family=precision
source "$(dirname "$0")/../recipe.sh"

for seed in 0 1 2; do
    for precision in bf16-mixed 32-true; do
        try "${precision}_$seed" 1000 validation.interval=500 trainer.precision="$precision" seed="$seed"
    done
done
tabulate {bf16-mixed,32-true}_{0,1,2}
