// Where a voxel stands in the list of active ones: its slot, NOWHERE if it is not there. Needs the buffers mask and
// ranks (set bits before each word of the mask): a bit and a sixteenth of a word per voxel instead of a word.
uint slot_of(uint index) {
    uint word = mask[index >> 5];
    uint bit = 1u << (index & 31u);
    if ((word & bit) == 0u) return NOWHERE;
    uint slot = ranks[index >> 5] + bitCount(word & (bit - 1u));
    return slot < scene.capacity ? slot : NOWHERE;
}
