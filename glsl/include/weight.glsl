// Weight of a bin's squared difference: the inverse of the confocal falloff at the bin's centre t, (t / (2
// reference))^4, or the square for retroreflective surfaces, so that near and far surfaces weigh alike (METHOD: the
// accelerated solver).
#include "reflectance.glsl"

float bin_weight(uint bin) {
    // Quotients of uniforms: a loop over bins holds no division.
    float metres = 1.0 / scene.bins_per_metre;
    float inverse = 0.5 / scene.reference;
    // A path before zero has no light in it.
    float scaled = max((scene.t_start + (float(bin) + 0.5) * metres) * inverse, 0.0);
    scaled *= scaled;
    return REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
}
