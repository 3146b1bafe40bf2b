// End of an iteration. One workgroup sums the partial losses in a fixed order (strided per lane, then a tree), writes
// the iteration's row of the trace, read by the host later, and resets the maxima.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "sums.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer LossPartials { vec2 loss_partials[]; };
layout(std430, set = 0, binding = 3) readonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Trace { uint trace[]; };

#include "finish.glsl"

void main() {
    vec3 sum = sum_of_partials();
    if (gl_LocalInvocationID.x == 0u) write_row(sum);
}
