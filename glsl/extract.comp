// Lateral maps of the volume: one invocation owns one column (x, y) and searches z for the brightest active voxel.
// Writes (albedo, depth, 0, 1 if the column has an active voxel) and (normal, 0).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "surface.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 2) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 4) readonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Columns { vec4 columns[]; };

#include "slots.glsl"

// Albedo of an active voxel, 0 elsewhere and below zero.
float albedo_at(uvec3 c) {
    uint slot = slot_of(voxel_index(c));
    return slot == NOWHERE ? 0.0 : max(raw[slot].x, 0.0);
}

void main() {
    uint column = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (column >= scene.grid_x * scene.grid_y) return;
    uvec3 c = uvec3(column / scene.grid_y, column % scene.grid_y, 0u);
    float best = 0.0;
    uint depth = 0u;
    for (uint z = scene.near_z; z < scene.grid_z; ++z) {
        float a = albedo_at(uvec3(c.xy, z));
        if (a > best) {
            best = a;
            depth = z;
        }
    }
    if (best == 0.0) {
        columns[2u * column] = vec4(0.0);
        columns[2u * column + 1u] = vec4(0.0);
        return;
    }
    c.z = depth;
    vec3 u = toward_wall(raw[slot_of(voxel_index(c))].yzw);
    columns[2u * column] = vec4(best, position(vec3(c)).z, 0.0, 1.0);
    columns[2u * column + 1u] = vec4(u / safe_length(u), 0.0);
}
