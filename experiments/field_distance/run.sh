#!/usr/bin/env bash
# How near must the cameras be, and how far apart? The weights for photographs before real objects (REAL: their folder) at
# four distances, with a ZED Mini's baseline and with twice that. Nothing is trained. Results go beside this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=experiments/field_distance
export OMP_NUM_THREADS=1
for baseline in 0.063 0.12; do
    for distance in 0.35 0.5 0.7 1.0; do
        name=${baseline}_$distance
        .venv/bin/python -m stereo_occ.evaluate checkpoint=field data=meshes data.root="$REAL" data.views=2 texture=own \
            rig=zed_mini "rig.baseline=[$baseline,$baseline]" "rig.distance=[$distance,$distance]" views=2 points=20000 \
            meshes=1 mesh_resolution=64 surface_points=20000 examples=0 keep=false trainer.threads=1 workers=1 \
            progress=false hydra.run.dir=outputs/field_distance/$name
        cp outputs/field_distance/$name/metrics.json $here/$name.json
        cp outputs/field_distance/$name/per_object.csv $here/$name.csv
        sed -i "s|$REAL|REAL|" $here/$name.json
    done
done
for distance in 0.35 0.5 0.7 1.0; do
    .venv/bin/python -m stereo_occ.compare outputs/field_distance/{0.12,0.063}_$distance --output $here/wider_$distance
done
