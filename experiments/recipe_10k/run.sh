#!/usr/bin/env bash
# Mono and the calibrated plane sweep on a quarter of the paper's schedule, with the recipe; measured on test objects
# and, where REAL names a folder of them, on real ones. Results go beside this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=experiments/recipe_10k
export OMP_NUM_THREADS=1

measure() { # model, where, overrides
    run="outputs/recipe_10k/$1" where=$2; shift 2
    .venv/bin/python -m stereo_occ.evaluate checkpoint="$run/best.ckpt" views=8 points=20000 meshes=1 mesh_resolution=64 \
        surface_points=20000 examples=3 trainer.threads=1 hydra.run.dir="$run/${where}_best" progress=false "$@"
}

for name in mono_scratch plane_sweep_stereo; do
    .venv/bin/python -m stereo_occ.train experiment=recipe scale=laptop steps=10000 model=$name trainer.threads=1 \
        hydra.run.dir="outputs/recipe_10k/$name" progress=false
    measure $name test
    if [ -n "${REAL:-}" ]; then
        measure $name real data=meshes data.root="$REAL" data.views=16
    fi
    .venv/bin/python experiments/collect.py "outputs/recipe_10k/$name" $here/$name
    if [ -n "${REAL:-}" ]; then
        sed -i "s|$REAL|REAL|" $here/$name/real.json
    fi
done
.venv/bin/python -m stereo_occ.compare outputs/recipe_10k/plane_sweep_stereo/test_best \
    outputs/recipe_10k/mono_scratch/test_best --output $here/stereo_against_mono
