#!/usr/bin/env bash
# What larger pictures are worth: the guided plane sweep on a whole schedule of 2,500 steps, 40 pairs of each object, with
# pictures of 64 and of 96 pixels. One seed each.
set -euo pipefail
family=image_side steps=2500 interval=500
source "$(dirname "$0")/../family.sh"

try base model=plane_sweep_guided auxiliary=mask_depth scale.views=40
try side96 model=plane_sweep_guided auxiliary=mask_depth scale.views=40 scale.image_side=96
tabulate base side96
