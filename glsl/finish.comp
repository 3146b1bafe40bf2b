// Closes an iteration. One workgroup sums the partial losses in a fixed order (each lane strides, then a tree), writes
// the iteration's row of the trace, which the host reads later, and resets the maxima for the next iteration. With
// ACCELERATED it also decides the next extrapolation: FISTA's sequence (Beck & Teboulle 2009), restarted where the step
// goes against the momentum or the objective rose (O'Donoghue & Candes 2015). Where the objective rose by more than
// rounding, steps become shorter, down to the one that is proven safe.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "sums.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint ACCELERATED = 0u;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer LossPartials { vec2 loss_partials[]; };
layout(std430, set = 0, binding = 3) readonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Trace { uint trace[]; };
layout(std430, set = 0, binding = 5) buffer Momentum { float momentum[]; };
layout(std430, set = 0, binding = 6) readonly buffer AgainstPartials { float against_partials[]; };

#define AGAINST
#include "finish.glsl"

const float ROUNDING = 1e-5; // share of the objective: a smaller rise may be rounding

void main() {
    vec4 sum = sum_of_partials();
    if (gl_LocalInvocationID.x != 0u) return;
    write_row(sum);
    if (ACCELERATED == 0u) return;
    float objective = sum.x * scene.loss_scale + sum.z;
    float t = momentum[MOMENTUM_T];
    bool rose = objective > (1.0 + ROUNDING) * momentum[MOMENTUM_OBJECTIVE];
    bool restart = rose || sum.w > 0.0;
    if (rose) momentum[MOMENTUM_SHARE] = min(1.5 * momentum[MOMENTUM_SHARE], 1.0);
    if (restart) momentum[MOMENTUM_RESTARTS] += 1.0;
    float next = restart ? 1.0 : 0.5 + sqrt(0.25 + t * t);
    momentum[MOMENTUM_BETA] = restart ? 0.0 : (t - 1.0) / next;
    momentum[MOMENTUM_T] = next;
    momentum[MOMENTUM_OBJECTIVE] = objective;
    trace[push.iteration * TRACE_ROW + TRACE_RESTARTS] = floatBitsToUint(momentum[MOMENTUM_RESTARTS]);
}
