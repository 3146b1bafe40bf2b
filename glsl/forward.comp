// Renders transients. A workgroup owns a tile of LANES consecutive pairs and a chunk of consecutive active voxels. A
// lane owns one pair and iterates over the chunk, so lanes of a workgroup never add to the same bin, and all read the
// same voxel at once (one broadcast load). Other workgroups share the pair, hence accumulate(), behind a private
// column where atomics are slow (window.glsl). Chunks stay below 65,535 loop turns, where lavapipe stops without an
// error. Devices without such atomics run forward_owned.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#ifdef ACCUMULATE_FLOAT
#extension GL_EXT_shader_atomic_float : require
#endif
#ifdef ACCUMULATE_FIXED
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#endif
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(local_size_x_id = 10) in;
layout(constant_id = 10) const uint LANES = 64u;
layout(constant_id = 11) const uint CHUNK = 256u;
layout(constant_id = 12) const uint SPLIT = 1u;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
#include "chunks.glsl"
#include "samples.glsl"
layout(std430, set = 0, binding = 5) readonly buffer Wall { vec4 wall[]; };

#ifdef ACCUMULATE_FIXED
#include "fixed.glsl"
float fixed_scale;
#endif
#include "place.glsl"
#include "accumulate.glsl"
#define COLUMNS LANES
#include "window.glsl"

void main() {
    uint pair = gl_WorkGroupID.x * LANES + gl_LocalInvocationID.x;
    if (pair >= scene.pairs) return;
    uint voxels = counts[COUNT_ACTIVE];
    read_scene();
    uint chunk = chunk_of(voxels, parts(scene.pairs, LANES));
    uint begin = (push.first + gl_WorkGroupID.y) * chunk;
    uint end = min(begin + chunk, voxels);
#ifdef ACCUMULATE_FIXED
    fixed_scale = ldexp(1.0, fixed_exponent(uintBitsToFloat(counts[COUNT_PEAK_ALBEDO]), scene.kernel_bound, voxels));
#endif
    // Loaded once: the compiler cannot know that writes to histograms do not change the wall.
    uint other = GEOMETRY == TWO_POINTS ? scene.scanned + pair : pair;
    uint normals = scene.scanned + scene.others;
    vec3 point_a = wall[pair].xyz;
    vec3 point_b = wall[other].xyz;
    vec3 normal_a = CURVED != 0u ? wall[normals + pair].xyz : vec3(0.0);
    vec3 normal_b = CURVED != 0u ? wall[normals + other].xyz : vec3(0.0);
    uint row = row_of(pair);
    uint column = gl_LocalInvocationID.x;
    clear_column(column);
    Run run = NO_RUN;
    for (uint slot = begin; slot < end; ++slot) {
        vec4 s = point_at(slot);
        Arm a = arm_to(point_a, normal_a, s.xyz);
        Arm b = a;
        if (GEOMETRY == TWO_POINTS) b = arm_to(point_b, normal_b, s.xyz);
        float value = s.w * (a.falloff * b.falloff);
        if (NORMALS) value *= shine(a, b, normal_at(slot));
        deposit(column, row, place_of(a, b), value, run);
        if (RUNS != 0u && slot % LONGEST_RUN == 0u) flush(row, run);
    }
    finish_run(column, row, run);
}
