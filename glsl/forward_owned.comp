// Renders transients without atomics. A workgroup owns LANES consecutive pairs, or as many consecutive scanned points with
// one other point of a product. A dispatch has one chunk of active voxels, so a histogram belongs to one lane and a plain
// addition suffices. Loop turns: CHUNK; lavapipe stops after 65,535 without an error.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(local_size_x_id = 10) in;
layout(constant_id = 10) const uint LANES = 64u;
layout(constant_id = 11) const uint CHUNK = 256u;
layout(constant_id = 12) const uint SPLIT = 1u;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
#include "samples.glsl"
layout(std430, set = 0, binding = 5) readonly buffer Wall { vec4 wall[]; };
#define ACCUMULATE_OWNED
#include "place.glsl"
#include "accumulate.glsl"

void main() {
    uint all = GEOMETRY == PRODUCT ? scene.scanned : scene.pairs;
    uint tiles = (all + LANES - 1u) / LANES;
    uint other = GEOMETRY == PRODUCT ? gl_WorkGroupID.x / tiles : 0u;
    uint point = gl_WorkGroupID.x % tiles * LANES + gl_LocalInvocationID.x;
    if (point >= all || (GEOMETRY == PRODUCT && other >= scene.others)) return;
    uint voxels = counts[COUNT_ACTIVE];
    read_scene();
    uint begin = (push.first + gl_WorkGroupID.y) * CHUNK;
    uint end = min(begin + CHUNK, voxels);
    uint normals = scene.scanned + scene.others;
    uint at = GEOMETRY == CONFOCAL ? point : scene.scanned + (GEOMETRY == PRODUCT ? other : point);
    vec3 point_a = wall[point].xyz;
    vec3 point_b = wall[at].xyz;
    vec3 normal_a = CURVED != 0u ? wall[normals + point].xyz : vec3(0.0);
    vec3 normal_b = CURVED != 0u ? wall[normals + at].xyz : vec3(0.0);
    uint row = row_of(other * all + point);
    Run run = NO_RUN;
    for (uint slot = begin; slot < end; ++slot) {
        vec4 s = point_at(slot);
        Arm a = arm_to(point_a, normal_a, s.xyz);
        Arm b = a;
        if (GEOMETRY != CONFOCAL) b = arm_to(point_b, normal_b, s.xyz);
        float value = s.w * (a.falloff * b.falloff);
        if (NORMALS) value *= shine(a, b, normal_at(slot));
        accumulate_at(row, place_of(a, b), value, run);
        if (RUNS != 0u && slot % LONGEST_RUN == 0u) flush(row, run);
    }
    flush(row, run);
}
