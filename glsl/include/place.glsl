// Where a path falls among the bins. Needs SPLIT and transport.glsl.
// In fp32 a path of so many bins is uncertain by some 2^-24 of them. With FINE it comes in grains, a power of two of
// metres: bins per whole grain and bins before the gate are split so that their multiples and differences are exact,
// and only what is within a grain or two is rounded.

struct Place {
    int bin;     // the bin it falls in; with SPLIT the first of the two whose centres bracket it
    float share; // with SPLIT: of the second of the two
};

Place place_of(float distance, float rest) {
    float whole = 0.0;
    float position = (distance - scene.t_start) * scene.bins_per_metre;
    if (FINE != 0u) {
        precise float coarse = distance * scene.bins_per_grain - scene.start_bins;
        whole = floor(coarse);
        precise float within = distance * scene.bins_per_grain_rest + (rest * scene.fine_bins_per_grain - scene.start_bins_rest);
        position = (coarse - whole) + within;
    }
    if (SPLIT != 0u) position -= 0.5;
    float low = floor(position);
    return Place(int(whole + low), position - low);
}

// Of the two arms of a pair.
Place place_of(Arm a, Arm b) { return place_of(a.distance + b.distance, a.rest + b.rest); }
