#!/usr/bin/env bash
# How far apart the cameras should be: the plane sweep on a whole schedule of 2,500 steps, 40 pairs of each object, with each
# camera pi/64 to pi/4 off the mid-line; the paper's pi/16 is the base. One seed each.
set -euo pipefail
family=baseline_angle steps=2500 interval=500
source "$(dirname "$0")/../family.sh"

try base scale.views=40
for degrees in 2.8125 5.625 22.5 45.0; do
    try "$degrees" scale.views=40 rig.half_angle_deg=$degrees
done
tabulate base 2.8125 5.625 22.5 45.0
