// Rate of additions to words that belong to one lane at a time, as forward_owned.comp adds, on CPUs: a workgroup runs
// on one thread and owns 64 words, and its lanes are at different ones. Finally every word has counted every turn.
#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(set = 0, binding = 1, r32f) uniform imageBuffer result;

void add(uint word) {
    int at = int(gl_WorkGroupID.x * 64u + (word & 63u));
    imageStore(result, at, vec4(imageLoad(result, at).x + push.a));
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    for (uint i = 0u; i < push.turns; ++i) {
        add(lane + i);
        add(lane + i + 16u);
        add(lane + i + 32u);
        add(lane + i + 48u);
    }
}
