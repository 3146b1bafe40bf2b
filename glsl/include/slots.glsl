// Slot of a voxel: its rank in the list of active voxels, or NOWHERE. Needs the buffers mask and ranks (number of set
// bits before each word of the mask): two bits per voxel instead of a word.
uint slot_of(uint index) {
    uint word = mask[index >> 5];
    uint bit = 1u << (index & 31u);
    if ((word & bit) == 0u) return NOWHERE;
    uint slot = ranks[index >> 5] + bitCount(word & (bit - 1u));
    return slot < scene.capacity ? slot : NOWHERE;
}
