// Step of the coarse volume: accelerated proximal gradient (Beck, Teboulle 2009) on vectors of albedo times normal, from the
// gradients of surface_gather.comp.
//   v' = shrink(cone(y - g / D), lambda / D),   y' = v' + momentum (v' - v)
// D bounds the curvature of the objective at a voxel: the weighted rendering of all voxels at unit albedo, gathered (De
// Pierro 1995). shrink is the group soft threshold on |v|, lambda the standard deviation that photon noise gives the
// gradient, some times. The cone keeps surfaces facing the wall: v_z <= 0, |v_xy| <= CONE |v_z|. Surfaces without normals are
// vectors along -z. Vector and D, then lambda, are the two rows of a voxel; y is its sample. push.unbias_first is the momentum,
// push.unbias_second the share of D. One invocation owns one voxel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
#include "largest.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 3) buffer SampleNormals { vec4 sample_normals[]; };
layout(std430, set = 0, binding = 4) readonly buffer Gradient { vec4 gradient[]; };
layout(std430, set = 0, binding = 5) buffer Voxels { vec4 voxels[]; };

#include "faults.glsl"

const float CONE = 3.0; // as in volume.rs
const vec3 FRONT = vec3(0.0, 0.0, -1.0);

// Nearest point of the cone.
vec3 into_cone(vec3 v) {
    float across = length(v.xy);
    float along = -v.z;
    if (across <= CONE * along) return v;
    float at = (along + CONE * across) / (1.0 + CONE * CONE);
    if (at <= 0.0) return vec3(0.0);
    return vec3(v.xy * (CONE * at / across), -at);
}

vec3 shrink(vec3 v, float by) {
    float size = length(v);
    return size <= by ? vec3(0.0) : v * (1.0 - by / size);
}

// Moves a voxel. Returns its albedo.
float move(uint slot) {
    vec4 own = voxels[2u * slot];
    float bound = own.w * push.unbias_second;
    vec3 y = sample_points[slot].w * (NORMALS ? sample_normals[slot].xyz : FRONT);
    vec3 g = NORMALS ? gradient[slot].xyz : gradient[slot].x * FRONT;
    vec3 next = bound > 0.0 ? shrink(into_cone(y - g / bound), voxels[2u * slot + 1u].x / bound) : vec3(0.0);
    vec3 ahead = next + push.unbias_first * (next - own.xyz);
    float size = NORMALS ? length(ahead) : max(-ahead.z, 0.0);
    watch(finite(next.x + next.y + next.z + size), FAULT_UPDATE);
    voxels[2u * slot].xyz = next;
    sample_points[slot].w = size;
    // A vector of zero length has no direction: it may grow toward the wall.
    if (NORMALS) sample_normals[slot] = vec4(size > 0.0 ? ahead / size : FRONT, 0.0);
    return size;
}

void main() {
    uint slot = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    float albedo = slot < counts[COUNT_ACTIVE] ? move(slot) : 0.0;
    // For the fixed-point scale.
    uint peak = largest_of_group(vec2(albedo, 0.0)).x;
    if (gl_LocalInvocationID.x == 0u) atomicMax(counts[COUNT_PEAK_ALBEDO], peak);
}
