// Voxels, bricks and positions. Storage is by brick (8 x 8 x 8, x fastest among bricks), in Morton order inside a
// brick, so that a list in storage order keeps neighbours together.

const uint NOWHERE = 0xffffffffu;

uint spread3(uint v) { return (v & 1u) | ((v & 2u) << 2) | ((v & 4u) << 4); }
uint gather3(uint v) { return (v & 1u) | ((v >> 2) & 2u) | ((v >> 4) & 4u); }

uvec3 grid_size() { return uvec3(scene.grid_x, scene.grid_y, scene.grid_z); }
// Number of cells of all histograms, including padding (place.glsl).
uint cell_count() { return scene.pairs * scene.stride + PADDING; }
uint brick_count() { return scene.bricks_x * scene.bricks_y * scene.bricks_z; }

// Storage index of voxel c in a grid with the given numbers of bricks along x and y.
uint brick_order(uvec3 c, uint bricks_x, uint bricks_y) {
    uvec3 b = c >> 3;
    uint brick = (b.z * bricks_y + b.y) * bricks_x + b.x;
    return brick * 512u + (spread3(c.x & 7u) | (spread3(c.y & 7u) << 1) | (spread3(c.z & 7u) << 2));
}

uint voxel_index(uvec3 c) { return brick_order(c, scene.bricks_x, scene.bricks_y); }

// The voxel containing c in the previous grid, which has half the lateral resolution.
uvec3 parent_of(uvec3 c) { return c >> uvec3(1u, 1u, 0u); }

// Storage index of voxel c in the previous grid.
uint coarse_index(uvec3 c) {
    uvec2 size = uvec2(scene.grid_x, scene.grid_y) / 2u;
    return brick_order(c, (size.x + 7u) / 8u, (size.y + 7u) / 8u);
}

// Voxel of a storage index. Outside the grid where the last bricks extend beyond it.
uvec3 voxel_at(uint index) {
    uint brick = index >> 9;
    uvec3 b = uvec3(brick % scene.bricks_x, (brick / scene.bricks_x) % scene.bricks_y, brick / (scene.bricks_x * scene.bricks_y));
    return b * 8u + uvec3(gather3(index), gather3(index >> 1), gather3(index >> 2));
}

bool in_grid(uvec3 c) { return all(lessThan(c, grid_size())); }

// Position in metres from a position in voxels (0 = centre of the first voxel).
vec3 position(vec3 g) {
    return vec3(scene.origin_x, scene.origin_y, scene.origin_z) + g * vec3(scene.pitch_x, scene.pitch_y, scene.pitch_z);
}

// Workgroup number. Dispatches continue along y after GROUPS_X groups along x.
uint group_index() { return gl_WorkGroupID.y * GROUPS_X + gl_WorkGroupID.x; }
