#!/usr/bin/env bash
# The plane sweep with auxiliary tasks on twice the schedule of ../recipe_10k. Results go beside this file.
set -euo pipefail
family=recipe_20k interval=1000
source "$(dirname "$0")/../family.sh"

learn plane_sweep_stereo_aided 20000 model=plane_sweep_stereo auxiliary=mask_depth
against half_the_schedule $family/plane_sweep_stereo_aided recipe_10k/plane_sweep_stereo_aided
if [ -n "${REAL:-}" ]; then
    against half_the_schedule_real $family/plane_sweep_stereo_aided recipe_10k/plane_sweep_stereo_aided real
fi
