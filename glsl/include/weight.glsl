// Weight of a bin's squared difference: the inverse of the confocal falloff at the bin's centre t, i.e. (t / (2
// reference))^4, or (t / (2 reference))^2 for retroreflective surfaces, so that near and far surfaces have equal
// weight.
#include "reflectance.glsl"

float bin_weight(uint bin) {
    // Quotients of uniforms, so that a loop over bins contains no division.
    float metres = 1.0 / scene.bins_per_metre;
    float inverse = 0.5 / scene.reference;
    // No light at negative paths.
    float scaled = max((scene.t_start + (float(bin) + 0.5) * metres) * inverse, 0.0);
    scaled *= scaled;
    return REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
}
