#!/usr/bin/env bash
# How near must the cameras be, and how far apart? The weights for photographs before real objects (REAL: their folder) at
# four distances, with a ZED Mini's baseline and with twice that. Nothing is trained. Results go beside this file.
set -euo pipefail
family=field_distance
source "$(dirname "$0")/../family.sh"

distances="0.35 0.5 0.7 1.0" baselines="0.063 0.12"
for distance in $distances; do
    for baseline in $baselines; do
        judge "$runs/${baseline}_$distance" checkpoint=field "${standing[@]}" data.views=2 \
            rig=zed_mini "rig.baseline=[$baseline,$baseline]" "rig.distance=[$distance,$distance]" views=2 keep=false workers=1
    done
done
for distance in $distances; do
    for baseline in $baselines; do
        keep "$runs/${baseline}_$distance" "${baseline}_$distance"
    done
    differ wider_$distance "$runs/0.12_$distance" "$runs/0.063_$distance"
done
