#!/usr/bin/env bash
# What small changes do to the plane sweep's first steps, cheaply: each row of probes.csv is a run of the recipe on a
# schedule of 3,000 steps that may be stopped (Ctrl-C) once it has shown enough. One seed each.
set -euo pipefail
family=probes
source "$(dirname "$0")/../recipe.sh"

probe() { # name, overrides
    local name=$1; shift
    try "$name" 3000 validation.interval=300 "$@"
}

probe base
probe points points=2048 queries.box=0.3 queries.outside=0.2 queries.surface=0.5
probe wide 'model.widths=[32,64,128]' queries.box=0.35 queries.outside=0.2 queries.surface=0.45
probe rate optimizer.lr=3e-3
probe auxiliary auxiliary=mask_depth
probe around model.around=object
tabulate base points wide rate auxiliary around
