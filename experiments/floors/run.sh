#!/usr/bin/env bash
# What needs no training of a network, on test objects and, where REAL names a folder of them, on real ones, with the
# objects, views and points of ../recipe_10k. Results go beside this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=experiments/floors
export OMP_NUM_THREADS=1

measure() { # baseline, where, overrides
    name=$1 where=$2 out="outputs/floors/$1/$2"; shift 2
    .venv/bin/python -m stereo_occ.evaluate baseline="$name" views=8 points=20000 meshes=1 \
        mesh_resolution=64 surface_points=20000 examples=0 keep=false trainer.threads=1 hydra.run.dir="$out" \
        progress=false "$@"
    mkdir -p "$here/$name"
    sed "s|${REAL:-REAL}|REAL|" "$out/metrics.json" >"$here/$name/$where.json"
    cp "$out/per_object.csv" "$here/$name/${where}_per_object.csv"
}

for name in visual_hull sgm mean_shape nearest_shape truth; do
    measure $name test
    if [ -n "${REAL:-}" ]; then
        measure $name real data=meshes data.root="$REAL" data.views=16
    fi
done
