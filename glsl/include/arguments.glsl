// Converts counts to indirect dispatch arguments, so that the host never reads a count back. Single invocation. Needs
// the buffers counts and arguments.
layout(constant_id = 11) const uint LANES = 64u;   // forward: lanes per workgroup
layout(constant_id = 12) const uint CHUNK = 256u;  // forward: voxels per workgroup
layout(constant_id = 14) const uint FORWARD_SETS = 1u;
layout(constant_id = 15) const uint FORWARD_OTHERS = 0u;   // forward: other points per workgroup; 0: not a product
#include "slices.glsl"
#include "chunks.glsl"

void write(uint triple, uint x, uint y) {
    arguments[3u * triple] = x;
    arguments[3u * triple + 1u] = y;
    arguments[3u * triple + 2u] = 1u;
}

// n workgroups, continued along y after GROUPS_X.
void write_groups(uint triple, uint n) {
    write(triple, min(n, GROUPS_X), n == 0u ? 0u : (n + GROUPS_X - 1u) / GROUPS_X);
}

void write_arguments() {
    uint voxels = counts[COUNT_ACTIVE];
    write_groups(ARGUMENTS_SAMPLE, parts(voxels, WORKGROUP));
    write_groups(ARGUMENTS_BACKWARD, parts(voxels, samples_of_group(slices_of(voxels))));
    write_groups(ARGUMENTS_UPDATE, parts(counts[COUNT_TOUCHED], WORKGROUP));
    uint tiles = FORWARD_OTHERS == 0u ? parts(scene.pairs, LANES)
                              : parts(scene.scanned, LANES) * parts(scene.others, FORWARD_OTHERS);
    uint chunks = parts(voxels, chunk_of(voxels, tiles));
    uint of_set = chunks_of_set();
    for (uint i = 0u; i < FORWARD_SETS; ++i) {
        uint before = i * of_set;
        uint here = before < chunks ? min(chunks - before, of_set) : 0u;
        write(ARGUMENTS_FORWARD + i, here == 0u ? 0u : tiles, here);
    }
}
