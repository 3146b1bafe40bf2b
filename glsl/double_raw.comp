// Doubles the lateral resolution of the raw variables (trilinear, cell-centred: weights 1/4 and 3/4, clamped
// at the edges; z unchanged) and puts the optimiser at rest. One invocation owns one new voxel. The scene is
// the new one; the old volume, half as wide, lies in `coarse` in its own brick order.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Coarse { vec4 coarse[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Raw { vec4 raw[]; };

void main() {
    uint index = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (index >= brick_count() * 512u) return;
    uvec3 c = voxel_at(index);
    vec4 value = vec4(0.0);
    if (in_grid(c)) {
        uvec2 last = uvec2(scene.grid_x, scene.grid_y) / 2u - 1u;
        uvec2 parent = c.xy / 2u;
        // The other parent lies on the side that this child leans to.
        ivec2 other = clamp(ivec2(parent) + ivec2(c.xy & 1u) * 2 - 1, ivec2(0), ivec2(last));
        value = 0.5625 * coarse[coarse_index(uvec3(parent, c.z))]
              + 0.1875 * coarse[coarse_index(uvec3(other.x, parent.y, c.z))]
              + 0.1875 * coarse[coarse_index(uvec3(parent.x, other.y, c.z))]
              + 0.0625 * coarse[coarse_index(uvec3(other, c.z))];
    }
    raw[index] = value;
}
