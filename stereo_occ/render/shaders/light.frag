#version 330 core
// Light on what store.frag has stored. The reflectance is glTF's metallic-roughness model (Burley's GGX, Schlick).
const int THINGS = 16;
const int LIGHTS = 4;
const float PI = 3.14159265;
const float GAMMA = 2.2;
const float DIELECTRIC = 0.04;
const int TAPS = 5;

uniform sampler2D stored_position;
uniform sampler2D stored_normal;
uniform sampler2D stored_pattern;
uniform sampler2D stored_open;
uniform sampler2DArrayShadow shadow_maps;
uniform mat4 map_from_rig[LIGHTS];
uniform float shadow_edge;  // half width, sides of a map; below 0: there are no shadows
uniform float shadow_lift;  // off the surface, before the map is asked; units of the rig frame
uniform vec4 finishes[4 * THINGS];
uniform vec4 contacts[THINGS];  // where things stand, w: how far their shade reaches
uniform int contact_count;
uniform vec3 camera_position;
uniform vec4 depth_from_rig;
uniform vec3 light_from[LIGHTS];
uniform vec3 light_color[LIGHTS];
uniform int light_count;
uniform float ambient;
uniform vec3 up;

layout(location = 0) out vec4 color;  // alpha: the object
layout(location = 1) out float depth;  // of the object

uint scramble(uint h) {
    h = (h ^ (h >> 16)) * 0x7feb352du;
    h = (h ^ (h >> 15)) * 0x846ca68bu;
    return h ^ (h >> 16);
}

float random(ivec3 cell) {
    uvec3 c = uvec3(cell) * uvec3(0x9e3779b1u, 0x85ebca77u, 0xc2b2ae3du);
    return float(scramble(c.x ^ c.y ^ c.z) >> 8) / 16777216.0;
}

// Value noise, 0 to 1.
float noise(vec3 at) {
    vec3 whole = floor(at), f = at - whole;
    ivec3 c = ivec3(whole);
    f = f * f * (3.0 - 2.0 * f);
    vec4 near = vec4(random(c), random(c + ivec3(1, 0, 0)), random(c + ivec3(0, 1, 0)), random(c + ivec3(1, 1, 0)));
    c.z += 1;
    vec4 far = vec4(random(c), random(c + ivec3(1, 0, 0)), random(c + ivec3(0, 1, 0)), random(c + ivec3(1, 1, 0)));
    vec4 z = mix(near, far, f.z);
    vec2 y = mix(z.xy, z.zw, f.y);
    return mix(y.x, y.y, f.x);
}

float clouds(vec3 at) {
    return 0.6 * noise(at) + 0.4 * noise(2.03 * at + 7.3);
}

// 1 in the middle share of each period, 0 elsewhere, with edges as wide as a sample.
float bands(float at, float width, float share) {
    float triangle = abs(2.0 * fract(at) - 1.0), edge = 2.0 * width;
    return 1.0 - smoothstep(share - edge, share + edge, triangle);
}

// What the second colour covers at a place of pattern space, 0 to 1; ink: how much of it is printed on.
float covered(int kind, vec3 at, vec3 width, float warp, float level, vec4 extra, bool inside, out float ink) {
    ink = 0.0;
    float n = clouds(kind == 6 ? 5.0 * at : at);
    vec3 bent = at + 2.0 * warp * (n - 0.5);
    if (kind == 1) return bands(bent.x, width.x, level);
    if (kind == 2) {
        vec3 sign = vec3(bands(bent.x, width.x, 0.5), bands(bent.y, width.y, 0.5), bands(bent.z, width.z, 0.5));
        sign = 2.0 * sign - 1.0;
        return 0.5 + 0.5 * sign.x * sign.y * sign.z;
    }
    if (kind == 3) return smoothstep(level - 0.15, level + 0.15, n);
    if (kind == 4) return 0.5 + 0.5 * sin(2.0 * PI * (at.x + 4.0 * warp * n));
    if (kind == 5) {
        ivec3 cell = ivec3(floor(bent));
        float size = 0.2 + 0.28 * random(cell + 31);
        return 1.0 - smoothstep(size - width.x, size + width.x, length(fract(bent) - 0.5));
    }
    if (kind == 6) return inside ? 1.0 : smoothstep(level - 0.01, level + 0.01, at.y + 4.0 * warp * (n - 0.5));
    if (kind == 7) {
        float turn = atan(at.x, at.z) - extra.z;
        turn -= 2.0 * PI * floor(turn / (2.0 * PI) + 0.5);
        if (inside || abs(turn) > extra.w || at.y < extra.x || at.y > extra.y) return 0.0;
        float row = 7.0 * (at.y - extra.x) / (extra.y - extra.x);
        ivec3 letter = ivec3(floor(turn * 9.0), floor(row), int(extra.z * 1000.0));
        float written = step(0.45, random(letter)) * step(0.3, fract(row)) * step(0.15, fract(turn * 9.0));
        ink = written * step(1.0, row) * step(row, 6.0) * step(abs(turn), 0.85 * extra.w);
        return 1.0;
    }
    return 0.0;
}

