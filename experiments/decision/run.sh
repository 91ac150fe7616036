#!/usr/bin/env bash
# One threshold for all pairs against one for each, of the weights for photographs and of the guided plane sweep on the
# recipe: on validation objects and, with REAL=DIR, on real ones. Nothing is trained. Results go beside this file.
set -euo pipefail
family=decision
source "$(dirname "$0")/../family.sh"
measure() { .venv/bin/python -m experiments.decision.measure "$@" views=4 trainer.threads=1 workers=1; }

guided=outputs/recipe_10k/plane_sweep_guided/best.ckpt field=outputs/field/best.ckpt
measure recipe_val $guided val
measure field_val $field val
if [ -n "${REAL:-}" ]; then
    measure recipe_real $guided all data=meshes data.root="$REAL" data.views=16
    measure field_real $field all "${standing[@]}" data.views=4 rig=zed_mini
fi
