#!/usr/bin/env bash
# What one change does to the plane sweep's first steps, cheaply: each row of probes.csv is a run of the recipe on a
# schedule of 3,000 steps that may be stopped (Ctrl-C) once it has shown enough. One seed each.
set -euo pipefail
cd "$(dirname "$0")/../.."
export OMP_NUM_THREADS=1

probe() { # name, overrides
    name=$1; shift
    .venv/bin/python -m stereo_occ.train experiment=recipe scale=laptop model=plane_sweep_stereo steps=3000 \
        validation.interval=300 validation.views=4 validation.points=8192 trainer.threads=1 progress=false \
        hydra.run.dir="outputs/probes/$name" "$@"
}

probe base
probe points points=2048 queries.box=0.3 queries.outside=0.2 queries.surface=0.5
probe wide 'model.widths=[32,64,128]' queries.box=0.35 queries.outside=0.2 queries.surface=0.45
probe rate optimizer.lr=3e-3
probe auxiliary auxiliary=mask_depth
probe around model.around=object
cd outputs/probes
../../.venv/bin/python ../../experiments/changes.py ../../experiments/probes/probes.csv base points wide rate auxiliary around
