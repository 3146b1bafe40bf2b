// Expected brightness of the active voxels, as weights of the bound that step lengths come from (bound.comp):
//   (s + FLOOR)^power / (1 + FLOOR)^power
// where s is the last reduction's smoothed albedo over its maximum; DOUBLED: the parent voxel's. push.flags holds the
// bits of the power. One invocation owns one active voxel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint DOUBLED = 0u;
const float FLOOR = 0.05;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 4) buffer SamplePoints { vec4 sample_points[]; };

void main() {
    uint slot = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (slot >= counts[COUNT_ACTIVE]) return;
    uint index = active_voxels[slot];
    if (DOUBLED != 0u) index = coarse_index(parent_of(voxel_at(index)));
    float most = uintBitsToFloat(counts[COUNT_PEAK_SMOOTH]);
    float share = most > 0.0 ? min(source[index] / most, 1.0) : 1.0;
    float floored = (share + FLOOR) / (1.0 + FLOOR);
    sample_points[slot].w = pow(floored, uintBitsToFloat(push.flags));
}
