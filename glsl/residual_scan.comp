// Comparison and high-pass of residual_rows.comp: one workgroup owns a row, which stays in shared memory between one read of
// its inputs and one write of its residual. The smoother is summed as the two recurrences c and d of transport/high_pass.rs.
// Each lane owns a run of ROW_RUN bins, an odd number against bank conflicts. It computes both over its run from zero, a scan
// over lanes adds the runs before and behind, and the mirrored row adds to both ends (surface.slow_wrap). The order of sums
// is fixed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "surface_block.glsl"
#include "grid.glsl"
layout(constant_id = 35) const uint ROW_LANES = 64u; // a power of two, at least PADDING
layout(constant_id = 36) const uint ROW_RUN = 9u;    // bins of a lane
layout(local_size_x_id = 35) in;
#include "compared.glsl"

shared float values[ROW_LANES * ROW_RUN];
shared vec2 ends[2u * ROW_LANES]; // of runs: c of the last bin, d of the first
shared float last_end;            // c of the last run by itself
shared uint is_rendered;

uint lane;
uint first; // bin of the lane's run
uint count; // bins of the lane's run
uint last;  // lane of the last run

// Decay over a number of bins. More than a row has are those of lanes beyond its end, whose sums are zero or unused.
float decay(uint over) { return row_factors[min(over, scene.bins)].w; }

// Subtracts slow_share of the slow part from the row. Afterwards a lane may read its own run only.
void high_pass() {
    float a = surface.slow_decay;
    vec2 own = vec2(0.0);
    for (uint i = 0u; i < ROW_RUN; ++i) {
        if (i < count) own = a * own + vec2(values[first + i], values[first + count - 1u - i]);
    }
    ends[lane] = own;
    if (lane == last) last_end = own.x;
    barrier();
    uint from = 0u;
    for (uint reach = 1u; reach < ROW_LANES; reach *= 2u) {
        float factor = decay(ROW_RUN * reach);
        vec2 sum = ends[from + lane];
        if (lane >= reach) sum.x += factor * ends[from + lane - reach].x;
        if (lane + reach < ROW_LANES) sum.y += factor * ends[from + lane + reach].y;
        from = ROW_LANES - from;
        ends[from + lane] = sum;
        barrier();
    }
    // Sums over the row from zero; the last run may be shorter than the scan assumes.
    uint short_run = scene.bins - last * ROW_RUN;
    float c_end = last_end + (last > 0u ? decay(short_run) * ends[from + last - 1u].x : 0.0);
    float d_end = ends[from].y;
    float whole = decay(scene.bins);
    float c = (lane > 0u ? ends[from + lane - 1u].x : 0.0) + decay(first) * surface.slow_wrap * (d_end + whole * c_end);
    float d = (lane < last ? ends[from + lane + 1u].y : 0.0)
            + decay(scene.bins - first - count) * surface.slow_wrap * (c_end + whole * d_end);
    float share = surface.slow_share * (1.0 - a) / (1.0 + a);
    float kept[ROW_RUN];
    for (uint i = 0u; i < ROW_RUN; ++i) {
        if (i < count) c = a * c + values[first + i];
        kept[i] = c;
    }
    for (uint k = 0u; k < ROW_RUN; ++k) {
        uint i = ROW_RUN - 1u - k;
        if (i >= count) continue;
        float value = values[first + i];
        d = a * d + value;
        values[first + i] = value - share * (kept[i] + d - value);
    }
}

void main() {
    // The whole workgroup returns.
    uint pair = group_index();
    if (pair >= scene.pairs) return;
    lane = gl_LocalInvocationID.x;
    first = min(lane * ROW_RUN, scene.bins);
    count = min(ROW_RUN, scene.bins - first);
    last = (scene.bins - 1u) / ROW_RUN;
    uint row = pair * scene.stride + PADDING;
    if (lane == 0u) is_rendered = 1u;
    barrier();
    vec2 sums = vec2(0.0); // squared differences, filtered and plain
    bool good = true;
    for (uint bin = lane; bin < scene.bins; bin += ROW_LANES) {
        float rendered = compared(row + bin);
        good = good && finite(rendered);
        float difference = rendered - measured[pair * scene.bins + bin];
        sums.y += difference * difference;
        values[bin] = row_factors[bin].x * difference;
        if (SPOT == 0u) histograms[row + bin] = ZERO;
    }
    if (!good) atomicAnd(is_rendered, 0u);
    barrier();
    high_pass();
    for (uint i = 0u; i < count; ++i) sums.x += values[first + i] * values[first + i];
    barrier();
    high_pass();
    barrier();
    for (uint bin = lane; bin < scene.bins; bin += ROW_LANES) {
        residual[row + bin] = 2.0 * scene.loss_scale * scene.render_scale * row_factors[bin].x * values[bin];
    }
    // Padding before each row, and after the last.
    if (lane < PADDING) {
        clear_padding(row - PADDING + lane);
        if (pair == scene.pairs - 1u) clear_padding(row - PADDING + lane + scene.stride);
    }
    ends[lane] = sums;
    barrier();
    for (uint stride = ROW_LANES / 2u; stride > 0u; stride /= 2u) {
        if (lane < stride) ends[lane] += ends[lane + stride];
        barrier();
    }
    if (lane == 0u) close_row(pair, ends[0], is_rendered != 0u);
}
