#!/usr/bin/env bash
# The paper's remark that surfaces which reflect or have no texture are hard for stereo, of the weights for photographs:
# the same test objects in the same scenes, matt and glossy, plain and patterned. Nothing is trained. Results go beside
# this file.
set -euo pipefail
family=field_surfaces
source "$(dirname "$0")/../family.sh"

for material in plain glossy; do
    for texture in none procedural; do
        name=${material}_$texture share=()
        if [ $texture = procedural ]; then share=(texture.share=1); fi
        judge "$runs/$name" checkpoint=field subset=test data=procedural views=2 keep=false workers=1 \
            material=$material texture=$texture "${share[@]}"
    done
done
for name in plain_none plain_procedural glossy_none glossy_procedural; do keep "$runs/$name" $name; done
for pair in glossy_none-plain_none plain_procedural-plain_none glossy_procedural-glossy_none; do
    differ $pair "$runs/${pair%-*}" "$runs/${pair#*-}"
done
