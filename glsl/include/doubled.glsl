// Interpolates a voxel's value from the grid before, whose voxels are twice as large along some axes: linear along
// these, cell-centred (weights 1/4 and 3/4, clamped at the grid's edges). A surface's light is the sum over the voxels
// behind each other, so values halve where these double. Needs coarse_at(uvec3 c), zero where the grid before has no
// state.
vec4 doubled(uvec3 c) {
    uvec3 from = uvec3(scene.from_wide, scene.from_wide, scene.from_deep);
    uvec3 last = (grid_size() + from - 1u) / from - 1u;
    uvec3 parent = parent_of(c);
    // The other parent lies on this child's side of its own parent.
    uvec3 other = uvec3(clamp(ivec3(parent) + ivec3(c & 1u) * 2 - 1, ivec3(0), ivec3(last)));
    vec3 share = 0.25 * vec3(from - 1u);
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < 8u; ++i) {
        uvec3 take = uvec3(i, i >> 1, i >> 2) & 1u;
        vec3 weights = mix(1.0 - share, share, vec3(take));
        float weight = weights.x * weights.y * weights.z;
        if (weight > 0.0) sum += weight * coarse_at(parent + take * (other - parent));
    }
    return sum / float(scene.from_deep);
}
