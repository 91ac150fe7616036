#!/usr/bin/env bash
# The cost volumes of model=stereo on a whole schedule of 2,500 steps; one seed each. Those of disparities but the paper's
# have all that the working volume can have.
set -euo pipefail
family=cost_volumes interval=500
source "$(dirname "$0")/../family.sh"

volume() { # name, overrides
    local name=$1; shift
    fit "$runs/$name" model=stereo steps=2500 "$@"
}

volume correlation
volume correlation_signed model/cost_volume=correlation_signed
volume groupwise model/cost_volume=groupwise model.cost_volume.disparities=null
volume concat model/cost_volume=concat model.cost_volume.disparities=null
volume plane_sweep model/cost_volume=plane_sweep
tabulate correlation correlation_signed groupwise concat plane_sweep
