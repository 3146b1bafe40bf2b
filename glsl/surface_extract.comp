// Writes a layer of the surface over the maps that it started from: depth and normal of each pixel from push.first to
// push.last. Its albedo becomes the geometric mean of the map's albedo and the surface's. The latter is per lateral area
// and smoothed, because errors of neighbouring albedos compensate each other. Volume and surface err in different ways.
// One invocation owns one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uvec4 pixels[]; };
layout(std430, set = 0, binding = 2) readonly buffer PixelOf { uint pixel_of[]; };
layout(std430, set = 0, binding = 3) readonly buffer Heights { vec2 heights[]; };
layout(std430, set = 0, binding = 4) readonly buffer Slopes { vec2 slopes[]; };
layout(std430, set = 0, binding = 5) buffer Columns { vec4 columns[]; };
layout(std430, set = 0, binding = 6) readonly buffer SurfaceWeights { uint surface_weights[]; }; // bits of floats

#include "heights.glsl"

float seen(uint pixel) { return heights[pixel].y * stretch(slopes[pixel]) * -facing(slopes[pixel]).z; }

void main() {
    uint pixel = push.first + group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pixel >= push.last) return;
    float sigma = uintBitsToFloat(surface_weights[SURFACE_SMOOTH]);
    int reach = int(ceil(2.0 * sigma));
    uint layer = layer_start(pixel);
    ivec2 centre = pixel_xy(pixel);
    float around = 0.0;
    float whole = 0.0;
    for (int x = -reach; x <= reach; ++x) {
        for (int y = -reach; y <= reach; ++y) {
            float weight = exp(-0.5 * float(x * x + y * y) / (sigma * sigma));
            uint other = pixel_at(layer, centre + ivec2(x, y));
            whole += weight;
            if (other != NOWHERE) around += weight * seen(other);
        }
    }
    uint column = pixel_column(pixel);
    columns[2u * column] = vec4(sqrt(uintBitsToFloat(pixels[pixel].y) * around / whole), heights[pixel].x, 0.0, 1.0);
    columns[2u * column + 1u] = vec4(facing(slopes[pixel]), 0.0);
}
