#!/usr/bin/env bash
# Every model on a quarter of the paper's schedule, the plane sweep also with auxiliary tasks and so its twin of one view;
# the guided one, and its twin of one view, with them alone.
# Results go beside this file.
set -euo pipefail
family=recipe_10k interval=1000
source "$(dirname "$0")/../family.sh"

learn mono_scratch 10000 model=mono_scratch
learn stereo 10000 model=stereo
learn stereo_signed 10000 model=stereo_signed
learn pixel_stereo 10000 model=pixel_stereo
learn plane_sweep_mono_aided 10000 model=plane_sweep_mono auxiliary=mask_depth
learn plane_sweep_stereo 10000 model=plane_sweep_stereo
learn plane_sweep_stereo_aided 10000 model=plane_sweep_stereo auxiliary=mask_depth
learn plane_sweep_guided 10000 model=plane_sweep_guided auxiliary=mask_depth
learn plane_sweep_guided_left 10000 model=plane_sweep_guided auxiliary=mask_depth model.views=left
against stereo_against_mono $family/plane_sweep_stereo $family/mono_scratch
against paper_stereo_against_mono $family/stereo $family/mono_scratch
against signed_against_paper_stereo $family/stereo_signed $family/stereo
against pixel_stereo_against_paper_stereo $family/pixel_stereo $family/stereo
against aided_against_mono $family/plane_sweep_stereo_aided $family/mono_scratch
against aided_against_its_mono $family/plane_sweep_stereo_aided $family/plane_sweep_mono_aided
against aided_against_unaided $family/plane_sweep_stereo_aided $family/plane_sweep_stereo
against guided_against_mono $family/plane_sweep_guided $family/mono_scratch
against guided_against_aided $family/plane_sweep_guided $family/plane_sweep_stereo_aided
against guided_against_its_mono $family/plane_sweep_guided $family/plane_sweep_guided_left
