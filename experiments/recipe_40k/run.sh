#!/usr/bin/env bash
# Was it short training? The paper's two models on its whole schedule, 40,000 iterations validated every 4,000, with batches
# of 8. Results go beside this file.
set -euo pipefail
family=recipe_40k interval=4000
source "$(dirname "$0")/../family.sh"

learn mono_scratch 40000 model=mono_scratch scale.batch_size=8
learn stereo 40000 model=stereo scale.batch_size=8
against stereo_against_mono $family/stereo $family/mono_scratch
for name in mono_scratch stereo; do
    against ${name}_against_quarter $family/$name recipe_10k/$name
    if [ -n "${REAL:-}" ]; then
        against ${name}_against_quarter_real $family/$name recipe_10k/$name real
    fi
done
