#!/usr/bin/env bash
# What stereo is for: size and distance unknown (placement=free), mono, the paper's stereo network, the plane sweep with
# auxiliary tasks, unguided and guided, and the guided one's twin of one view, on a quarter of the paper's schedule. Results go
# beside this file.
set -euo pipefail
family=free_10k interval=1000
source "$(dirname "$0")/../family.sh"

learn mono_scratch 10000 placement=free model=mono_scratch
learn stereo 10000 placement=free model=stereo
learn plane_sweep_stereo_aided 10000 placement=free model=plane_sweep_stereo auxiliary=mask_depth
learn plane_sweep_guided 10000 placement=free model=plane_sweep_guided auxiliary=mask_depth
learn plane_sweep_guided_left 10000 placement=free model=plane_sweep_guided auxiliary=mask_depth model.views=left
against stereo_against_mono $family/stereo $family/mono_scratch
against aided_against_mono $family/plane_sweep_stereo_aided $family/mono_scratch
against guided_against_mono $family/plane_sweep_guided $family/mono_scratch
against guided_against_aided $family/plane_sweep_guided $family/plane_sweep_stereo_aided
against guided_against_its_mono $family/plane_sweep_guided $family/plane_sweep_guided_left
if [ -n "${REAL:-}" ]; then
    against guided_against_its_mono_real $family/plane_sweep_guided $family/plane_sweep_guided_left real
fi
