// Does with the state of a pixel what surface_judge.comp decided: scales its albedo, keeps the state, or puts the kept one
// back. One invocation owns one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Heights { vec2 heights[]; }; // depth, albedo
layout(std430, set = 0, binding = 2) buffer HeightsKept { vec2 heights_kept[]; };
layout(std430, set = 0, binding = 3) writeonly buffer HeightMoments { vec4 height_moments[]; };
layout(std430, set = 0, binding = 4) readonly buffer SurfaceWeights { float surface_weights[]; };

void main() {
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pixel >= push.last) return;
    if ((push.flags & KEEP_TWICE) != 0u) {
        heights[pixel].y *= 2.0;
        return;
    }
    uint action = uint(surface_weights[SURFACE_ACTION]);
    if (action == ACTION_SCALE) heights[pixel].y *= surface_weights[SURFACE_TIMES];
    if (action == ACTION_SCALE || action == ACTION_KEEP) heights_kept[pixel] = heights[pixel];
    if (action == ACTION_RESTORE) {
        heights[pixel] = heights_kept[pixel];
        height_moments[pixel] = vec4(0.0);
    }
}
