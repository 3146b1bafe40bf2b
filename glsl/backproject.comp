// Back-projects filtered histograms into every voxel of the grid, with the cosine toward a surface that faces the
// wall. One or several lanes own a voxel (slices.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
const uint SPLIT = 1u;
layout(std430, set = 0, binding = 3) buffer Target { float projected[]; };

#include "seats.glsl"
#include "gather.glsl"

float sum = 0.0;

// One cosine for every model with normals: further factors only blur the result.
void meet(Arm a, Arm b, vec2 r) { sum += r.x * (NORMALS ? max(-a.way.z, 0.0) * a.inverse : 1.0); }

void main() {
    uint all = brick_count() * 512u;
    Seat seat = seat_of(all);
    uint index = seat.slot;
    uvec3 c = voxel_at(index);
    if (index < all && in_grid(c) && c.z >= scene.near_z) gather(position(vec3(c)), seat.slice, seat.slices);
    sum = together(seat, vec4(sum, 0.0, 0.0, 0.0)).x;
    if (seat.slice != 0u || index >= all) return;
    if ((push.flags & BACKWARD_CONTINUE) != 0u) sum += projected[index];
    projected[index] = sum;
}
