// Writes the centres of the active voxels as samples of unit weight. One invocation owns one active voxel. Runs once
// per domain; after that the vector solver changes only the directions. With push.flags the domain is new: vectors and
// bounds go where settle.comp could not put them while others read the old slots, and the momentum is at rest.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) writeonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 5) writeonly buffer Bounds { vec2 bounds[]; }; // D, lambda
layout(std430, set = 0, binding = 6) readonly buffer Before { vec4 before[]; };
layout(std430, set = 0, binding = 7) readonly buffer Gradient { vec2 kept_bounds[]; };
layout(std430, set = 0, binding = 8) writeonly buffer Momentum { float momentum[]; };

void main() {
    uint slot = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (slot >= counts[COUNT_ACTIVE]) return;
    sample_points[slot] = vec4(position(vec3(voxel_at(active_voxels[slot]))), 1.0);
    if (push.flags == 0u) return;
    raw[slot] = before[slot];
    bounds[slot] = kept_bounds[slot];
    if (slot != 0u) return;
    momentum[MOMENTUM_T] = 1.0;
    momentum[MOMENTUM_BETA] = 0.0;
    momentum[MOMENTUM_OBJECTIVE] = uintBitsToFloat(0x7f800000u); // infinity: no objective is above it
}
