// Lateral maps from the volume: one invocation owns one column (x, y) and walks z for the brightest active voxel.
// Writes (albedo, depth, 0, 1 if the column has an active voxel) and (normal, 0). With VECTORS, albedo and depth also
// use the voxels around the brightest, because a slanted surface fills several voxels of its column, each with less.
// With BEHIND, the same of a second surface in the column: the brightest voxel that is farther from the first one than
// a surface reaches, with a valley in between.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "surface.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint VECTORS = 0u; // 0 raw variables, 1 vectors albedo * normal
layout(constant_id = 11) const uint BEHIND = 0u;  // 0 the brightest surface of a column, 1 the second one
layout(std430, set = 0, binding = 1) readonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 2) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 4) readonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Columns { vec4 columns[]; };

// Voxels above this share of the brightest belong to the surface; the farthest of them gives the depth.
const float FAR_SHARE = 0.5;

// Between two surfaces, a voxel is below this share of the second one.
const float VALLEY = 0.5;

#include "slots.glsl"

// Albedo of an active voxel, 0 elsewhere and below zero.
float albedo_at(uvec3 c) {
    uint slot = slot_of(voxel_index(c));
    if (slot == NOWHERE) return 0.0;
    return VECTORS != 0u ? length(raw[slot].xyz) : max(raw[slot].x, 0.0);
}

// Voxels along z to each side that a surface may fill.
int reach_of_surface() { return int(ceil(2.0 * max(scene.pitch_x, scene.pitch_y) / scene.pitch_z)); }

// The brightest voxel of a second surface in the column: its albedo, and its depth if it is above zero. `first` is the
// brightest voxel, with the albedo `top`.
float second(uvec2 at, float top, uint first, inout uint depth) {
    float best = 0.0;
    for (int way = 1; way >= -1; way -= 2) {
        float least = top;
        for (int z = int(first) + way; z >= int(scene.near_z) && z < int(scene.grid_z); z += way) {
            float a = albedo_at(uvec3(at, uint(z)));
            if (abs(z - int(first)) > reach_of_surface() && a > best && least < VALLEY * a) {
                best = a;
                depth = uint(z);
            }
            least = min(least, a);
        }
    }
    return best;
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
    uint first = depth;
    if (BEHIND != 0u) best = second(c.xy, best, first, depth);
    if (best == 0.0) {
        columns[2u * column] = vec4(0.0);
        columns[2u * column + 1u] = vec4(0.0);
        return;
    }
    c.z = depth;
    vec4 found = raw[slot_of(voxel_index(c))];
    vec3 u = VECTORS != 0u ? found.xyz : toward_wall(found.yzw);
    if (VECTORS != 0u) {
        // Albedo is the 3/2 norm: the sum overrates thick blurs, the maximum underrates slanted surfaces. Depth is the
        // farthest voxel not much darker than the brightest: the cosine model lights slanted surfaces too well, which
        // draws the brightest voxel toward the wall.
        float around = 0.0;
        int reach = reach_of_surface();
        int begin = max(int(depth) - reach, int(scene.near_z));
        int last = min(int(depth) + reach, int(scene.grid_z) - 1);
        // Voxels of the first surface are not those of the second.
        if (depth > first) begin = max(begin, int(first) + reach + 1);
        if (depth < first) last = min(last, int(first) - reach - 1);
        for (int z = begin; z <= last; ++z) {
            float a = albedo_at(uvec3(c.xy, uint(z)));
            if (a == 0.0) continue;
            around += a * sqrt(a);
            if (a > FAR_SHARE * best) c.z = uint(z);
        }
        best = pow(around, 2.0 / 3.0);
    }
    columns[2u * column] = vec4(best, position(vec3(c)).z, 0.0, 1.0);
    columns[2u * column + 1u] = vec4(u / safe_length(u), 0.0);
}
