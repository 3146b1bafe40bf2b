// Gradient of a pixel's depth and albedo (pull.glsl), divided by the sum of the weights with which surface_step.comp
// averages it over surrounding pixels. Omitted once averaging has ended. One invocation, or several, own one pixel
// (pixel_lanes.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, set = 0, binding = 5) readonly buffer SurfaceWeights { float surface_weights[]; };
layout(std430, set = 0, binding = 6) writeonly buffer HeightPull { vec4 height_pull[]; }; // by column; depth for bonds, 1
layout(std430, set = 0, binding = 7) readonly buffer BondDepths { float bond_depths[]; };

#include "heights.glsl"
#include "neighbours.glsl"
#include "pixel_lanes.glsl"
#include "pull.glsl"

// Those of one of the pixel's lanes.
float weights_around(uint pixel, float depth, float sigma) {
    int reach = reach_of(sigma);
    uint layer = layer_start(pixel);
    ivec2 centre = pixel_xy(pixel);
    float sum = 0.0;
    for (int x = int(gl_LocalInvocationID.y) - reach; x <= reach; x += int(PIXEL_LANES)) {
        for (int y = -reach; y <= reach; ++y) {
            uint column = column_at(layer, centre + ivec2(x, y));
            if (column == NOWHERE) continue;
            sum += bond(ivec2(x, y), 0.5 / (sigma * sigma), bond_depths[column] - depth);
        }
    }
    return sum;
}

void main() {
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    float sigma = spread_at(surface_weights[SURFACE_SPREAD], push.step, surface_weights[SURFACE_ITERATIONS]);
    if (sigma <= 0.0) return;
    bool owned = pixel < push.last;
    float depth = owned ? bond_depths[pixels[pixel]] : 0.0;
    vec4 sum = over_lanes(owned ? vec4(pulled(pixel), weights_around(pixel, depth, sigma), 0.0) : vec4(0.0));
    if (owned && gl_LocalInvocationID.y == 0u) height_pull[pixels[pixel]] = vec4(sum.xy / sum.z, depth, 1.0);
}
