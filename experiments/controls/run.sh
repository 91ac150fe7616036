#!/usr/bin/env bash
# What the plane sweep of ../recipe_20k makes of pairs from which something is taken that it was trained with. Nothing is
# trained. Results go beside this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
export OMP_NUM_THREADS=1
for control in none left_twice right_shuffled calibration_off_0.5 calibration_off_1 calibration_off_2; do
    .venv/bin/python -m stereo_occ.evaluate control=$control views=4 points=20000 meshes=0 examples=0 trainer.threads=1 \
        checkpoint=outputs/recipe_20k/plane_sweep_stereo_aided/best.ckpt hydra.run.dir=outputs/controls/$control progress=false
    cp outputs/controls/$control/metrics.json experiments/controls/$control.json
done
