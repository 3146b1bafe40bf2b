// Sample position of a voxel in this iteration, in voxels: the centre, or uniform within half a voxel of it, clamped
// to the grid (paper, section 3.2). Needs CONTINUOUS.

vec3 sample_point(uvec3 c, uint index) {
    vec3 g = vec3(c);
    if (CONTINUOUS == 0u) return g;
    g += random3(index, push.iteration, 1u) - 0.5;
    return clamp(g, vec3(0.0), vec3(grid_size() - 1u));
}
