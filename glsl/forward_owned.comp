// Renders transients without atomics, for CPUs, where a lane is a component of one core's vector. A workgroup owns
// HELD * LANES consecutive pairs, or as many consecutive scanned points with one other point of a product. A dispatch
// has one chunk of active voxels, so a histogram belongs to one lane and a plain addition suffices. A lane owns HELD
// histograms: one load of a sample serves all of them, and in a product one arm to the other point. Columns in the
// lane's own memory would be faster, but lavapipe compiles their array for a second (benches/NOTES.md). Loop turns:
// CHUNK, hence no loop over the histograms of a lane; lavapipe stops after 65,535 without an error.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(local_size_x_id = 10) in;
layout(constant_id = 10) const uint LANES = 8u;
layout(constant_id = 11) const uint CHUNK = 256u;
layout(constant_id = 12) const uint SPLIT = 1u;
layout(constant_id = 13) const uint HELD = 1u; // 1 or 2
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
#include "samples.glsl"
layout(std430, set = 0, binding = 5) readonly buffer Wall { vec4 wall[]; };
#define ACCUMULATE_OWNED
#include "place.glsl"
#include "accumulate.glsl"

const uint MOST = 2u;

vec3 point_a[MOST];
vec3 point_b[MOST];
vec3 normal_a[MOST];
vec3 normal_b[MOST];
uint rows[MOST]; // NOWHERE behind the last histogram
Run runs[MOST];

// Adds a sample to the k-th histogram. `b`: the arm to the other point of a product.
void add(vec4 s, vec3 normal, Arm b, uint k) {
    Arm a = arm_to(point_a[k], normal_a[k], s.xyz);
    if (GEOMETRY == CONFOCAL) b = a;
    if (GEOMETRY == TWO_POINTS) b = arm_to(point_b[k], normal_b[k], s.xyz);
    float value = s.w * (a.falloff * b.falloff);
    if (NORMALS) value *= shine(a, b, normal);
    if (rows[k] != NOWHERE) accumulate_at(rows[k], place_of(a, b), value, runs[k]);
}

void main() {
    uint all = GEOMETRY == PRODUCT ? scene.scanned : scene.pairs;
    uint tiles = (all + LANES * HELD - 1u) / (LANES * HELD);
    uint other = GEOMETRY == PRODUCT ? gl_WorkGroupID.x / tiles : 0u;
    uint first = gl_WorkGroupID.x % tiles * (LANES * HELD) + gl_LocalInvocationID.x;
    if (first >= all || (GEOMETRY == PRODUCT && other >= scene.others)) return;
    uint voxels = counts[COUNT_ACTIVE];
    read_scene();
    uint begin = (push.first + gl_WorkGroupID.y) * CHUNK;
    uint end = min(begin + CHUNK, voxels);
    uint normals = scene.scanned + scene.others;
    for (uint k = 0u; k < HELD; ++k) {
        uint point = min(first + k * LANES, all - 1u);
        uint at = GEOMETRY == CONFOCAL ? point : scene.scanned + (GEOMETRY == PRODUCT ? other : point);
        rows[k] = first + k * LANES < all ? row_of(other * all + point) : NOWHERE;
        point_a[k] = wall[point].xyz;
        point_b[k] = wall[at].xyz;
        normal_a[k] = CURVED != 0u ? wall[normals + point].xyz : vec3(0.0);
        normal_b[k] = CURVED != 0u ? wall[normals + at].xyz : vec3(0.0);
        runs[k] = NO_RUN;
    }
    for (uint slot = begin; slot < end; ++slot) {
        vec4 s = point_at(slot);
        vec3 normal = NORMALS ? normal_at(slot) : vec3(0.0);
        Arm b;
        if (GEOMETRY == PRODUCT) b = arm_to(point_b[0], normal_b[0], s.xyz);
        add(s, normal, b, 0u);
        if (HELD > 1u) add(s, normal, b, 1u);
        if (RUNS != 0u && slot % LONGEST_RUN == 0u) {
            for (uint k = 0u; k < HELD; ++k) flush(rows[k], runs[k]);
        }
    }
    for (uint k = 0u; k < HELD; ++k) flush(rows[k], runs[k]);
}
