// Rate of four-byte loads from the nearest cache, from a storage block or as texels: neighbouring lanes read
// neighbouring words of a table of TABLE words, as the backward kernel reads neighbouring bins of a histogram. Their
// sum is known.
#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(std430, set = 0, binding = 1) writeonly buffer Result { uint result[]; };
#ifdef TEXELS
layout(set = 0, binding = 2, r32f) readonly uniform imageBuffer table;
uint word(uint i) { return floatBitsToUint(imageLoad(table, int(i)).x); }
#else
layout(std430, set = 0, binding = 2) readonly buffer Table { uint table[]; };
uint word(uint i) { return table[i]; }
#endif
const uint TABLE = 2048u;

void main() {
    uint at = gl_LocalInvocationID.x;
    uvec4 sum = uvec4(0u);
    for (uint i = 0u; i < push.turns; ++i) {
        sum.x += word(at & (TABLE - 1u));
        sum.y += word((at + 64u) & (TABLE - 1u));
        sum.z += word((at + 128u) & (TABLE - 1u));
        sum.w += word((at + 192u) & (TABLE - 1u));
        at += 256u;
    }
    result[gl_GlobalInvocationID.x] = sum.x + sum.y + sum.z + sum.w;
}
