// What the backward kernels share: the sum over pairs of the residual at a sample's bins. Needs SPLIT, EXACT,
// LAMBERTIAN and the buffers wall and residual.

float residual_at(uint row, int bin) {
    return bin >= 0 && bin < int(scene.bins) ? residual[row + uint(bin)] : 0.0;
}

// The residual of histogram `row` that a path at `bin` sees: of its bin, or of the two around it.
float residual_around(uint row, float bin) {
    if (SPLIT == 0u) return residual_at(row, int(floor(bin)));
    float centre = bin - 0.5;
    float low = floor(centre);
    return mix(residual_at(row, int(low)), residual_at(row, int(low) + 1), centre - low);
}

// (sum r cos, sum r toward) over the pairs that a sample at x with direction n shines on.
vec4 gather(vec3 x, vec3 n, uint begin, uint end, uint stride) {
    vec4 sum = vec4(0.0);
    for (uint pair = begin; pair < end; pair += stride) {
        Kernel k = confocal_kernel(wall[pair].xyz, x, n);
        float r = residual_around(pair * scene.bins, k.bin);
        if (EXACT != 0u) r *= k.falloff;
        if (LAMBERTIAN != 0u) r *= lambertian_rest(k, n);
        if (k.cosine > 0.0) sum += r * vec4(k.cosine, k.toward);
    }
    return sum;
}
