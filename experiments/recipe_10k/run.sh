#!/usr/bin/env bash
# Mono, the paper's stereo and the calibrated plane sweep, the latter also with auxiliary tasks, on a quarter of the
# paper's schedule. Results go beside this file.
set -euo pipefail
family=recipe_10k
source "$(dirname "$0")/../recipe.sh"

learn mono_scratch 10000 model=mono_scratch
learn stereo 10000 model=stereo
learn plane_sweep_stereo 10000 model=plane_sweep_stereo
learn plane_sweep_stereo_aided 10000 model=plane_sweep_stereo auxiliary=mask_depth
against stereo_against_mono $family/plane_sweep_stereo $family/mono_scratch
against paper_stereo_against_mono $family/stereo $family/mono_scratch
against aided_against_mono $family/plane_sweep_stereo_aided $family/mono_scratch
against aided_against_unaided $family/plane_sweep_stereo_aided $family/plane_sweep_stereo
