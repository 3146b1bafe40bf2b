// Rate of atomic additions to shared memory without collisions in a workgroup: the lanes cycle through 64 counters,
// each from its own. Finally every counter has counted every turn.
#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(std430, set = 0, binding = 1) writeonly buffer Result { uint result[]; };

shared uint counters[64];

void main() {
    uint lane = gl_LocalInvocationID.x;
    counters[lane] = 0u;
    barrier();
    for (uint i = 0u; i < push.turns; ++i) {
        atomicAdd(counters[(lane + i) & 63u], 1u);
        atomicAdd(counters[(lane + i + 16u) & 63u], 1u);
        atomicAdd(counters[(lane + i + 32u) & 63u], 1u);
        atomicAdd(counters[(lane + i + 48u) & 63u], 1u);
    }
    barrier();
    result[gl_GlobalInvocationID.x] = counters[lane];
}
