// The surface as a height field: pixels of the lateral maps, each with a depth and an amplitude, and what neighbouring
// pixels have to do with each other. Needs the buffers pixels and pixel_of. A pixel's neighbours are numbered 0 to 7; from
// the k-th, the pixel itself is the (7 - k)-th.

const ivec2 AROUND[8] = ivec2[8](
    ivec2(-1, -1), ivec2(-1, 0), ivec2(-1, 1), ivec2(0, -1), ivec2(0, 1), ivec2(1, -1), ivec2(1, 0), ivec2(1, 1)
);

ivec2 pixel_xy(uint pixel) { return ivec2(pixels[pixel].x / scene.grid_y, pixels[pixel].x % scene.grid_y); }

// The number of the pixel there, NOWHERE if it is no part of the surface.
uint pixel_at(ivec2 at) {
    if (any(lessThan(at, ivec2(0))) || at.x >= int(scene.grid_x) || at.y >= int(scene.grid_y)) return NOWHERE;
    return pixel_of[uint(at.x) * scene.grid_y + uint(at.y)];
}

// And of a pixel's k-th neighbour.
uint neighbour(uint pixel, uint k) { return pixel_at(pixel_xy(pixel) + AROUND[k]); }

// Metres between neighbouring pixels.
vec2 pixel_pitch() { return vec2(scene.pitch_x, scene.pitch_y); }
float pixel_size() { return sqrt(scene.pitch_x * scene.pitch_y); }

const float SURFACE_EDGE = 2.5;   // slope across which neighbours are half as bound
const float SURFACE_LEVEL = 1e-3; // weight of no slope at all, where neighbours count up to one each

// How much neighbours whose depths differ by `step` have in common: less for those at a corner, next to nothing across an
// edge of the surface.
float bond(uint k, float step) {
    ivec2 d = AROUND[k];
    float steep = step / (SURFACE_EDGE * pixel_size());
    steep *= steep;
    return exp(-0.5 * float(d.x * d.x + d.y * d.y)) / (1.0 + steep * steep);
}

// Depths that the surface may have: those of the grid.
vec2 depth_limits() {
    return scene.origin_z + scene.pitch_z * vec2(float(scene.near_z), float(scene.grid_z - 1u));
}

// What a pixel with such slopes faces.
vec3 facing(vec2 slope) { return vec3(slope, -1.0) * inversesqrt(1.0 + dot(slope, slope)); }

// Of its four points the k-th, from its centre, metres.
vec2 quarter(uint k) { return (vec2(float(k >> 1), float(k & 1u)) - 0.5) * 0.5 * pixel_pitch(); }
