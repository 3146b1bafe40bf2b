// Weight of a bin's squared difference: (t / (2 reference))^4 at the bin's centre t, the inverse of the confocal
// falloff, so that near and far surfaces weigh alike (METHOD: the accelerated solver); the square for retroreflective
// surfaces, whose falloff is the root. Where a pair has two points, no falloff at path t is smaller than the confocal
// one, so none weighs too much.
#include "reflectance.glsl"

float bin_weight(uint bin) {
    float t = scene.t_start + (float(bin) + 0.5) / scene.bins_per_metre;
    float scaled = t / (2.0 * scene.reference);
    scaled *= scaled;
    return REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
}
