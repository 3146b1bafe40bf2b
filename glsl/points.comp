// Writes the centres of the active voxels as samples of unit weight. One invocation owns one active voxel. Runs once
// per domain; after that the vector solver changes only the directions.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) writeonly buffer SamplePoints { vec4 sample_points[]; };

void main() {
    uint slot = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (slot >= counts[COUNT_ACTIVE]) return;
    sample_points[slot] = vec4(position(vec3(voxel_at(active_voxels[slot]))), 1.0);
}