// What a mirror sees in a direction: floor, walls and ceiling, and a window or lamp where each light is.
vec3 surroundings(vec3 towards, float roughness) {
    float soft = 0.04 + 0.7 * roughness;
    vec3 seen = vec3(ambient * mix(0.5, 1.8, smoothstep(-soft, 0.3 + soft, dot(towards, up))));
    for (int i = 0; i < light_count; i++) {
        float facing = dot(towards, light_from[i]);
        vec3 across = normalize(cross(light_from[i], vec3(0.31, 0.95, 0.04)));
        vec2 at = vec2(dot(towards, across), dot(towards, cross(across, light_from[i]))) / max(facing, 0.05);
        vec2 half_size = vec2(0.28, 0.4);
        vec2 within = 1.0 - smoothstep(half_size - 0.5 * soft, half_size + 0.5 * soft, abs(at));
        float bar = i == 1 ? 1.0 : smoothstep(0.01, 0.03 + soft, abs(at.x));
        seen += light_color[i] * (facing > 0.0 ? 2.2 * within.x * within.y * bar : 0.0);
    }
    return seen;
}

// Share of a light that nothing keeps from a place: the map asked on a disc as wide as shadows' edges, turned at random.
float reached(int light, vec3 place, vec3 n, ivec2 sample_at) {
    vec3 at = (map_from_rig[light] * vec4(place + shadow_lift * n, 1.0)).xyz;
    float border = 2.0 * max(abs(at.x - 0.5), abs(at.y - 0.5));
    if (border >= 1.0) return 1.0;
    float turn = 2.0 * PI * random(ivec3(sample_at, light)), share = 0.0;
    for (int i = 0; i < TAPS; i++) {
        float angle = turn + 2.39996 * float(i), far = shadow_edge * sqrt((float(i) + 0.5) / float(TAPS));
        share += texture(shadow_maps, vec4(at.xy + far * vec2(cos(angle), sin(angle)), light, at.z));
    }
    return mix(share / float(TAPS), 1.0, smoothstep(0.85, 1.0, border));
}

void main() {
    ivec2 sample_at = ivec2(gl_FragCoord.xy);
    vec4 place = texelFetch(stored_position, sample_at, 0);
    vec4 facing = texelFetch(stored_normal, sample_at, 0);
    vec4 pattern = texelFetch(stored_pattern, sample_at, 0);
    vec3 at = pattern.xyz;
    int thing = int(place.w + 0.5);
    vec4 f0 = finishes[4 * thing], f1 = finishes[4 * thing + 1];
    vec4 f2 = finishes[4 * thing + 2], f3 = finishes[4 * thing + 3];
    vec3 n = normalize(facing.xyz), v = normalize(camera_position - place.xyz);
    int kind = int(f0.w + 0.5);

    vec3 width = min(abs(dFdx(at)) + abs(dFdy(at)), 0.5);
    float ink;
    float second = covered(kind, at, width, f2.z, f2.w, f3, pattern.w > 0.5, ink);
    vec3 base = mix(mix(f0.rgb, f1.rgb, second), 0.15 * f0.rgb, ink);
    if (kind == 8) {
        float bytes = facing.w;
        float red = floor(bytes / 65536.0), green = floor((bytes - 65536.0 * red) / 256.0);
        base = vec3(red, green, bytes - 65536.0 * red - 256.0 * green) / 255.0;
        base *= base;  // stored as square roots
    }

    float metallic = f2.x, roughness = clamp(f1.w, 0.04, 1.0);
    float a2 = pow(roughness, 4.0), k = (roughness + 1.0) * (roughness + 1.0) / 8.0;
    vec3 diffuse = base * (1.0 - DIELECTRIC) * (1.0 - metallic);
    vec3 mirrored = mix(vec3(DIELECTRIC), base, metallic);
    float nv = clamp(abs(dot(n, v)), 0.001, 1.0);

    float shade = 1.0;
    if (f3.w < 0.0) {  // what things stand on
        for (int i = 0; i < contact_count; i++) {
            vec3 away = (place.xyz - contacts[i].xyz) / contacts[i].w;
            shade *= 1.0 - 0.75 * exp(-3.0 * dot(away, away));
        }
    }
    float open = texelFetch(stored_open, sample_at, 0).r;
    vec3 lit = base * ambient * open / (1.0 - base * (1.0 - open));  // what is kept out is lit by light from the object
    for (int i = 0; i < light_count; i++) {
        vec3 l = light_from[i], h = normalize(l + v);
        float nl = clamp(dot(n, l), 0.001, 1.0), nh = clamp(dot(n, h), 0.0, 1.0), vh = clamp(dot(v, h), 0.0, 1.0);
        vec3 fresnel = mirrored + (1.0 - mirrored) * pow(1.0 - vh, 5.0);
        float hidden = nv / (nv * (1.0 - k) + k) * nl / (nl * (1.0 - k) + k);
        float spread = nh * nh * (a2 - 1.0) + 1.0;
        vec3 gloss = fresnel * hidden * a2 / (PI * spread * spread) / (4.0 * nl * nv + 0.001);
        float share = shadow_edge < 0.0 ? 1.0 : reached(i, place.xyz, n, sample_at);
        lit += share * nl * light_color[i] * ((1.0 - fresnel) * diffuse / PI + gloss);
    }
    lit *= shade;
    if (f2.y > 0.0) {
        vec3 fresnel = mirrored + (1.0 - mirrored) * pow(1.0 - nv, 5.0);
        float clear = (1.0 - roughness) * (1.0 - roughness);
        lit += f2.y * clear * fresnel * surroundings(reflect(-v, n), roughness) * shade * open;
    }
    color = vec4(clamp(pow(lit, vec3(1.0 / GAMMA)), 0.0, 1.0), thing == 0 ? 1.0 : 0.0);
    depth = thing == 0 ? dot(depth_from_rig, vec4(place.xyz, 1.0)) : 0.0;
}
