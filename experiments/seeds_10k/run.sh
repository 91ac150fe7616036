#!/usr/bin/env bash
# The paper's two models of recipe_10k and the best calibrated one from a second and a third seed, and its twin of one view
# from a second; seed 0 is there. Results go beside this file.
set -euo pipefail
family=seeds_10k interval=1000
source "$(dirname "$0")/../family.sh"

for seed in 1 2; do
    learn mono_scratch_$seed 10000 seed=$seed model=mono_scratch
    learn stereo_$seed 10000 seed=$seed model=stereo
    learn plane_sweep_guided_$seed 10000 seed=$seed model=plane_sweep_guided auxiliary=mask_depth
done
learn plane_sweep_guided_left_1 10000 seed=1 model=plane_sweep_guided auxiliary=mask_depth model.views=left
