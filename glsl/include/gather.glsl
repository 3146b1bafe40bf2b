// Iteration over pairs, shared by the backward kernels. For each pair it computes both arms and reads the residual at
// the pair's path, and passes them to meet(). Needs SPLIT, transport.glsl, and meet(). In a product, OTHERS other
// points are processed jointly: the arm to a scanned point is computed once for all. Covers pairs push.first to
// push.last, share `slice` of `slices`. In a product this range has all pairs of one or more other points, or some
// pairs of one.

#include "place.glsl"
#include "tables.glsl"

layout(constant_id = 23) const uint OTHERS = 1u;

void meet(Arm a, Arm b, vec2 r);

// The arm from a sample to wall point number `point`.
Arm arm_at(uint point, vec3 x) {
    vec3 normal = CURVED != 0u ? wall_at(scene.scanned + scene.others + point) : vec3(0.0, 0.0, 1.0);
    return arm_to(wall_at(point), normal, x);
}

// Residual of row `row` at a place: of one bin, or interpolated between two with SPLIT; then its slope per bin.
vec2 residual_around(uint row, Place place) {
    float low = residual_at(row + place.cell);
    if (SPLIT == 0u) return vec2(low, 0.0);
    float rise = residual_at(row + place.cell + 1u) - low;
    return vec2(low + place.share * rise, rise);
}

void gather(vec3 x, uint slice, uint slices) {
    read_scene();
    if (GEOMETRY != PRODUCT) {
        uint row = row_of(push.first + slice);
        for (uint pair = push.first + slice; pair < push.last; pair += slices) {
            Arm a = arm_at(pair, x);
            Arm b = a;
            if (GEOMETRY == TWO_POINTS) b = arm_at(scene.scanned + pair, x);
            meet(a, b, residual_around(row, place_of(a, b)));
            row += slices * scene.stride;
        }
        return;
    }
    uint first = push.first / scene.scanned;
    uint rows = (push.last - 1u) / scene.scanned + 1u;
    uint end = rows - first > 1u ? scene.scanned : push.last - first * scene.scanned;
    uint next = scene.scanned * scene.stride; // to the next other point with the same scanned point
    for (uint other = first; other < rows; other += OTHERS) {
        Arm b[OTHERS];
        for (uint i = 0u; i < OTHERS; ++i) b[i] = arm_at(scene.scanned + min(other + i, rows - 1u), x);
        for (uint point = push.first % scene.scanned + slice; point < end; point += slices) {
            Arm a = arm_at(point, x);
            uint row = row_of(other * scene.scanned + point);
            for (uint i = 0u; i < OTHERS; ++i) {
                if (other + i >= rows) break;
                meet(a, b[i], residual_around(row, place_of(a, b[i])));
                row += next;
            }
        }
    }
}
