// The point at which FISTA takes its next step: y = v + beta (v - v before), into the samples that every pair
// sees: as directions, or as albedos where surfaces have none. One invocation owns one active voxel. Points are the
// voxels' centres, set once per domain by points.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) readonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 4) readonly buffer Before { vec4 before[]; };
layout(std430, set = 0, binding = 5) readonly buffer Momentum { float momentum[]; };
layout(std430, set = 0, binding = 6) writeonly buffer SampleNormals { vec4 sample_normals[]; };
layout(std430, set = 0, binding = 7) writeonly buffer SamplePoints { vec4 sample_points[]; };

shared float peaks[WORKGROUP];

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint slot = group_index() * WORKGROUP + lane;
    float magnitude = 0.0;
    if (slot < counts[COUNT_ACTIVE]) {
        uint index = active_voxels[slot];
        vec3 v = raw[index].xyz;
        vec3 y = v + momentum[MOMENTUM_BETA] * (v - before[index].xyz);
        if (NORMALS) sample_normals[slot] = vec4(y, 0.0);
        else sample_points[slot].w = -y.z;
        magnitude = length(y);
    }
    peaks[lane] = magnitude;
    barrier();
    for (uint stride = WORKGROUP / 2u; stride > 0u; stride >>= 1) {
        if (lane < stride) peaks[lane] = max(peaks[lane], peaks[lane + stride]);
        barrier();
    }
    // For the fixed-point scale; bits of nonnegative floats order as the floats do.
    if (lane == 0u) atomicMax(counts[COUNT_PEAK_ALBEDO], floatBitsToUint(peaks[0]));
}
