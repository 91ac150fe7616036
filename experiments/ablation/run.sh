#!/usr/bin/env bash
# Each training aid of the recipe taken away, and each that it leaves out added, on a whole schedule of 2,500 steps of the
# plane sweep; one seed each.
set -euo pipefail
family=ablation
source "$(dirname "$0")/../recipe.sh"

ablate() { # name, overrides
    local name=$1; shift
    try "$name" 2500 validation.interval=500 "$@"
}

ablate base
ablate auxiliary auxiliary=mask_depth
ablate queries queries=paper
ablate constant scheduler=constant
ablate ema averaging=ema
ablate stride model.feature_stride=2
ablate full augmentation=full
tabulate base auxiliary queries constant ema stride full
