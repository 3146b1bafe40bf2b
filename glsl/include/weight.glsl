// Weight of a bin's squared difference: the inverse of the confocal falloff at the bin's centre t, that is
// (t / (2 reference))^4, or (t / (2 reference))^2 for retroreflective surfaces. Near and far surfaces then weigh alike.
#include "reflectance.glsl"

float bin_weight(uint bin) {
    // Quotients of uniforms, so a loop over bins contains no division.
    float metres = 1.0 / scene.bins_per_metre;
    float inverse = 0.5 / scene.reference;
    // A path below zero carries no light.
    float scaled = max((scene.t_start + (float(bin) + 0.5) * metres) * inverse, 0.0);
    scaled *= scaled;
    return REFLECTANCE == RETROREFLECTIVE ? scaled : scaled * scaled;
}
