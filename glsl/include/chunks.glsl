// How many voxels a workgroup of the forward pass takes: CHUNK, or the half, a quarter and so on where workgroups are
// too few to fill the device. The number depends on counts alone. Needs LANES, CHUNK and the buffer counts.

layout(constant_id = 33) const uint FORWARD_FILL = 0u; // lanes that fill the device
layout(constant_id = 34) const uint SET_CELLS = 0u;    // chunks of a dispatch times pairs, at most

const uint LEAST_CHUNK = 64u; // a smaller one is not worth what its workgroup begins and ends with

uint parts(uint n, uint size) { return n / size + (n % size == 0u ? 0u : 1u); }

// As Plan::set_chunks.
uint chunks_of_set() { return max(SET_CELLS / max(scene.pairs, 1u), 1u); }

// `tiles`: workgroups for one chunk.
uint chunk_of(uint voxels, uint tiles) {
    uint chunk = CHUNK;
    uint wanted = parts(FORWARD_FILL, max(tiles, 1u) * LANES);
    // More chunks than planned must fit into the first dispatch, and along its y.
    uint most = min(chunks_of_set(), 65535u);
    while (chunk >= 2u * LEAST_CHUNK && parts(voxels, chunk) < wanted && parts(voxels, chunk / 2u) <= most) chunk /= 2u;
    return chunk;
}
