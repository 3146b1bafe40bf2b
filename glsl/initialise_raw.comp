// Initial volume of the paper's solver: albedo uniform in [0, ALBEDO_SPAN), normals zero. One invocation owns one
// touched voxel. Numbers depend on the voxel, not on its slot, so the volume is independent of device and room.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "random.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const float ALBEDO_SPAN = 1.0;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Raw { vec4 raw[]; };

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= counts[COUNT_TOUCHED]) return;
    raw[at] = vec4(ALBEDO_SPAN * random3(active_voxels[at], 0u, 0u).x, 0.0, 0.0, 0.0);
}
