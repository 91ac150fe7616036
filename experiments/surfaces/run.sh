#!/usr/bin/env bash
# The paper's remark that surfaces which reflect or have no texture are hard for stereo, by training: the plane sweep and mono
# on a whole schedule of 2,500 steps, 40 pairs of each object, matt and glossy, plain and patterned; each is validated on
# surfaces like those it saw. One seed each.
set -euo pipefail
family=surfaces steps=2500 interval=500
source "$(dirname "$0")/../family.sh"

try base scale.views=40
try plane_sweep_patterned scale.views=40 texture=procedural
try plane_sweep_glossy scale.views=40 material=glossy
try plane_sweep_both scale.views=40 texture=procedural material=glossy
try mono_plain scale.views=40 model=mono_scratch
try mono_patterned scale.views=40 model=mono_scratch texture=procedural
try mono_glossy scale.views=40 model=mono_scratch material=glossy
try mono_both scale.views=40 model=mono_scratch texture=procedural material=glossy
tabulate base plane_sweep_{patterned,glossy,both} mono_{plain,patterned,glossy,both}
