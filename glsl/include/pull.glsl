// Gradient of a pixel's depth and albedo: its own (surface_combine.comp), plus the gradients of all slopes that
// depend on it, through the same coefficients. Needs heights.glsl and the buffers stencils and height_gradient.
vec2 pulled(uint pixel) {
    vec4 own = height_gradient[pixel];
    vec2 g = own.zw;
    for (uint k = 0u; k < 8u; ++k) {
        uint other = neighbour(pixel, k);
        if (other == NOWHERE) continue;
        g.x += dot(stencils[8u * other + 7u - k], height_gradient[other].xy) - dot(stencils[8u * pixel + k], own.xy);
    }
    return g;
}
