// Sums counts over pairs, bin by bin: what the host must know of counts that it does not have. One invocation owns one bin
// of one slice of pairs and walks its pairs in order, so the sums are the same on every run; neighbours read neighbouring
// bins. The host adds the slices up.
// push.first, push.last: pairs; push.step: pairs of a slice; push.iteration: the first slice's place in `tally`;
// push.flags: bins of a row, times 4, plus the format.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "lent.glsl"
layout(local_size_x = 64) in;
// Sum, sum of squares, largest, smallest.
layout(std430, set = 0, binding = 2) writeonly buffer Tally { vec4 tally[]; };

void main() {
    uint bins = push.flags >> 2;
    uint bin = gl_WorkGroupID.x * WORKGROUP + gl_LocalInvocationID.x;
    if (bin >= bins) return;
    uint slice = gl_WorkGroupID.y;
    uint from = push.first + slice * push.step;
    uint to = min(from + push.step, push.last);
    float value = count_of(from * bins + bin, push.flags & 3u);
    vec4 all = vec4(value, value * value, value, value);
    for (uint pair = from + 1u; pair < to; ++pair) {
        value = count_of(pair * bins + bin, push.flags & 3u);
        all.xy += vec2(value, value * value);
        all.z = max(all.z, value);
        all.w = min(all.w, value);
    }
    tally[(push.iteration + slice) * bins + bin] = all;
}
