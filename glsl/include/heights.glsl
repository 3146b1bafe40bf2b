// The surface as height fields: each pixel of the lateral maps has a depth, an albedo, and bonds to its neighbours.
// Two surfaces behind each other form two layers: the columns of the second follow those of the first, and neighbours
// are in the same layer. Needs the buffers pixels and pixel_of. Without a pixel, the depth of a column for the bonds is so large that none is left (FAR in
// solve/surface/schedule.rs). Neighbours are numbered 0 to 7; seen from neighbour
// k, the pixel itself is neighbour 7 - k.

const ivec2 AROUND[8] = ivec2[8](
    ivec2(-1, -1), ivec2(-1, 0), ivec2(-1, 1), ivec2(0, -1), ivec2(0, 1), ivec2(1, -1), ivec2(1, 0), ivec2(1, 1)
);

// Columns before those of the pixel's layer.
uint layer_start(uint pixel) {
    uint layer = scene.grid_x * scene.grid_y;
    return pixels[pixel] < layer ? 0u : layer;
}

// A pixel's column in its layer, which is its index in the maps.
uint pixel_column(uint pixel) { return pixels[pixel] - layer_start(pixel); }

ivec2 pixel_xy(uint pixel) {
    uint column = pixel_column(pixel);
    return ivec2(column / scene.grid_y, column % scene.grid_y);
}

// Column of a lateral position of the layer that starts at column `layer`, or NOWHERE.
uint column_at(uint layer, ivec2 at) {
    if (any(lessThan(at, ivec2(0))) || at.x >= int(scene.grid_x) || at.y >= int(scene.grid_y)) return NOWHERE;
    return layer + uint(at.x) * scene.grid_y + uint(at.y);
}

// Column of a pixel's k-th neighbour, or NOWHERE outside the maps.
uint column_beside(uint pixel, uint k) { return column_at(layer_start(pixel), pixel_xy(pixel) + AROUND[k]); }

// Metres between neighbouring pixels.
vec2 pixel_pitch() { return vec2(scene.pitch_x, scene.pitch_y); }
float pixel_size() { return sqrt(scene.pitch_x * scene.pitch_y); }

const float SURFACE_EDGE = 2.5;   // slope between two pixels at which their bond is one half
const float NARROWED = 0.6;       // share of the iterations after which a pixel uses its own gradient only
const float NARROW = 0.35;        // sigma in pixels below which a Gaussian has no weight beyond its centre
const float SURFACE_LEVEL = 1e-3; // weight of zero slope; each neighbour has a weight of at most one

// Bond of two pixels, 0 to 1. `d` is their offset, pixels; `step` the difference of their depths, metres. Decreases
// with distance and almost vanishes across an edge of the surface. `narrow` = 1 / (2 sigma^2), sigma in pixels.
float bond(ivec2 d, float narrow, float step) {
    float steep = step / (SURFACE_EDGE * pixel_size());
    steep *= steep;
    return exp(-narrow * float(d.x * d.x + d.y * d.y)) / (1.0 + steep * steep);
}

// Bond of a pixel and its k-th neighbour.
float bond(uint k, float step) { return bond(AROUND[k], 0.5, step); }

// Sigma in pixels of the Gaussian that averages gradients at step `number` (from 1); 0 for none. `first`: at step 1.
float spread_at(float first, uint number, float iterations) {
    float sigma = first * (1.0 - float(number - 1u) / iterations / NARROWED);
    return sigma < NARROW ? 0.0 : sigma;
}

// Half-width of a Gaussian in pixels: two sigmas. The margin keeps rounding of sigma from adding a pixel.
int reach_of(float sigma) { return int(ceil(2.0 * sigma - 1e-3)); }

// Least and largest depth of the surface, metres: the limits of the grid.
vec2 depth_limits() {
    return scene.origin_z + scene.pitch_z * vec2(float(scene.near_z), float(scene.grid_z - 1u));
}

// Unit normal, toward the wall, of a pixel with these slopes.
vec3 facing(vec2 slope) { return vec3(slope, -1.0) * inversesqrt(1.0 + dot(slope, slope)); }

// Surface area of a pixel over its lateral area. Without normals, albedo is per lateral area, and this is 1.
#define stretch(slope) (NORMALS ? length(vec3(slope, 1.0)) : 1.0)

// Offset of a pixel's k-th point from its centre, metres. A pixel has four points, or one if small.
vec2 part(uint k, uint points) {
    return points == 1u ? vec2(0.0) : (vec2(float(k >> 1), float(k & 1u)) - 0.5) * 0.5 * pixel_pitch();
}
