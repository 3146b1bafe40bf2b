// Renders transients of product scans. A workgroup owns LANES scanned points, FORWARD_OTHERS other points and a chunk
// of active voxels. A lane owns one scanned point and its FORWARD_OTHERS histograms, and computes its arm to a voxel
// once for all of them. The arms to the other points are common to all lanes: the workgroup computes those of BLOCK
// voxels jointly in shared memory. A pair then costs one sum of distances and one product, plus 1 / FORWARD_OTHERS and
// 1 / LANES of an arm. Loop turns: about CHUNK * (FORWARD_OTHERS + 1). Devices without atomics run forward_owned.comp.
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
layout(constant_id = 14) const uint FORWARD_OTHERS = 1u;
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
#define COLUMNS (LANES * FORWARD_OTHERS)
#include "window.glsl"

const uint BLOCK = 64u;
shared vec2 other_arms[BLOCK * FORWARD_OTHERS]; // distance, factor of the value
shared float other_rests[FINE * BLOCK * FORWARD_OTHERS + 1u];

// An arm's factor of the value, for a surface in this direction; `directed`: with the surface's cosine.
float part(Arm arm, vec3 direction, bool directed) {
    float value = arm.falloff;
    if (REFLECTANCE == LAMBERTIAN) value *= arm.wall * arm.inverse;
    if (directed) value *= max(dot(direction, arm.way), 0.0) * arm.inverse;
    return value;
}

// The arm to an other point: distance, factor of the value (including albedo), rest of the distance.
vec3 other_arm(vec3 there, vec3 normal, uint slot) {
    vec4 s = point_at(slot);
    Arm b = arm_to(there, normal, s.xyz);
    // The cosine model has no cosine toward the other point.
    vec3 own = REFLECTANCE == LAMBERTIAN ? normal_at(slot) : vec3(0.0);
    float value = part(b, own, REFLECTANCE == LAMBERTIAN);
    return vec3(b.distance, value * s.w, b.rest);
}

// Private column of a lane's k-th histogram, and the first cell of a pair's histogram.
uint column_of(uint k) { return k * LANES + gl_LocalInvocationID.x; }
uint row_of(uint other, uint point) { return row_of(other * scene.scanned + point); }

Run runs[FORWARD_OTHERS];

// Adds the value of a pair's two arms to its histogram.
void meet(Arm a, float value, vec3 b, uint k, uint row) {
    deposit(column_of(k), row, place_of(a.distance + b.x, a.rest + b.z), value * b.y, runs[k]);
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint tiles = (scene.scanned + LANES - 1u) / LANES;
    uint point = (gl_WorkGroupID.x % tiles) * LANES + lane;
    uint other = (gl_WorkGroupID.x / tiles) * FORWARD_OTHERS;
    // The dispatch may be sized for more pairs. All lanes return together.
    if (other >= scene.others) return;
    uint others = min(FORWARD_OTHERS, scene.others - other);
    bool owned = point < scene.scanned;
    uint voxels = counts[COUNT_ACTIVE];
    read_scene();
    uint chunk = chunk_of(voxels, tiles * parts(scene.others, FORWARD_OTHERS));
    uint begin = (push.first + gl_WorkGroupID.y) * chunk;
    uint end = min(begin + chunk, voxels);
#ifdef ACCUMULATE_FIXED
    fixed_scale = ldexp(1.0, fixed_exponent(uintBitsToFloat(counts[COUNT_PEAK_ALBEDO]), scene.kernel_bound, voxels));
#endif
    uint normals = scene.scanned + scene.others;
    for (uint k = 0u; k < FORWARD_OTHERS; ++k) {
        runs[k] = NO_RUN;
        clear_column(column_of(k));
    }
    vec3 here = owned ? wall[point].xyz : vec3(0.0);
    vec3 normal = owned && CURVED != 0u ? wall[normals + point].xyz : vec3(0.0);
    for (uint block = begin; block < end; block += BLOCK) {
        uint held = min(BLOCK, end - block);
        barrier();
        for (uint i = lane; i < held * FORWARD_OTHERS; i += LANES) {
            if (i % FORWARD_OTHERS >= others) continue;
            uint at = scene.scanned + other + i % FORWARD_OTHERS;
            vec3 there_normal = CURVED != 0u ? wall[normals + at].xyz : vec3(0.0);
            vec3 b = other_arm(wall[at].xyz, there_normal, block + i / FORWARD_OTHERS);
            other_arms[i] = b.xy;
            if (FINE != 0u) other_rests[i] = b.z;
        }
        barrier();
        if (!owned) continue;
        for (uint i = 0u; i < held; ++i) {
            Arm a = arm_to(here, normal, point_at(block + i).xyz);
            float value = part(a, NORMALS ? normal_at(block + i) : vec3(0.0), NORMALS);
            for (uint k = 0u; k < FORWARD_OTHERS; ++k) {
                if (k >= others) break;
                float rest = FINE != 0u ? other_rests[i * FORWARD_OTHERS + k] : 0.0;
                meet(a, value, vec3(other_arms[i * FORWARD_OTHERS + k], rest), k, row_of(other + k, point));
            }
        }
        for (uint k = 0u; k < others; ++k) flush(row_of(other + k, point), runs[k]);
    }
    if (!owned) return;
    for (uint k = 0u; k < others; ++k) finish_run(column_of(k), row_of(other + k, point), runs[k]);
}
