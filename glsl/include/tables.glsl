// Buffers read for every pair by gathers: wall points, and residuals of bins. With TEXELS they are texel buffers: a
// CPU driver loads texels for all lanes of a subgroup at once, but words of a storage block lane by lane.

#ifdef TEXELS
layout(set = 0, binding = 14, rgba32f) readonly uniform imageBuffer wall;
layout(set = 0, binding = 15, r32f) readonly uniform imageBuffer residual;
vec3 wall_at(uint i) { return imageLoad(wall, int(i)).xyz; }
float residual_at(uint i) { return imageLoad(residual, int(i)).x; }
#else
layout(std430, set = 0, binding = 14) readonly buffer Wall { vec4 wall[]; };
layout(std430, set = 0, binding = 15) readonly buffer Residual { float residual[]; };
vec3 wall_at(uint i) { return wall[i].xyz; }
float residual_at(uint i) { return residual[i]; }
#endif
