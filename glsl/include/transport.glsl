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
layout(constant_id = 26) const uint TOUCHING = 1u; // 0: no sample can be within `nearest` of a wall point

// What leads from a sample to a wall point. The direction is left as long as it is: the inverse goes into the one factor
// that a pair has anyway, not into three components.
struct Arm {
    vec3 way;       // to the wall point, metres
    float inverse;  // of its length; 0 for a degenerate pair
    float distance; // metres; with FINE whole grains
    float rest;     // with FINE: what is left of the distance, grains
    float falloff;  // (reference / distance)^2, or its root for retroreflective surfaces; 0 for a degenerate pair
    float wall;     // cosine at the wall times the distance, for Lambertian surfaces
    float wall_rise; // what a metre of depth adds to it
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
    arm.way = point - x;
    float d2 = dot(arm.way, arm.way);
    arm.inverse = inversesqrt(d2);
    // A sample on a wall point has no direction; its kernel is defined as nothing.
    if (TOUCHING != 0u && (d2 < scene.nearest * scene.nearest || d2 == 0.0)) arm.inverse = 0.0;
    arm.distance = d2 * arm.inverse;
    arm.rest = 0.0;
    if (FINE != 0u) refine(arm, point, x, arm.way, arm.inverse);
    float scaled = scene.reference * arm.inverse;
    arm.falloff = REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
    arm.wall = max(CURVED != 0u ? -dot(normal, arm.way) : -arm.way.z, 0.0);
    arm.wall_rise = CURVED != 0u ? normal.z : 1.0;
    return arm;
}

// What both walls of a Lambertian pair show.
float walls(Arm a, Arm b) { return a.wall * a.inverse * (b.wall * b.inverse); }

// What no unit vector shows more of: all that does not depend on the surface's direction.
float bound_of(Arm a, Arm b) {
    return a.falloff * b.falloff * (REFLECTANCE == LAMBERTIAN ? walls(a, b) : 1.0);
}

// Where |v| = 0 its inverse must stay finite: the smallest square that fp32 holds with all its bits.
const float LEAST_SQUARE = 1e-36;

// What a surface vector v (unit, or albedo * normal) shows to a pair, without the falloff: |v| times the cosines. A
// surface that faces away from one of the points shows nothing.
float shine(Arm a, Arm b, vec3 v) {
    if (!NORMALS) return 1.0;
    float toward_a = max(dot(v, a.way), 0.0) * a.inverse;
    if (REFLECTANCE == COSINE) return toward_a;
    float toward_b = max(dot(v, b.way), 0.0) * b.inverse;
    return walls(a, b) * toward_a * toward_b * inversesqrt(max(dot(v, v), LEAST_SQUARE));
}
