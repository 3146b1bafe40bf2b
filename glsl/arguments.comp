// Recomputes the dispatch sizes of passes over pairs with unchanged counts (arguments.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Arguments { uint arguments[]; };

#include "arguments.glsl"

void main() { write_arguments(); }
