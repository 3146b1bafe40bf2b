// Rate of inverse square roots, representative of all special functions. One invocation sums the inverse square roots
// of 8 sequences in registers. The two additions for each cost less than the root on every known device.
#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(std430, set = 0, binding = 1) writeonly buffer Result { float result[]; };

void main() {
    vec4 x = vec4(1.0, 2.0, 3.0, 4.0);
    vec4 y = x + 4.0;
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < push.turns; ++i) {
        sum += inversesqrt(x);
        sum += inversesqrt(y);
        x += push.a;
        y += push.a;
    }
    result[gl_GlobalInvocationID.x] = dot(sum, vec4(1.0));
}
