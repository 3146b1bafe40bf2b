// Rate of copies from buffer to buffer by neighbouring lanes, 16 bytes each, within the first elements of both: as many
// as `mask`, a power of two less one, leaves. Small sets stay in a cache.
#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint turns; uint mask; uint lanes; } push;
layout(std430, set = 0, binding = 1) readonly buffer From { uvec4 from[]; };
layout(std430, set = 0, binding = 2) writeonly buffer To { uvec4 to[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    for (uint i = 0u; i < push.turns; ++i) {
        to[at & push.mask] = from[at & push.mask];
        at += push.lanes;
    }
}
