#!/usr/bin/env bash
# Mono of recipe_40k from a second seed, on the paper's whole schedule; seed 0 is there. Results go beside this file.
set -euo pipefail
family=seeds_40k interval=4000
source "$(dirname "$0")/../family.sh"

learn mono_scratch_1 40000 seed=1 model=mono_scratch scale.batch_size=8
