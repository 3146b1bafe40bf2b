// Sums counts over pairs, bin by bin: what the host must know of counts that it does not have. One invocation owns one bin
// of one slice of pairs and walks its pairs in order, so the sums are the same on every run; neighbours read neighbouring
// bins. The host adds the slices up.
// push.first, push.last: pairs; push.step: pairs of a slice; push.iteration: the first slice's place in `tally`;
// push.flags: the rows (lent.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "lent.glsl"
layout(local_size_x = 64) in;
// Sum, sum of squares, largest, smallest.
layout(std430, set = 0, binding = 2) writeonly buffer Tally { vec4 tally[]; };

void main() {
    Row rows = row_of(push.flags);
    uint bins = (rows.counts + rows.sum - 1u) / rows.sum;
    uint bin = gl_WorkGroupID.x * WORKGROUP + gl_LocalInvocationID.x;
    if (bin >= bins) return;
    uint slice = gl_WorkGroupID.y;
    uint from = push.first + slice * push.step;
    uint to = min(from + push.step, push.last);
    float value = bin_of(from, bin, rows);
    vec4 all = vec4(value, value * value, value, value);
    for (uint pair = from + 1u; pair < to; ++pair) {
        value = bin_of(pair, bin, rows);
        all.xy += vec2(value, value * value);
        all.z = max(all.z, value);
        all.w = min(all.w, value);
    }
    tally[(push.iteration + slice) * bins + bin] = all;
}
