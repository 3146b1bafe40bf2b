// Cost of a dispatch with almost no work: one invocation counts it. Dispatches of this kernel depend on each other,
// like those of an iteration.
#version 460
layout(local_size_x = 1) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(std430, set = 0, binding = 1) buffer Result { uint result[]; };

void main() { result[0] += push.turns; }
