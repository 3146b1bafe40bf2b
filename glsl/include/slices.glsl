// Lanes per gathered sample. With too few samples to fill a device, several lanes share one: each of n lanes
// processes every nth pair, and their sums are added in a fixed order. A workgroup has VOXELS * SLICES lanes. A
// sample has SLICES of them, or a power-of-two fraction, as long as the device has FILL lanes. Lanes of one slice are
// neighbours and own neighbouring samples. With up to VOXELS * SLICES / 32 slices all lanes of a warp of 32 have one
// slice: they read one wall point, and neighbouring bins. The number depends on the sample count only, so the bits
// are reproducible.

layout(constant_id = 30) const uint VOXELS = 64u;
layout(constant_id = 31) const uint SLICES = 1u;
layout(constant_id = 32) const uint FILL = 0xffffffffu;

uint slices_of(uint samples) {
    uint slices = SLICES;
    while (slices % 2u == 0u && samples >= FILL / (slices / 2u)) slices /= 2u;
    return slices;
}

// Samples per workgroup.
uint samples_of_group(uint slices) { return VOXELS * SLICES / slices; }
