// The gradient of a sample, gathered over pairs: what both solvers share. Needs EXACT and what gather.glsl needs.
#include "gather.glsl"

vec3 direction; // of the surface there: its unit normal, or the vector itself
// (value, slope) of what it shows, times the residual: d/d albedo, and d/d vector, or d/d normal without the factor
// albedo.
vec4 sum = vec4(0.0);

void meet(Arm a, Arm b, float r) {
    Shine s = shine(a, b, direction);
    if (EXACT != 0u) r *= a.falloff * b.falloff;
    sum += r * vec4(s.value, s.slope);
}
