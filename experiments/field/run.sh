#!/usr/bin/env bash
# The weights for photographs: experiment=field in two halves, measured on test objects and, where REAL names a folder of
# them, on real ones with their own colours, in such scenes and before two cameras as they are sold. Results go beside
# this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=experiments/field run=outputs/field
export OMP_NUM_THREADS=1

measure() { # where, overrides
    where=$1; shift
    .venv/bin/python -m stereo_occ.evaluate checkpoint="$run/best.ckpt" views=4 points=20000 meshes=1 mesh_resolution=64 \
        surface_points=20000 examples=3 trainer.threads=1 hydra.run.dir="$run/${where}_best" progress=false "$@"
}

learn() { # folder, overrides
    folder=$1; shift
    .venv/bin/python -m stereo_occ.train experiment=field steps=8000 trainer.threads=1 validation.interval=1000 \
        validation.views=2 validation.points=8192 hydra.run.dir="$folder" progress=false "$@"
}

learn "${run}_first"
learn "$run" init="${run}_first/best.ckpt" optimizer.lr=5e-4
measure test
if [ -n "${REAL:-}" ]; then
    measure real data=meshes data.root="$REAL" data.views=4 texture=own
    for rig in zed_mini realsense_d435; do
        measure $rig data=meshes data.root="$REAL" data.views=4 texture=own rig=$rig
    done
    measure photographs data=meshes data.root="$REAL" data.views=4 texture=own rig=zed_mini background=photographs
fi
.venv/bin/python experiments/collect.py "$run" "$here"
if [ -n "${REAL:-}" ]; then
    sed -i "s|$REAL|REAL|" "$here"/{real,zed_mini,realsense_d435,photographs}.json
fi
.venv/bin/python -m stereo_occ.export checkpoint="$run/best.ckpt" output=stereo_occ/weights/field metrics="$here/test.json"
