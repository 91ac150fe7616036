#!/usr/bin/env bash
# What stereo is for, on the paper's whole schedule: size and distance unknown (placement=free), the paper's two models and
# the guided plane sweep with auxiliary tasks, 40,000 iterations validated every 4,000, batches of 8. Results go beside this file.
set -euo pipefail
family=free_40k interval=4000
source "$(dirname "$0")/../family.sh"

learn mono_scratch 40000 placement=free model=mono_scratch scale.batch_size=8
learn stereo 40000 placement=free model=stereo scale.batch_size=8
learn plane_sweep_guided 40000 placement=free model=plane_sweep_guided auxiliary=mask_depth scale.batch_size=8
against stereo_against_mono $family/stereo $family/mono_scratch
against guided_against_mono $family/plane_sweep_guided $family/mono_scratch
against guided_against_paper_stereo $family/plane_sweep_guided $family/stereo
for name in mono_scratch stereo plane_sweep_guided; do
    against ${name}_against_quarter $family/$name free_10k/$name
done
