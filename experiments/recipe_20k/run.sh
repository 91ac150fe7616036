#!/usr/bin/env bash
# The plane sweep with auxiliary tasks on twice the schedule of ../recipe_10k; its weights are shipped as paper_rig. Results
# go beside this file.
set -euo pipefail
family=recipe_20k interval=1000
source "$(dirname "$0")/../family.sh"

learn plane_sweep_stereo_aided 20000 model=plane_sweep_stereo auxiliary=mask_depth
against half_the_schedule $family/plane_sweep_stereo_aided recipe_10k/plane_sweep_stereo_aided
if [ -n "${REAL:-}" ]; then
    against half_the_schedule_real $family/plane_sweep_stereo_aided recipe_10k/plane_sweep_stereo_aided real
fi
.venv/bin/python -m stereo_occ.export checkpoint="$runs/plane_sweep_stereo_aided/best.ckpt" \
    output=stereo_occ/weights/paper_rig metrics="$here/plane_sweep_stereo_aided/test.json"
