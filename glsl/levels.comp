// Histogram of the smoothed albedo of all eligible voxels, in `levels`: steps of 1/32 octave below the maximum (the
// upper bits of positive floats are ordered like the floats). Values below all steps count in the lowest. A workgroup
// first counts LEVELS voxels in shared memory, two per invocation: at most 128 invocations are guaranteed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 128) in;
layout(std430, set = 0, binding = 1) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 2) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 3) buffer Levels { uint levels[]; };
layout(std430, set = 0, binding = 4) readonly buffer Reachable { uint reachable[]; }; // by brick

shared uint here[LEVELS];

const uint LANES = LEVELS / 2u;

void count(uint index) {
    if (index >= brick_count() * 512u || reachable[index >> 9] == 0u) return;
    uvec3 c = voxel_at(index);
    float value = source[index];
    if (in_grid(c) && c.z >= scene.near_z && value > 0.0) {
        uint below = (counts[COUNT_PEAK_SMOOTH] >> LEVEL_SHIFT) - (floatBitsToUint(value) >> LEVEL_SHIFT);
        atomicAdd(here[LEVELS - 1u - min(below, LEVELS - 1u)], 1u);
    }
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint first = group_index() * LEVELS;
    for (uint i = lane; i < LEVELS; i += LANES) here[i] = 0u;
    barrier();
    for (uint i = lane; i < LEVELS; i += LANES) count(first + i);
    barrier();
    for (uint i = lane; i < LEVELS; i += LANES) {
        if (here[i] != 0u) atomicAdd(levels[i], here[i]);
    }
}
