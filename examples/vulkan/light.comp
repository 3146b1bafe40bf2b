// The program's own pass: the light of a hidden letter T, as photon counts of a confocal scan. One invocation fills one histogram.
#version 460
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 0) writeonly buffer Counts { uint counts[]; };
layout(constant_id = 0) const uint SIDE = 16;
layout(constant_id = 1) const uint BINS = 192;
// Metres.
const float BIN_WIDTH = 0.0125;
const float FIRST = 0.4;
const float POINT = 0.02;

// Whether the letter is at this place, in a box of 24 x 24 points.
bool is_letter(uvec2 at) { return at.y >= 18u && at.y < 24u || at.x >= 9u && at.x < 15u; }

void main() {
    uint pair = gl_GlobalInvocationID.x;
    if (pair >= SIDE * SIDE) return;
    vec2 wall = (vec2(pair / SIDE, pair % SIDE) + 0.5) / float(SIDE) - 0.5;
    float light[BINS];
    for (uint bin = 0; bin < BINS; ++bin) light[bin] = 0.0;
    for (uint i = 0; i < 24u * 24u; ++i) {
        uvec2 at = uvec2(i % 24u, i / 24u);
        if (!is_letter(at)) continue;
        vec3 point = vec3((vec2(at) - 11.5) * POINT, 0.6);
        float range = distance(point, vec3(wall, 0.0));
        // Two cosines at the letter, and the falloff of both ways.
        float cosine = point.z / range;
        float place = (2.0 * range - FIRST) / BIN_WIDTH;
        if (place >= 0.0 && place < float(BINS)) light[uint(place)] += 2.0 * cosine * cosine / pow(range, 4.0);
    }
    for (uint bin = 0; bin < BINS; ++bin) counts[pair * BINS + bin] = uint(light[bin] + 0.5);
}
