#!/usr/bin/env bash
# What needs no training of a network, on test objects and, where REAL names a folder of them, on real ones, with the
# objects, views and points of ../recipe_10k. Results go beside this file.
set -euo pipefail
family=floors
source "$(dirname "$0")/../family.sh"

measure() { # baseline, where, overrides
    local name=$1 where=$2; shift 2
    judge "$runs/$name/$where" baseline="$name" keep=false "$@"
    keep "$runs/$name/$where" "$name/$where"
}

for name in visual_hull sgm mean_shape nearest_shape truth; do
    measure $name test
    if [ -n "${REAL:-}" ]; then
        measure $name real data=meshes data.root="$REAL" data.views=16
    fi
done
