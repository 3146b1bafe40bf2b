// Rate of atomic additions to a buffer, by lanes that add to histograms of their own: the forward kernel's worst case, without
// shared sectors. Finally every word has counted every turn of its owners.
#version 460
#ifdef ACCUMULATE_FLOAT
#extension GL_EXT_shader_atomic_float : require
#define WORD float
#else
#define WORD uint
#endif
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(std430, set = 0, binding = 1) buffer Result { WORD result[]; };
const uint WORDS = 65536u;

// Histograms of 512 words, of which the first 256 are incremented once in 64 turns, the last first.
void main() {
    uint histogram = (gl_WorkGroupID.x * 64u + gl_LocalInvocationID.x) & (WORDS / 512u - 1u);
    uint word = histogram * 512u + 255u;
    for (uint i = 0u; i < push.turns; ++i) {
        atomicAdd(result[word], WORD(1));
        atomicAdd(result[word - 1u], WORD(1));
        atomicAdd(result[word - 2u], WORD(1));
        atomicAdd(result[word - 3u], WORD(1));
        word -= 4u;
    }
}
