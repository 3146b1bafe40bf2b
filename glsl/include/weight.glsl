// Weight of a bin's squared difference: (t / (2 reference))^weight_power at the bin's centre t. With the power of the
// falloff, 4 or 2, near and far surfaces weigh alike (METHOD: the accelerated solver).
float bin_weight(uint bin) {
    float t = scene.t_start + (float(bin) + 0.5) / scene.bins_per_metre;
    // A path before zero has no light in it.
    float scaled = max(t / (2.0 * scene.reference), 0.0);
    scaled *= scaled;
    return scene.weight_power > 3.0 ? scaled * scaled : scaled;
}
