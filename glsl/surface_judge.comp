// Judges a fit on the way, so that the host need not wait for it: the block `surface_weights` is what a fit knows of itself.
// Before the first iteration: the factor of the albedos that explains most of the data, from renderings with the albedos once
// and twice, and the weights that follow from it. Every few iterations: a rise of the objective restores the best state
// (surface_keep.comp), halves the steps and puts Adam at rest; else the steps grow again, and the prior is weighted by the
// objective that is left. One invocation.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 1) buffer SurfaceWeights { float surface_weights[]; };
layout(std430, set = 0, binding = 2) buffer Trace { uint trace[]; };
layout(std430, set = 0, binding = 3) readonly buffer SurfaceEnergies { float surface_energies[]; }; // by batch of pairs

const float RISE = 0.05;    // of the logarithm of the objective: batches differ by less
const float SHORTER = 0.5;  // factors of the steps after a rise, and without one (benches/NOTES.md, "Lengths of steps")
const float LONGER = 1.2;
const float LEAST = 1e-37;  // denominators and arguments of logarithms
const float MOST = 1e37;

float traced(uint row, uint column) { return uintBitsToFloat(trace[row * TRACE_ROW + column]); }

void weigh(float left) {
    surface_weights[SURFACE_BEND] = surface_weights[SURFACE_BEND_SHARE] * left;
    surface_weights[SURFACE_JUMP] = surface_weights[SURFACE_JUMP_SHARE] * left;
}

// Steps of another length have other largest gradients.
void pace(float factor) {
    surface_weights[SURFACE_FACTOR] = factor;
    surface_weights[SURFACE_DEPTH_RATE] = factor * surface_weights[SURFACE_DEPTH_LONGEST];
    surface_weights[SURFACE_ALBEDO_RATE] = factor * surface_weights[SURFACE_ALBEDO_LONGEST];
    surface_weights[SURFACE_LARGEST] = 0.0;
    surface_weights[SURFACE_LARGEST + 1u] = 0.0;
}

void act(uint action) { surface_weights[SURFACE_ACTION] = float(action); }

// |A v - h|^2 and |2 A v - h|^2 give, with |h|^2, the factor of v that leaves least. The weights are those of an albedo of one.
void place() {
    float energy = surface_weights[SURFACE_ENERGY];
    float explained = energy - surface_weights[SURFACE_PLACED];
    if ((push.flags & JUDGE_SCALE) != 0u) {
        float measured = surface_weights[SURFACE_COMPARED];
        float once = traced(push.first, TRACE_OBJECTIVE);
        float rendered = 0.5 * (measured - 2.0 * once + traced(push.first + 1u, TRACE_OBJECTIVE));
        float found = rendered == 0.0 ? 0.0 : 0.5 * (rendered + measured - once) / rendered;
        bool explains = found > 0.0 && found < MOST;
        float scale = explains ? found : 1.0;
        surface_weights[SURFACE_SCALE] *= explains ? found : 0.0;
        surface_weights[SURFACE_BRIGHTEST] *= scale;
        surface_weights[SURFACE_TIMES] = 0.5 * scale; // they are doubled
        explained = explains ? energy * scale * scale * rendered / measured : 0.0;
        surface_weights[SURFACE_PLACED] = energy - explained;
    }
    act(ACTION_SCALE);
    if ((push.flags & JUDGE_GUESS) != 0u) return;
    float most = surface_weights[SURFACE_BRIGHTEST];
    surface_weights[SURFACE_JUMP_SHARE] /= most * most;
    surface_weights[SURFACE_ALBEDO_LONGEST] *= most;
    surface_weights[SURFACE_SPARSE] *= explained / most;
    surface_weights[SURFACE_FAINT] *= most;
    float left = surface_weights[SURFACE_PLACED];
    surface_weights[SURFACE_BEST_LEFT] = left / max(energy, LEAST);
    weigh(min(left, surface_weights[SURFACE_BEFORE]));
    pace(surface_weights[SURFACE_FACTOR]);
}

// Of an iteration: logarithm of the objective over the energy of its pairs, data term over that, objective, plain data loss.
vec4 objective(uint row) {
    float energy = max(surface_energies[row % push.last], LEAST);
    float data = traced(row, TRACE_OBJECTIVE);
    float all = data + traced(row, TRACE_L1);
    float share = all / energy;
    return vec4(log(share < LEAST ? LEAST : share), data / energy, all, traced(row, TRACE_DATA));
}

void keep_best(vec4 of) {
    surface_weights[SURFACE_BEST] = of.x;
    surface_weights[SURFACE_BEST_LEFT] = of.y;
    surface_weights[SURFACE_BEST_LOSS] = of.z;
    surface_weights[SURFACE_BEST_DATA] = of.w;
}

// Iterations from push.first to before push.iteration; push.last: number of batches.
void compare() {
    if (push.first == push.iteration) {
        // The last iterations are judged already.
        act(surface_weights[SURFACE_ACTION] == float(ACTION_NONE) ? ACTION_RESTORE : ACTION_NONE);
        return;
    }
    uint last_row = push.iteration - 1u;
    if ((push.flags & JUDGE_FIRST) != 0u) {
        vec4 first = objective(push.first);
        keep_best(vec4(first.x, surface_weights[SURFACE_BEST_LEFT], first.zw));
    }
    uint rows = min(push.last, push.iteration - push.first);
    vec4 here = vec4(0.0);
    for (uint k = 0u; k < rows; ++k) here += objective(push.iteration - rows + k);
    here /= float(rows);
    float energy = surface_weights[SURFACE_ENERGY];
    float factor = surface_weights[SURFACE_FACTOR];
    // Also for NaN.
    if (!(here.x <= surface_weights[SURFACE_BEST] + RISE)) {
        weigh(surface_weights[SURFACE_BEST_LEFT] * energy);
        pace(SHORTER * factor);
        surface_weights[SURFACE_RESTED] = float(push.step);
        // The row shows the state that is restored. NaN stays: the host reports it.
        if (here.z < MOST) {
            trace[last_row * TRACE_ROW + TRACE_OBJECTIVE] = floatBitsToUint(surface_weights[SURFACE_BEST_LOSS]);
            trace[last_row * TRACE_ROW + TRACE_DATA] = floatBitsToUint(surface_weights[SURFACE_BEST_DATA]);
            trace[last_row * TRACE_ROW + TRACE_L1] = 0u;
        }
        act(ACTION_RESTORE);
        return;
    }
    weigh(traced(last_row, TRACE_OBJECTIVE));
    if (here.x <= surface_weights[SURFACE_BEST]) {
        keep_best(here);
        if (factor < 1.0) pace(min(LONGER * factor, 1.0));
        act(ACTION_KEEP);
    } else {
        act((push.flags & JUDGE_LAST) != 0u ? ACTION_RESTORE : ACTION_NONE);
    }
}

void main() {
    if (push.iteration == 0u) place();
    else compare();
}
