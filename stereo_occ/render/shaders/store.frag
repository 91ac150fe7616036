#version 330 core
in vec3 rig_position;
in vec3 rig_normal;
in vec4 own_color;
in vec3 pattern_position;
in float open;
flat in float thing;

layout(location = 0) out vec4 stored_position;
layout(location = 1) out vec4 stored_normal;
layout(location = 2) out vec4 stored_pattern;
layout(location = 3) out float stored_open;

void main() {
    vec3 bytes = floor(clamp(own_color.rgb, 0.0, 1.0) * 255.0 + 0.5);
    stored_position = vec4(rig_position, thing);
    stored_normal = vec4(rig_normal, dot(bytes, vec3(65536.0, 256.0, 1.0)));  // exact: below 2^24
    stored_pattern = vec4(pattern_position, own_color.a);
    stored_open = open;
}
