// Index of a touched voxel's state, or NOWHERE. Active voxels come first, by slot, followed by the rim (their
// inactive neighbours). Needs CONTINUOUS (if 0, only active voxels are touched), slots.glsl and, for the rim, the
// buffers rim_mask and rim_ranks (slot offset of each word of the mask).
uint state_of(uint index) {
    uint slot = slot_of(index);
    if (slot != NOWHERE || CONTINUOUS == 0u) return slot;
    uint word = rim_mask[index >> 5];
    uint bit = 1u << (index & 31u);
    if ((word & bit) == 0u) return NOWHERE;
    slot = rim_ranks[index >> 5] + bitCount(word & (bit - 1u));
    return slot < scene.touched_capacity ? slot : NOWHERE;
}
