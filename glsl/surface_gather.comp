// The gradient at a point of the surface, gathered over pairs as step.comp does: what its vector (or albedo) changes, and
// what its depth does, which moves its path along the residual's rise from bin to bin and changes what it shows.
// Writes (d/d vector, d/d depth), or (d/d albedo, d/d depth, 0, 0) of surfaces without a direction.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(local_size_x_id = 10, local_size_y_id = 11) in;
layout(constant_id = 10) const uint VOXELS = 64u;
layout(constant_id = 11) const uint SLICES = 1u;
const uint SPLIT = 1u;
const uint EXACT = 1u;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 3) readonly buffer SampleNormals { vec4 sample_normals[]; };
layout(std430, set = 0, binding = 4) readonly buffer Wall { vec4 wall[]; };
layout(std430, set = 0, binding = 5) readonly buffer Residual { float residual[]; };
layout(std430, set = 0, binding = 6) buffer Gradient { vec4 gradient[]; };

shared vec4 parts[VOXELS * SLICES];

#define OWN_MEET
#include "slope.glsl"
#include "faults.glsl"

vec3 shown;      // the vector
float amplitude; // of a surface without a direction
float deeper = 0.0;

// The value's share that a metre of depth adds to it, of what an arm of this falloff, and `power` inverses more, shows.
float nearing(Arm arm, float power) {
    return ((REFLECTANCE == RETROREFLECTIVE ? 1.0 : 2.0) + power) * arm.way.z * arm.inverse * arm.inverse;
}

// The same of what the wall shows, and of what the surface does.
float wall_turn(Arm arm) { return arm.wall > 0.0 ? arm.wall_rise / arm.wall : 0.0; }
float turn(Arm arm) { return -shown.z / dot(shown, arm.way); }

void meet(Arm a, Arm b, vec2 r) {
    float value = amplitude * a.falloff * b.falloff * shine(a, b, shown);
    slope_of(a, b, r.x);
    if (value == 0.0) return;
    float lambertian = REFLECTANCE == LAMBERTIAN ? 2.0 : 0.0;
    float grows = nearing(a, REFLECTANCE == COSINE ? 1.0 : lambertian) + nearing(b, lambertian);
    if (NORMALS) grows += turn(a);
    if (REFLECTANCE == LAMBERTIAN) grows += turn(b) + wall_turn(a) + wall_turn(b);
    float longer = -(a.way.z * a.inverse + b.way.z * b.inverse);
    deeper += value * (r.x * grows + r.y * scene.bins_per_metre * longer);
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint slice = gl_LocalInvocationID.y;
    uint slot = group_index() * VOXELS + lane;
    bool owned = slot < counts[COUNT_ACTIVE];
    vec4 point = owned ? sample_points[slot] : vec4(0.0);
    shown = NORMALS && owned ? sample_normals[slot].xyz : vec3(0.0, 0.0, -1.0);
    amplitude = point.w;
    vec4 sum = owned ? gather_slope(point.xyz, shown, slice, SLICES) : vec4(0.0);
    sum = NORMALS ? vec4(sum.yzw, deeper) : vec4(sum.x, deeper, 0.0, 0.0);
    if (SLICES > 1u) {
        parts[slice * VOXELS + lane] = sum;
        barrier();
        if (slice == 0u) {
            for (uint i = 1u; i < SLICES; ++i) sum += parts[i * VOXELS + lane];
        }
    }
    if (slice != 0u || !owned) return;
    if ((push.flags & BACKWARD_CONTINUE) != 0u) sum += gradient[slot];
    watch(finite(sum.x + sum.y + sum.z + sum.w), FAULT_BACKWARD);
    gradient[slot] = sum;
}
