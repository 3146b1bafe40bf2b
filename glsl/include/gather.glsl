// What the backward kernels share: a walk over pairs, each with both its arms and the residual that a path at its bin
// sees. Needs SPLIT, transport.glsl and the buffers wall and residual, and meet(), which takes what is found.
// In a product, OTHERS other points go at once: the arm to a scanned point is found once for all of them.
// Pairs are push.first to push.last, `slice` of `slices`; in a product whole rows, or a part of one.

#include "place.glsl"

layout(constant_id = 23) const uint OTHERS = 1u;

void meet(Arm a, Arm b, vec2 r);

// From a sample to a wall point by its number.
Arm arm_at(uint point, vec3 x) {
    vec3 normal = CURVED != 0u ? wall[scene.scanned + scene.others + point].xyz : vec3(0.0, 0.0, 1.0);
    return arm_to(wall[point].xyz, normal, x);
}

// The residual of row `row` that a path there sees, of its bin or of the two around it, and its rise from one to the other.
vec2 residual_around(uint row, Place place) {
    float low = residual[row + place.cell];
    if (SPLIT == 0u) return vec2(low, 0.0);
    float rise = residual[row + place.cell + 1u] - low;
    return vec2(low + place.share * rise, rise);
}

void gather(vec3 x, uint slice, uint slices) {
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
    uint next = scene.scanned * scene.stride; // the same scanned point with the next other one
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
