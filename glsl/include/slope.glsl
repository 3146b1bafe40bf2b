// The gradient of a sample, gathered over pairs: what both solvers share. Needs EXACT and what gather.glsl needs.
// A pair adds r * slope, the slope of what a vector v shows (transport.glsl) at v = `direction`. Both models are
// homogeneous in |v|, so one slope serves unit normals and vectors, and what is shown is v times the slope: it is found
// once, at the end. So is what of a Lambertian slope lies along the normal n,
//   slope = walls * (cos_b a + cos_a b - cos_a cos_b n), a and b the unit directions to the wall points.
#include "gather.glsl"

vec3 direction;      // of the surface there: its unit normal, or the vector itself
vec3 unit;           // the same as a unit vector, for Lambertian surfaces
vec3 aside = vec3(0.0); // sum of the slopes but for what lies along n
float along = 0.0;   // sum of that; without normals, of the residual that is seen

void slope_of(Arm a, Arm b, float r) {
    if (EXACT != 0u) r *= a.falloff * b.falloff;
    if (!NORMALS) {
        along += r;
        return;
    }
    if (REFLECTANCE == COSINE) {
        aside += (dot(direction, a.way) > 0.0 ? r * a.inverse : 0.0) * a.way;
        return;
    }
    // As long as the ways are; one factor then takes their lengths.
    float toward_a = dot(unit, a.way);
    float toward_b = dot(unit, b.way);
    float both = a.inverse * b.inverse;
    r = toward_a > 0.0 && toward_b > 0.0 ? r * (both * both * (a.wall * b.wall)) : 0.0;
    float of_a = r * toward_b;
    along += of_a * toward_a;
    // Two alike are added up at the end.
    aside += of_a * a.way;
    if (GEOMETRY != CONFOCAL) aside += r * toward_a * b.way;
}

#ifndef OWN_MEET
void meet(Arm a, Arm b, vec2 r) { slope_of(a, b, r.x); }
#endif

// (value, slope) over all pairs between push.first and push.last, of this slice: d/d albedo, and d/d vector, or d/d
// normal without the factor albedo.
vec4 gather_slope(vec3 x, vec3 of, uint slice, uint slices) {
    direction = of;
    unit = of * inversesqrt(max(dot(of, of), LEAST_SQUARE));
    gather(x, slice, slices);
    if (!NORMALS) return vec4(along, vec3(0.0));
    if (REFLECTANCE == LAMBERTIAN) aside = (GEOMETRY == CONFOCAL ? 2.0 : 1.0) * aside - along * unit;
    return vec4(dot(direction, aside), aside);
}
