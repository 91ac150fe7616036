#!/usr/bin/env bash
# The calibrated plane sweep on a quarter of the paper's schedule, with the recipe; measured on test objects and, where
# REAL names a folder of them, on real ones. Results go beside this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
export OMP_NUM_THREADS=1
name=plane_sweep_stereo
run=outputs/recipe_10k/$name

.venv/bin/python -m stereo_occ.train experiment=recipe scale=laptop steps=10000 model=$name trainer.threads=1 \
    hydra.run.dir="$run" progress=false

measure() { # where, overrides
    where=$1; shift
    .venv/bin/python -m stereo_occ.evaluate checkpoint="$run/best.ckpt" views=8 points=20000 meshes=1 mesh_resolution=64 \
        surface_points=20000 examples=3 trainer.threads=1 hydra.run.dir="$run/${where}_best" progress=false "$@"
}

measure test
if [ -n "${REAL:-}" ]; then
    measure real data=meshes data.root="$REAL" data.views=16
fi
.venv/bin/python experiments/collect.py "$run" experiments/recipe_10k/$name
