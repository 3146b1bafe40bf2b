// One invocation owns one voxel of the storage, overhang included: albedo uniform in [0, 1), normals zero,
// optimiser at rest. Random by voxel, not by thread, so any device starts from the same volume.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "random.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const float ALBEDO_SPAN = 1.0;
layout(std430, set = 0, binding = 1) writeonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 2) writeonly buffer MomentFirst { vec4 moment_first[]; };
layout(std430, set = 0, binding = 3) writeonly buffer MomentSecond { vec4 moment_second[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 5) readonly buffer Reachable { uint reachable[]; }; // by brick

void main() {
    uint index = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (index >= brick_count() * 512u) return;
    raw[index] = vec4(ALBEDO_SPAN * random3(index, 0u, 0u).x, 0.0, 0.0, 0.0);
    moment_first[index] = vec4(0.0);
    moment_second[index] = vec4(0.0);
    // The first invocation of every 32 writes their word of the domain: all voxels not nearer than allowed and within
    // reach of a bin.
    if ((index & 31u) == 0u) {
        uint word = 0u;
        for (uint i = 0u; reachable[index >> 9] != 0u && i < 32u; ++i) {
            uvec3 c = voxel_at(index + i);
            if (in_grid(c) && c.z >= scene.near_z) word |= 1u << i;
        }
        mask[index >> 5] = word;
    }
}
