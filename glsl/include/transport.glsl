// Light from a sample of the hidden surface to a pair of wall points, along two arms:
//   value = albedo * cosines * falloff_a * falloff_b   at path distance_a + distance_b.
// The first arm ends at the scanned point, the second at the other point; in a confocal pair they coincide. `wall`
// has the scanned points, then the other points (GEOMETRY > CONFOCAL); for curved walls the normals of all points
// follow in the same order.

#include "reflectance.glsl"
const uint CONFOCAL = 0u;   // one point, one distance
const uint TWO_POINTS = 1u; // each pair has its own two points
const uint PRODUCT = 2u;    // every scanned point with every other point; pair = other * scanned + point
layout(constant_id = 20) const uint GEOMETRY = 0u;
layout(constant_id = 22) const uint CURVED = 0u; // 0: the wall's normal is (0, 0, 1) everywhere
layout(constant_id = 24) const uint FINE = 0u;   // 1: paths have more bins than fp32 resolves (place.glsl)
layout(constant_id = 26) const uint TOUCHING = 1u; // 0: no sample can be within `nearest` of a wall point
layout(constant_id = 27) const uint POLISHED = 0u; // 1: a Newton step corrects the device's inverse square root

// From a sample to a wall point. `way` is not normalised: the inverse length is part of the one factor per pair,
// instead of three components.
struct Arm {
    vec3 way;       // vector to the wall point, metres
    float inverse;  // 1 / length; 0 for a degenerate pair
    float distance; // metres; with FINE whole grains
    float rest;     // with FINE: rest of the distance, grains
    float falloff;  // (reference / distance)^2, or its root for retroreflective surfaces; 0 for a degenerate pair
    float wall;     // cosine at the wall times the distance, for Lambertian surfaces
    float wall_rise; // derivative of `wall` by the sample's depth
};

// Distance with about 34 bits: a rounded root r, and (d.d - r r) / 2r. Every length is an integer number of grains,
// at most 2^11, and a rest below one half: squares of integers add without rounding, and the rests are small.
void refine(inout Arm arm, vec3 point, vec3 x, vec3 d, float inverse) {
    // Rounding error of the difference (Knuth's two-sum).
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

float reference; // scene.reference, see read_scene()

Arm arm_to(vec3 point, vec3 normal, vec3 x) {
    Arm arm;
    arm.way = point - x;
    float d2 = dot(arm.way, arm.way);
    arm.inverse = inversesqrt(d2);
    // A sample on a wall point has no direction; its kernel is zero by definition.
    if (TOUCHING != 0u && (d2 < scene.nearest * scene.nearest || d2 == 0.0)) arm.inverse = 0.0;
    arm.distance = d2 * arm.inverse;
    if (POLISHED != 0u) {
        arm.distance = fma(fma(-arm.distance, arm.distance, d2), 0.5 * arm.inverse, arm.distance);
    }
    arm.rest = 0.0;
    if (FINE != 0u) refine(arm, point, x, arm.way, arm.inverse);
    float scaled = reference * arm.inverse;
    arm.falloff = REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
    arm.wall = max(CURVED != 0u ? -dot(normal, arm.way) : -arm.way.z, 0.0);
    arm.wall_rise = CURVED != 0u ? normal.z : 1.0;
    return arm;
}

// Product of both cosines at the wall, for Lambertian surfaces.
float walls(Arm a, Arm b) { return a.wall * a.inverse * (b.wall * b.inverse); }

// Cosine factors of a surface with this normal toward a pair, at unit albedo and without falloff. Zero if the surface
// faces away from one of the points.
float shine(Arm a, Arm b, vec3 normal) {
    if (!NORMALS) return 1.0;
    float toward_a = max(dot(normal, a.way), 0.0) * a.inverse;
    if (REFLECTANCE == COSINE) return toward_a;
    return walls(a, b) * toward_a * max(dot(normal, b.way), 0.0) * b.inverse;
}
