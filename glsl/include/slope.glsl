// Gradient at a sample, gathered over pairs, for both solvers. Needs EXACT and the requirements of gather.glsl. A
// pair adds r * slope, where slope is the derivative of shine (transport.glsl) by a vector in the direction of the
// normal. In both models with normals shine is homogeneous in that vector's length, so shine is the dot product of
// normal and slope, computed once at the end. The component of a Lambertian slope along the normal n is also added
// once at the end:
//   slope = walls * (cos_b a + cos_a b - cos_a cos_b n), a and b the unit directions to the wall points.
#include "gather.glsl"

vec3 normal;            // unit surface normal at the sample
vec3 aside = vec3(0.0); // sum of the slopes without their components along n
float along = 0.0;      // sum of those components; without normals, sum of the residuals

void slope_of(Arm a, Arm b, float r) {
    if (EXACT != 0u) r *= a.falloff * b.falloff;
    if (!NORMALS) {
        along += r;
        return;
    }
    if (REFLECTANCE == COSINE) {
        aside += (dot(normal, a.way) > 0.0 ? r * a.inverse : 0.0) * a.way;
        return;
    }
    // These dot products include the lengths of the vectors; one factor below divides them out.
    float toward_a = dot(normal, a.way);
    float toward_b = dot(normal, b.way);
    float both = a.inverse * b.inverse;
    r = toward_a > 0.0 && toward_b > 0.0 ? r * (both * both * (a.wall * b.wall)) : 0.0;
    float of_a = r * toward_b;
    along += of_a * toward_a;
    // Confocal: both terms are equal, and gather_slope() doubles the first.
    aside += of_a * a.way;
    if (GEOMETRY != CONFOCAL) aside += r * toward_a * b.way;
}

#ifndef OWN_MEET
void meet(Arm a, Arm b, vec2 r) { slope_of(a, b, r.x); }
#endif

// Sum of (value, slope) over the pairs of this slice, push.first to push.last: d/d albedo, then d/d normal without the factor
// albedo.
vec4 gather_slope(vec3 x, vec3 of, uint slice, uint slices) {
    normal = of;
    gather(x, slice, slices);
    if (!NORMALS) return vec4(along, vec3(0.0));
    if (REFLECTANCE == LAMBERTIAN) aside = (GEOMETRY == CONFOCAL ? 2.0 : 1.0) * aside - along * normal;
    return vec4(dot(normal, aside), aside);
}
