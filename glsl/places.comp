// Cells of a list of paths by place.glsl, for tests with unusual paths. One invocation owns one path. With FINE paths
// are grains, in a confocal scan half of a path's length.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 12) const uint SPLIT = 1u;
layout(std430, set = 0, binding = 1) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Target { uint target[]; };

#include "place.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.last) return;
    read_scene();
    target[i] = place_of(source[i], 0.0).cell - ORIGIN;
}
