// Voxels per workgroup of the forward pass: CHUNK, or a power-of-two fraction of it if there are too few workgroups
// to fill the device. Depends on counts only. Needs LANES, CHUNK and the buffer counts.

layout(constant_id = 33) const uint FORWARD_FILL = 0u; // lanes that fill the device
layout(constant_id = 34) const uint SET_CELLS = 0u;    // maximum of chunks times pairs of a dispatch

const uint LEAST_CHUNK = 64u; // smaller chunks are dominated by a workgroup's overhead

uint parts(uint n, uint size) { return n / size + (n % size == 0u ? 0u : 1u); }

// As Plan::set_chunks.
uint chunks_of_set() { return max(SET_CELLS / max(scene.pairs, 1u), 1u); }

// `tiles`: workgroups per chunk.
uint chunk_of(uint voxels, uint tiles) {
    uint chunk = CHUNK;
    uint wanted = parts(FORWARD_FILL, max(tiles, 1u) * LANES);
    // Chunks beyond the plan must fit into the first dispatch, and along its y.
    uint most = min(chunks_of_set(), 65535u);
    while (chunk >= 2u * LEAST_CHUNK && parts(voxels, chunk) < wanted && parts(voxels, chunk / 2u) <= most) chunk /= 2u;
    return chunk;
}
