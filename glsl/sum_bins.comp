// Sums neighbouring bins of the measurement for levels whose voxels are too deep for its own bins. One invocation owns
// one wide bin and sums from the first narrow one on, so the sum is the same on every run.
// push.first: narrow bins of a wide one; push.last: bins of a narrow histogram; push.step: pairs. Narrow bins that fill no
// wide one are left out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Target { float target[]; };

void main() {
    uint index = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    uint wide = max(push.last / push.first, 1u);
    uint pair = index / wide;
    if (pair >= push.step) return;
    uint first = pair * push.last + index % wide * push.first;
    float sum = 0.0;
    for (uint i = first; i < first + push.first; ++i) sum += source[i];
    target[index] = sum;
}
