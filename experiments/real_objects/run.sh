#!/bin/sh
# What becomes of each of the real objects: quality.csv and quality.png. DIR is the folder with the objects.
set -eu
python -m stereo_occ.inspect data.root="${1:?give the folder of the real objects}" \
    data.table=experiments/real_objects/objects.csv hydra.run.dir=experiments/real_objects
rm -f experiments/real_objects/inspect.log
