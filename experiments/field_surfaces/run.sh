#!/usr/bin/env bash
# The paper's remark that surfaces which reflect or have no texture are hard for stereo, of the weights for photographs:
# the same test objects in the same scenes, matt and glossy, plain and patterned. Nothing is trained. Results go beside
# this file.
set -euo pipefail
cd "$(dirname "$0")/../.."
export OMP_NUM_THREADS=1
for material in plain glossy; do
    for texture in none procedural; do
        name=${material}_$texture share=()
        if [ $texture = procedural ]; then share=(texture.share=1); fi
        .venv/bin/python -m stereo_occ.evaluate checkpoint=outputs/field/best.ckpt subset=test data=procedural views=2 \
            points=20000 meshes=1 mesh_resolution=64 surface_points=20000 examples=0 keep=false trainer.threads=1 workers=1 \
            progress=false material=$material texture=$texture "${share[@]}" hydra.run.dir=outputs/field_surfaces/$name
        cp outputs/field_surfaces/$name/metrics.json experiments/field_surfaces/$name.json
        cp outputs/field_surfaces/$name/per_object.csv experiments/field_surfaces/$name.csv
    done
done
against() { # what A has over B
    .venv/bin/python -m stereo_occ.compare outputs/field_surfaces/$1 outputs/field_surfaces/$2 --output experiments/field_surfaces/$1-$2
}
against glossy_none plain_none
against plain_procedural plain_none
against glossy_procedural glossy_none
