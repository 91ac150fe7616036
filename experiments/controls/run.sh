#!/usr/bin/env bash
# What the plane sweep of ../recipe_40k, which ships as paper_rig, makes of pairs from which something is taken that it was
# trained with. Nothing is trained. Results go beside this file.
set -euo pipefail
family=controls
source "$(dirname "$0")/../family.sh"

for control in none left_twice right_shuffled calibration_off_0.5 calibration_off_1 calibration_off_2; do
    judge "$runs/$control" checkpoint=paper_rig control=$control views=4 meshes=0
    keep "$runs/$control" $control
done
