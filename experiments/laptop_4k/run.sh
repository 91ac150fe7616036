#!/usr/bin/env bash
# The paper's two models on a tenth of its schedule, validated every 400 of 4,000 steps; every validated state is then
# measured on test objects and, where REAL names a folder of them, on real ones. Results go beside this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=experiments/laptop_4k
export OMP_NUM_THREADS=1

train() { # name, overrides
    name=$1; shift
    .venv/bin/python -m stereo_occ.train scale=laptop steps=4000 validation.views=2 validation.points=2048 \
        validation.keep_all=true trainer.threads=1 hydra.run.dir="outputs/laptop_4k/$name" progress=false "$@"
}

measure() { # name, subset name, overrides
    name=$1; where=$2; shift 2
    states=$(ls "outputs/laptop_4k/$name"/step_*.ckpt | paste -sd,)
    .venv/bin/python -m stereo_occ.evaluate -m checkpoint="$states" views=4 points=5000 examples=0 trainer.threads=1 \
        hydra.sweep.dir="outputs/laptop_4k/$name/$where" progress=false "$@"
    .venv/bin/python -m stereo_occ.evaluate checkpoint="outputs/laptop_4k/$name/best.ckpt" views=16 points=20000 \
        examples=3 trainer.threads=1 hydra.run.dir="outputs/laptop_4k/$name/${where}_best" progress=false "$@"
}

model() { # name, training overrides
    train "$@"
    measure "$1" test
    if [ -n "${REAL:-}" ]; then
        measure "$1" real data=meshes data.root="$REAL" subset=all
    fi
    .venv/bin/python -m experiments.collect "outputs/laptop_4k/$1" "$here/$1"
}

.venv/bin/python -m stereo_occ.render scale=laptop
if [ -n "${REAL:-}" ]; then
    .venv/bin/python -m stereo_occ.render scale=laptop data=meshes data.root="$REAL"
fi
model stereo model=stereo &
model mono model=mono model.encoder.weights=null &
wait
