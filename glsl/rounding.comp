// Rounds places as place.glsl does, for devices without a guaranteed rounding mode: place number i is i / 8, and its
// integer part plus 2^23 is written. The host checks the result (solve/rounding.rs).
#version 460
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) writeonly buffer Result { float result[]; };

void main() {
    uint i = gl_LocalInvocationID.x;
    precise float whole = fma(float(i), 0.125, 8388607.5);
    result[i] = whole;
}
