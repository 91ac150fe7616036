#version 330 core
// Surfaces to images of what the light pass needs: where, facing where, which thing, where in its texture.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 color;  // square roots of the linear ones; w: 1 inside a vessel
layout(location = 3) in vec4 texture_position;  // w: number of the thing
layout(location = 4) in float openness;

uniform mat4 rig_from_model;
uniform mat4 clip_from_rig;
uniform mat4 texture_from_model;

out vec3 rig_position;
out vec3 rig_normal;
out vec4 own_color;
out vec3 pattern_position;
out float open;
flat out float thing;

void main() {
    vec4 placed = rig_from_model * vec4(position, 1.0);
    gl_Position = clip_from_rig * placed;
    rig_position = placed.xyz;
    rig_normal = mat3(rig_from_model) * normal;  // a similarity
    own_color = color;
    pattern_position = (texture_from_model * vec4(texture_position.xyz, 1.0)).xyz;
    open = openness;
    thing = texture_position.w;
}
