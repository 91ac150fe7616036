#!/usr/bin/env bash
# Each training aid of the recipe taken away, and each that it leaves out added, and the second view taken away, on a whole
# schedule of 2,500 steps of the plane sweep; one seed each.
set -euo pipefail
family=ablation steps=2500 interval=500
source "$(dirname "$0")/../family.sh"

try base
try auxiliary auxiliary=mask_depth
try queries queries=paper
try constant scheduler=constant
try ema averaging=ema
try stride model.feature_stride=2
try full augmentation=full
try left_twice control=left_twice
try right_shuffled control=right_shuffled
tabulate base auxiliary queries constant ema stride full left_twice right_shuffled
