// Interpolates a voxel's value from the domain of half the lateral resolution: bilinear in x and y, cell-centred
// (weights 1/4 and 3/4, clamped at the grid's edges), z unchanged. Needs coarse_at(uvec2 c, uint z), zero where the
// coarse domain has no state.
vec4 doubled(uvec3 c) {
    ivec2 last = ivec2(scene.grid_x, scene.grid_y) / 2 - 1;
    uvec2 parent = c.xy / 2u;
    // The other parent lies on this child's side of its own parent.
    uvec2 other = uvec2(clamp(ivec2(parent) + ivec2(c.xy & 1u) * 2 - 1, ivec2(0), last));
    return 0.5625 * coarse_at(parent, c.z)
         + 0.1875 * coarse_at(uvec2(other.x, parent.y), c.z)
         + 0.1875 * coarse_at(uvec2(parent.x, other.y), c.z)
         + 0.0625 * coarse_at(other, c.z);
}
