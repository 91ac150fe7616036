#!/usr/bin/env bash
# Was it short training? The paper's two models, the calibrated ones and the twin of one view of the best on its whole
# schedule: 40,000 iterations validated every 4,000, with batches of 8. The weights of the guided plane sweep are shipped as
# paper_rig. Results go beside this file.
set -euo pipefail
family=recipe_40k interval=4000
source "$(dirname "$0")/../family.sh"

learn mono_scratch 40000 model=mono_scratch scale.batch_size=8
learn stereo 40000 model=stereo scale.batch_size=8
learn stereo_signed 40000 model=stereo_signed scale.batch_size=8
learn pixel_stereo 40000 model=pixel_stereo scale.batch_size=8
learn plane_sweep_stereo 40000 model=plane_sweep_stereo scale.batch_size=8
learn plane_sweep_guided_left 40000 model=plane_sweep_guided auxiliary=mask_depth model.views=left scale.batch_size=8
learn plane_sweep_guided 40000 model=plane_sweep_guided auxiliary=mask_depth scale.batch_size=8
against stereo_against_mono $family/stereo $family/mono_scratch
against guided_against_mono $family/plane_sweep_guided $family/mono_scratch
against guided_against_paper_stereo $family/plane_sweep_guided $family/stereo
against guided_against_its_mono $family/plane_sweep_guided $family/plane_sweep_guided_left
against signed_against_paper_stereo $family/stereo_signed $family/stereo
against guided_against_plane_sweep $family/plane_sweep_guided $family/plane_sweep_stereo
against twin_against_paper_stereo $family/plane_sweep_guided_left $family/stereo
if [ -n "${REAL:-}" ]; then
    against guided_against_its_mono_real $family/plane_sweep_guided $family/plane_sweep_guided_left real
fi
for name in mono_scratch stereo stereo_signed pixel_stereo plane_sweep_stereo plane_sweep_guided_left plane_sweep_guided; do
    against ${name}_against_quarter $family/$name recipe_10k/$name
    if [ -n "${REAL:-}" ]; then
        against ${name}_against_quarter_real $family/$name recipe_10k/$name real
    fi
done
.venv/bin/python -m stereo_occ.export checkpoint="$runs/plane_sweep_guided/best.ckpt" \
    output=stereo_occ/weights/paper_rig metrics="$here/plane_sweep_guided/test.json"
