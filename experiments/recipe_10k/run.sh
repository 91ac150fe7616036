#!/usr/bin/env bash
# Mono, the paper's stereo and the calibrated plane sweep, the latter also with auxiliary tasks, on a quarter of the
# paper's schedule, with the recipe; measured on test objects and, where REAL names a folder of them, on real ones.
# Results go beside this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=experiments/recipe_10k
export OMP_NUM_THREADS=1

measure() { # model, where, overrides
    run="outputs/recipe_10k/$1" where=$2; shift 2
    .venv/bin/python -m stereo_occ.evaluate checkpoint="$run/best.ckpt" views=8 points=20000 meshes=1 mesh_resolution=64 \
        surface_points=20000 examples=3 trainer.threads=1 hydra.run.dir="$run/${where}_best" progress=false "$@"
}

learn() { # name, overrides
    name=$1; shift
    .venv/bin/python -m stereo_occ.train experiment=recipe scale=laptop steps=10000 trainer.threads=1 \
        validation.interval=1000 validation.views=4 validation.points=8192 \
        hydra.run.dir="outputs/recipe_10k/$name" progress=false "$@"
    measure $name test
    if [ -n "${REAL:-}" ]; then
        measure $name real data=meshes data.root="$REAL" data.views=16
    fi
    .venv/bin/python experiments/collect.py "outputs/recipe_10k/$name" $here/$name
    if [ -n "${REAL:-}" ]; then
        sed -i "s|$REAL|REAL|" $here/$name/real.json
    fi
}

learn mono_scratch model=mono_scratch
learn stereo model=stereo
learn plane_sweep_stereo model=plane_sweep_stereo
learn plane_sweep_stereo_aided model=plane_sweep_stereo auxiliary=mask_depth
against() { # folder, A, B
    .venv/bin/python -m stereo_occ.compare "outputs/recipe_10k/$2/test_best" "outputs/recipe_10k/$3/test_best" \
        --output "$here/$1"
}
against stereo_against_mono plane_sweep_stereo mono_scratch
against paper_stereo_against_mono stereo mono_scratch
against aided_against_mono plane_sweep_stereo_aided mono_scratch
against aided_against_unaided plane_sweep_stereo_aided plane_sweep_stereo
.venv/bin/python -m stereo_occ.export checkpoint=outputs/recipe_10k/plane_sweep_stereo_aided/best.ckpt \
    output=stereo_occ/weights/paper_rig metrics=$here/plane_sweep_stereo_aided/test.json
