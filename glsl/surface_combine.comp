// Combines the gradients of a pixel's points into those of its depth, albedo and slopes, and adds the prior. The
// prior couples neighbours where photons are few: over pairs of neighbours,
//   bond * (e^2 / (2 bend^2) + (a_i - a_j)^2 / (2 jump^2)),   e = (z_j - z_i - (s_i + s_j) / 2 . d) / pixel
// with d from i to j; e is the deviation of j from the planes of both pixels. And for every lit pixel,
//   sparse * faint * log(1 + a / faint)
// which costs a bright pixel little more than a dim one and concentrates light in few pixels. surface_pull.comp
// propagates the gradient of the slopes to the depths. One invocation, or several, own one pixel (pixel_lanes.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
#include "sums.glsl"
#include "largest.glsl"
layout(constant_id = 10) const uint POINTS = 4u; // of a pixel: 4 or 1
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, set = 0, binding = 3) readonly buffer Heights { vec2 heights[]; };
layout(std430, set = 0, binding = 4) readonly buffer Slopes { vec2 slopes[]; };
layout(std430, set = 0, binding = 5) readonly buffer Gradient { vec4 gradient[]; };
layout(std430, set = 0, binding = 6) writeonly buffer HeightGradient { vec4 height_gradient[]; }; // slopes, depth, albedo
layout(std430, set = 0, binding = 7) buffer SurfaceWeights { uint surface_weights[]; }; // bits of floats
layout(std430, set = 0, binding = 8) writeonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 9) readonly buffer BondDepths { float bond_depths[]; };

#include "heights.glsl"
#include "neighbours.glsl"
#include "pixel_lanes.glsl"

void main() {
    // Groups that only fill the last row of a dispatch (GROUPS_X) have no partial sum. All lanes return together.
    if (group_index() * WORKGROUP >= push.last) return;
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    bool is_first = gl_LocalInvocationID.y == 0u;
    float energy = 0.0;
    vec2 tilts = vec2(0.0);
    float deeper = 0.0;
    float brighter = 0.0;
    if (pixel < push.last) {
        vec2 height = heights[pixel];
        vec2 slope = slopes[pixel];
        vec4 points = vec4(0.0);
        for (uint k = 0u; k < (is_first ? POINTS : 0u); ++k) {
            vec4 g = gradient[POINTS * pixel + k];
            float along = NORMALS ? g.w : g.y;
            points += g;
            deeper += along;
            tilts += along * part(k, POINTS);
        }
        float share = 1.0 / float(POINTS);
        brighter = share * points.x;
        if (NORMALS) {
            // Per lateral area of a pixel, albedo times normal is albedo times (slope, -1).
            brighter = share * dot(vec3(slope, -1.0), points.xyz);
            tilts += share * height.y * points.xy;
        }
        float bend = uintBitsToFloat(surface_weights[SURFACE_BEND]);
        float jump = uintBitsToFloat(surface_weights[SURFACE_JUMP]);
        float size = pixel_size();
        for (uint k = gl_LocalInvocationID.y; k < 8u; k += PIXEL_LANES) {
            uint column = column_beside(pixel, k);
            uint other = pixel_at(column);
            if (other == NOWHERE) continue;
            float weight = bond(k, bond_depths[column] - bond_depths[pixels[pixel]]);
            vec2 d = vec2(AROUND[k]) * pixel_pitch();
            float off = (heights[other].x - height.x - 0.5 * dot(slope + slopes[other], d)) / size;
            float differs = height.y - heights[other].y;
            deeper -= bend * weight * off / size;
            tilts -= 0.5 * bend * weight * off / size * d;
            brighter += jump * weight * differs;
            // Half of the pair's energy; the neighbour adds the other half.
            energy += 0.25 * weight * (bend * off * off + jump * differs * differs);
        }
        float sparse = uintBitsToFloat(surface_weights[SURFACE_SPARSE]);
        if (is_first && sparse > 0.0) {
            float faint = uintBitsToFloat(surface_weights[SURFACE_FAINT]);
            float lit = 1.0 + height.y / faint;
            brighter += sparse / lit;
            energy += sparse * faint * log(lit);
        }
    }
    vec4 own = over_lanes(vec4(tilts, deeper, brighter));
    if (PIXEL_LANES > 1u) barrier();
    energy = over_lanes(vec4(energy)).x;
    if (is_first && pixel < push.last) height_gradient[pixel] = own;
    float all = sum_over_group(vec3(energy)).x;
    // Magnitudes of the gradient by depth and by albedo.
    uvec2 most = largest_of_group(is_first && pixel < push.last ? abs(own.zw) : vec2(0.0));
    if (gl_LocalInvocationIndex != 0u) return;
    l1_partials[group_index()] = all;
    atomicMax(surface_weights[SURFACE_LARGEST], most.x);
    atomicMax(surface_weights[SURFACE_LARGEST + 1u], most.y);
}
