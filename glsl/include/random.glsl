// Random numbers by hashing a counter, independent of the order of voxels. PCG3D, Jarzynski & Olano 2020, "Hash
// functions for GPU rendering".

#include "paper_block.glsl"

uvec3 pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> 16;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// Three numbers in [0, 1), exact in fp32.
vec3 random3(uint index, uint iteration, uint stream) {
    return vec3(pcg3d(uvec3(index, iteration, paper.seed ^ (stream * 0x9e3779b9u))) >> 8) * (1.0 / 16777216.0);
}
