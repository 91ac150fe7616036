#!/usr/bin/env bash
# The weights for photographs: experiment=field in two halves, measured on test objects and, where REAL names a folder of
# them, on real ones with their own colours, in such scenes and before two cameras as they are sold. Results go beside
# this file.
set -euo pipefail
family=field
source "$(dirname "$0")/../family.sh"

train() { # folder, overrides
    local run=$1; shift
    .venv/bin/python -m stereo_occ.train experiment=field steps=8000 trainer.threads=1 validation.interval=1000 \
        validation.views=2 validation.points=8192 hydra.run.dir="$run" progress=false "$@"
}

measure() { # where, overrides
    local where=$1; shift
    judge "$runs/${where}_best" checkpoint="$runs/best.ckpt" views=4 examples=3 "$@"
}

train "${runs}_first"
train "$runs" init="${runs}_first/best.ckpt" optimizer.lr=5e-4
measure test
if [ -n "${REAL:-}" ]; then
    measure real data=meshes data.root="$REAL" data.views=4 texture=own
    for rig in zed_mini realsense_d435; do
        measure $rig data=meshes data.root="$REAL" data.views=4 texture=own rig=$rig
    done
    measure photographs data=meshes data.root="$REAL" data.views=4 texture=own rig=zed_mini background=photographs
fi
collect "$runs" "$here"
.venv/bin/python -m stereo_occ.export checkpoint="$runs/best.ckpt" output=stereo_occ/weights/field metrics="$here/test.json"
