#!/usr/bin/env bash
# The weights for photographs: experiment=field in three parts, two without shadows and one with them on new objects, measured on
# test objects and, where REAL names a folder of them, on real ones with their own colours, in such scenes and before two
# cameras as they are sold. Results go beside this file.
set -euo pipefail
family=field
source "$(dirname "$0")/../family.sh"

train() { # folder, overrides
    local run=$1; shift
    .venv/bin/python -m stereo_occ.train experiment=field trainer.threads=1 validation.interval=1000 \
        validation.views=2 validation.points=8192 hydra.run.dir="$run" progress=false "$@"
}

measure() { # where, overrides
    local where=$1; shift
    judge "$runs/${where}_best" checkpoint="$runs/best.ckpt" views=4 examples=3 "$@"
}

shadowless=(steps=8000 lights=random 'sensor.exposure=[-0.5,0.7]')
train "${runs}_first" "${shadowless[@]}"
train "${runs}_second" "${shadowless[@]}" init="${runs}_first/best.ckpt" optimizer.lr=5e-4
train "$runs" steps=7000 init="${runs}_second/best.ckpt" optimizer.lr=5e-4 data.seed=1 \
    'scale.counts={mug: 700, bowl: 250, bottle: 300}' scale.views=20
measure test
if [ -n "${REAL:-}" ]; then
    measure real "${standing[@]}" data.views=4
    for rig in zed_mini realsense_d435; do
        measure $rig "${standing[@]}" data.views=4 rig=$rig
    done
    measure photographs "${standing[@]}" data.views=4 rig=zed_mini background=photographs
    before=outputs/field_before/zed_mini_best
    judge $before checkpoint="${runs}_second/best.ckpt" views=4 "${standing[@]}" data.views=4 rig=zed_mini \
        lights=room sensor=noisy 'sensor.exposure=[-0.5,1.5]'
    differ zed_mini_against_before "$runs/zed_mini_best" $before
    # A fourth part, which was not worth keeping.
    train "${runs}_fourth" steps=6000 init="$runs/best.ckpt" optimizer.lr=5e-4 data.seed=2 \
        'scale.counts={mug: 900, bowl: 400, bottle: 250}' scale.views=16
    fourth() { # where, overrides
        local where=$1; shift
        judge "${runs}_fourth/${where}_best" checkpoint="${runs}_fourth/best.ckpt" views=4 "${standing[@]}" data.views=4 "$@"
        differ fourth_part_$where "${runs}_fourth/${where}_best" "$runs/${where}_best"
    }
    fourth real
    fourth zed_mini rig=zed_mini
fi
collect "$runs" "$here"
.venv/bin/python -m stereo_occ.export checkpoint="$runs/best.ckpt" output=stereo_occ/weights/field metrics="$here/test.json"
