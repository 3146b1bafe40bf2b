// Runs both loops of loops.c on the CPU, for tests/kernels/isa.rs. Standard input and output are binary.
//   in:  Scene; unsigned pairs, voxels; sample points and vectors (4 floats a voxel), wall (4 floats a pair),
//        residual (pairs * stride + PADDING floats)
//   out: histograms (as many floats as the residual), gradients (4 floats a voxel)
#include <stdio.h>
#include <stdlib.h>

#include "loops.c"

static void *take(size_t count, size_t size) {
    void *at = aligned_alloc(16, (count * size + 15) / 16 * 16);
    if (!at || fread(at, size, count, stdin) != count) exit(1);
    return at;
}

int main(void) {
    Scene *scene = take(1, sizeof(Scene));
    unsigned *counts = take(2, sizeof(unsigned));
    unsigned pairs = counts[0], voxels = counts[1];
    float4 *points = take(voxels, 16), *vectors = take(voxels, 16), *wall = take(pairs, 16);
    size_t cells = (size_t)pairs * scene->stride + PADDING;
    float *residual = take(cells, 4);
    float *histograms = calloc(cells, 4);
    float4 *gradient = aligned_alloc(16, (size_t)voxels * 16);
    if (!histograms || !gradient) return 1;
    for (unsigned pair = 0; pair < pairs; ++pair) {
        forward(*scene, points, vectors, wall, histograms, pair, 0, voxels);
    }
    for (unsigned slot = 0; slot < voxels; ++slot) {
        gather(*scene, points, vectors, wall, residual, gradient, slot, 0, pairs);
    }
    size_t written = fwrite(histograms, 4, cells, stdout) + fwrite(gradient, 16, voxels, stdout);
    return written == cells + voxels ? 0 : 1;
}
