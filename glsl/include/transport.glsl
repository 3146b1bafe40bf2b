// Light between a sample of the hidden surface and a pair of wall points, in two arms:
//   value = albedo * cosines * falloff_a * falloff_b   at path distance_a + distance_b.
// The first arm leads to the scanned point, the second to the other one; in a confocal pair they are the same.
// `wall` holds the scanned points, the other ones (GEOMETRY > CONFOCAL), and where the wall is curved the normals of
// all of them in the same order.

#include "reflectance.glsl"
const uint CONFOCAL = 0u;   // one point, one distance
const uint TWO_POINTS = 1u; // every pair has two points of its own
const uint PRODUCT = 2u;    // every scanned point with every other point; pair = other * scanned + point
layout(constant_id = 20) const uint GEOMETRY = 0u;
layout(constant_id = 22) const uint CURVED = 0u; // 0: the wall's normal is (0, 0, 1) everywhere
layout(constant_id = 24) const uint FINE = 0u;   // 1: paths are more bins long than fp32 tells apart (place.glsl)

struct Arm {
    vec3 toward;    // unit, sample to wall point; zero for a degenerate pair
    float distance; // metres; with FINE whole grains
    float rest;     // with FINE: what is left of the distance, grains
    float falloff;  // (reference / distance)^2, or its root for retroreflective surfaces; 0 for a degenerate pair
    float wall;     // cosine at the wall, for Lambertian surfaces
};

// The distance to some 34 bits: a rounded root r, and (d.d - r r) / 2r. Every length is a whole number of grains, at
// most 2^11, and a rest below one half: the squares of whole numbers add up without rounding, and the rests are small.
void refine(inout Arm arm, vec3 point, vec3 x, vec3 d, float inverse) {
    // What the difference itself lost (Knuth's two-sum).
    precise vec3 back = d - point;
    precise vec3 lost = (point - (d - back)) - (x + back);
    precise vec3 whole = round(d * scene.grains_per_metre);
    precise vec3 rest = (d - whole * scene.grain) * scene.grains_per_metre + lost * scene.grains_per_metre;
    float r = arm.distance * scene.grains_per_metre;
    precise float r_whole = round(r);
    precise float r_rest = r - r_whole;
    precise float wholes = dot(whole, whole) - r_whole * r_whole;
    precise float rests = dot(rest, 2.0 * whole + rest) - r_rest * (2.0 * r_whole + r_rest);
    arm.distance = r_whole;
    arm.rest = r_rest + 0.5 * (wholes + rests) * inverse * scene.grain;
}

Arm arm_to(vec3 point, vec3 normal, vec3 x) {
    Arm arm;
    vec3 d = point - x;
    float d2 = dot(d, d);
    // A sample on a wall point has no direction; its kernel is defined as nothing.
    bool degenerate = d2 < scene.nearest * scene.nearest || d2 == 0.0;
    float inverse = degenerate ? 0.0 : inversesqrt(d2);
    arm.toward = d * inverse;
    arm.distance = d2 * inverse;
    arm.rest = 0.0;
    if (FINE != 0u) refine(arm, point, x, d, inverse);
    float scaled = scene.reference * inverse;
    arm.falloff = REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
    arm.wall = max(CURVED != 0u ? -dot(normal, arm.toward) : -arm.toward.z, 0.0);
    return arm;
}

// What no unit vector shows more of: all that does not depend on the surface's direction.
float bound_of(Arm a, Arm b) {
    return a.falloff * b.falloff * (REFLECTANCE == LAMBERTIAN ? a.wall * b.wall : 1.0);
}

// What a surface vector v (unit, or albedo * normal) shows to a pair, without the falloff, and its slope there.
// Both models are homogeneous in |v|, so one slope serves unit normals and vectors. A surface that faces away from
// one of the points shows nothing.
struct Shine {
    float value;
    vec3 slope;
};

Shine shine(Arm a, Arm b, vec3 v) {
    if (!NORMALS) return Shine(1.0, vec3(0.0));
    if (REFLECTANCE == COSINE) {
        float value = dot(v, a.toward);
        return value > 0.0 ? Shine(value, a.toward) : Shine(0.0, vec3(0.0));
    }
    float size = max(length(v), 1e-30);
    vec3 n = v / size;
    float cos_a = dot(n, a.toward);
    float cos_b = dot(n, b.toward);
    float walls = cos_a > 0.0 && cos_b > 0.0 ? a.wall * b.wall : 0.0;
    return Shine(walls * size * cos_a * cos_b, walls * (cos_b * a.toward + cos_a * b.toward - cos_a * cos_b * n));
}
