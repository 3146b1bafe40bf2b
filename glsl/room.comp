// Minimum smoothed albedo that fits into the room. One invocation descends the levels while at most push.first voxels
// are above. Zero if all voxels above the threshold fit (push.flags has the bits of the threshold's share of the
// maximum). The highest level is always kept, as far as it fits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 1) readonly buffer Levels { uint levels[]; };
layout(std430, set = 0, binding = 2) buffer Counts { uint counts[]; };

void main() {
    uint above = levels[LEVELS - 1u];
    uint level = LEVELS - 1u;
    while (level > 0u && above + levels[level - 1u] <= push.first) above += levels[--level];
    uint peak = counts[COUNT_PEAK_SMOOTH] >> LEVEL_SHIFT;
    uint below = LEVELS - 1u - level;
    uint least = level == 0u || below > peak ? 0u : (peak - below) << LEVEL_SHIFT;
    float threshold = uintBitsToFloat(push.flags) * uintBitsToFloat(counts[COUNT_PEAK_SMOOTH]);
    counts[COUNT_LEAST_SMOOTH] = uintBitsToFloat(least) > threshold ? least : 0u;
}
