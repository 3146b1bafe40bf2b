// Histogram of the smoothed albedo of all voxels that may be active, in `levels`: steps of a thirty-second of an octave
// below the maximum (the upper bits of a positive float have the order of the floats). Values below all steps count in
// the lowest. One invocation owns one voxel; a workgroup counts in shared memory first.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 256) in;
layout(std430, set = 0, binding = 1) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 2) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 3) buffer Levels { uint levels[]; };
layout(std430, set = 0, binding = 4) readonly buffer Reachable { uint reachable[]; }; // by brick

shared uint here[LEVELS];

void main() {
    uint lane = gl_LocalInvocationID.x;
    here[lane] = 0u;
    barrier();
    uint index = group_index() * 256u + lane;
    if (index < brick_count() * 512u && reachable[index >> 9] != 0u) {
        uvec3 c = voxel_at(index);
        float value = source[index];
        if (in_grid(c) && c.z >= scene.near_z && value > 0.0) {
            uint below = (counts[COUNT_PEAK_SMOOTH] >> LEVEL_SHIFT) - (floatBitsToUint(value) >> LEVEL_SHIFT);
            atomicAdd(here[LEVELS - 1u - min(below, LEVELS - 1u)], 1u);
        }
    }
    barrier();
    if (here[lane] != 0u) atomicAdd(levels[lane], here[lane]);
}
