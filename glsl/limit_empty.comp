// What a dispatch costs that does next to nothing: one invocation counts it. Dispatches of this kernel depend on each
// other, as those of an iteration do.
#version 460
layout(local_size_x = 1) in;
layout(push_constant) uniform Push { uint turns; float a; float b; } push;
layout(std430, set = 0, binding = 1) buffer Result { uint result[]; };

void main() { result[0] += push.turns; }
