// The surface as a height field: pixels of the lateral maps, each with a depth and an albedo, and what neighbouring
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
const float NARROWED = 0.6;       // share of the iterations after which a pixel goes by its own gradient alone
const float NARROW = 0.35;        // pixels: of such a Gaussian nothing but its middle is left
const float SURFACE_LEVEL = 1e-3; // weight of no slope at all, where neighbours count up to one each

// How much pixels so far apart whose depths differ by `step` have in common: less the farther they are, next to nothing
// across an edge of the surface. `narrow` is half of the inverse square of a Gaussian's sigma, pixels.
float bond(ivec2 d, float narrow, float step) {
    float steep = step / (SURFACE_EDGE * pixel_size());
    steep *= steep;
    return exp(-narrow * float(d.x * d.x + d.y * d.y)) / (1.0 + steep * steep);
}

// And the pixel's k-th neighbour.
float bond(uint k, float step) { return bond(AROUND[k], 0.5, step); }

// What the depths at the last renewal of bonds differ by, from one pixel to another.
float step_between(uint pixel, uint other) { return uintBitsToFloat(pixels[other].z) - uintBitsToFloat(pixels[pixel].z); }

// Gaussian, in pixels, over which a gradient is spread at step `number` (from 1) of so many; 0 for none.
float spread_at(float first, uint number, float iterations) {
    float sigma = first * (1.0 - float(number - 1u) / iterations / NARROWED);
    return sigma < NARROW ? 0.0 : sigma;
}

// Pixels to each side that it reaches, two sigmas; a sigma that rounding makes a little larger reaches no farther.
int reach_of(float sigma) { return int(ceil(2.0 * sigma - 1e-3)); }

// Depths that the surface may have: those of the grid.
vec2 depth_limits() {
    return scene.origin_z + scene.pitch_z * vec2(float(scene.near_z), float(scene.grid_z - 1u));
}

// What a pixel with such slopes faces.
vec3 facing(vec2 slope) { return vec3(slope, -1.0) * inversesqrt(1.0 + dot(slope, slope)); }

// How much surface it holds, over its own area. Surfaces that show the same to all sides are told of as the wall sees them.
#define stretch(slope) (NORMALS ? length(vec3(slope, 1.0)) : 1.0)

// Of its points (POINTS: four, or one where a pixel is small) the k-th, from its centre, metres.
vec2 part(uint k, uint points) {
    return points == 1u ? vec2(0.0) : (vec2(float(k >> 1), float(k & 1u)) - 0.5) * 0.5 * pixel_pitch();
}
