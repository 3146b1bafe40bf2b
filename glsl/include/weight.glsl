// Weight of a bin's squared difference: the inverse of the confocal falloff at the bin's centre t, (t / (2
// reference))^4, or the square for retroreflective surfaces, so that near and far surfaces weigh alike (METHOD: the
// accelerated solver).
#include "reflectance.glsl"

float bin_weight(uint bin) {
    float t = scene.t_start + (float(bin) + 0.5) / scene.bins_per_metre;
    // A path before zero has no light in it.
    float scaled = max(t / (2.0 * scene.reference), 0.0);
    scaled *= scaled;
    return REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
}
