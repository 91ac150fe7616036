#!/usr/bin/env bash
# What small changes do to the plane sweep's first steps, cheaply: each row of probes.csv is a run of the recipe on a
# schedule of 3,000 steps that may be stopped (Ctrl-C) once it has shown enough. One seed each.
set -euo pipefail
family=probes steps=3000 interval=300
source "$(dirname "$0")/../family.sh"

try base
try points points=2048 queries.box=0.3 queries.outside=0.2 queries.surface=0.5
try wide 'model.widths=[32,64,128]' queries.box=0.35 queries.outside=0.2 queries.surface=0.45
try rate optimizer.lr=3e-3
try auxiliary auxiliary=mask_depth
try around model.around=object
tabulate base points wide rate auxiliary around
