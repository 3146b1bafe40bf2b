// Buffers read for every pair by gathers: wall points, and residuals of bins.

layout(std430, set = 0, binding = 14) readonly buffer Wall { vec4 wall[]; };
layout(std430, set = 0, binding = 15) readonly buffer Residual { float residual[]; };
vec3 wall_at(uint i) { return wall[i].xyz; }
float residual_at(uint i) { return residual[i]; }
