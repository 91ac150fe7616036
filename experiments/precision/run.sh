#!/usr/bin/env bash
# bfloat16 against float32: the plane sweep on a whole schedule of 1,000 steps, three seeds of each.
set -euo pipefail
family=precision steps=1000 interval=500
source "$(dirname "$0")/../family.sh"

for seed in 0 1 2; do
    for precision in bf16-mixed 32-true; do
        try "${precision}_$seed" trainer.precision="$precision" seed="$seed"
    done
done
tabulate {bf16-mixed,32-true}_{0,1,2}
