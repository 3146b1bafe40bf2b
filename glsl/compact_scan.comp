// Compaction, step 2 of 3: exclusive prefix sum of the bricks' counts in place, and their total. One workgroup: each
// lane sums a contiguous run of bricks, the runs are scanned in shared memory, and each lane writes its run. At most
// 128 invocations are guaranteed. The last lane then writes the sizes of passes that depend on the counts. The scene
// is that of the rendered pairs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 128) in;
layout(constant_id = 10) const uint RIM = 0u; // 1: counts are of the rim, 0: of active voxels
layout(std430, set = 0, binding = 1) buffer BrickOffsets { uint brick_offsets[]; };
layout(std430, set = 0, binding = 2) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Arguments { uint arguments[]; };

#include "arguments.glsl"

shared uint runs[128];

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint length = (brick_count() + 127u) / 128u;
    uint begin = min(lane * length, brick_count());
    uint end = min(begin + length, brick_count());
    uint sum = 0u;
    for (uint i = begin; i < end; ++i) sum += brick_offsets[i];
    runs[lane] = sum;
    barrier();
    for (uint stride = 1u; stride < 128u; stride <<= 1) {
        uint before = lane >= stride ? runs[lane - stride] : 0u;
        barrier();
        runs[lane] += before;
        barrier();
    }
    uint offset = runs[lane] - sum;
    for (uint i = begin; i < end; ++i) {
        uint count = brick_offsets[i];
        brick_offsets[i] = offset;
        offset += count;
    }
    if (lane != 127u) return;
    if (RIM == 0u) {
        counts[COUNT_ACTIVE] = min(runs[127], scene.capacity);
        counts[COUNT_TOUCHED] = counts[COUNT_ACTIVE];
    } else {
        uint touched = counts[COUNT_ACTIVE] + runs[127];
        counts[COUNT_TOUCHED] = min(touched, scene.touched_capacity);
        // Omitted voxels are reported like dim ones, by a minimum albedo above zero. The reduction's threshold has
        // already run and does not see this value.
        if (touched > scene.touched_capacity) counts[COUNT_LEAST_SMOOTH] = max(counts[COUNT_LEAST_SMOOTH], 1u);
    }
    write_arguments();
}
