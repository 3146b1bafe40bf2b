// Rate of fused multiply-adds. One invocation has 16 independent chains x = a x + b in registers, enough to hide the
// latency; its only memory access is one sum at the end. With a = b = 1, unknown to the compiler, a chain counts its
// own turns, so the sum proves that none was omitted.
#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(std430, set = 0, binding = 1) writeonly buffer Result { float result[]; };

void main() {
    vec4 x[4] = vec4[4](vec4(0.0, 1.0, 2.0, 3.0), vec4(4.0, 5.0, 6.0, 7.0), vec4(0.0), vec4(1.0));
    vec4 a = vec4(push.a);
    vec4 b = vec4(push.b);
    for (uint i = 0u; i < push.turns; ++i) {
        x[0] = fma(x[0], a, b);
        x[1] = fma(x[1], a, b);
        x[2] = fma(x[2], a, b);
        x[3] = fma(x[3], a, b);
        x[0] = fma(x[0], a, b);
        x[1] = fma(x[1], a, b);
        x[2] = fma(x[2], a, b);
        x[3] = fma(x[3], a, b);
    }
    vec4 sum = x[0] + x[1] + x[2] + x[3];
    result[gl_GlobalInvocationID.x] = dot(sum, vec4(1.0));
}
