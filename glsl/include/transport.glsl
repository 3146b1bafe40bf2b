// What a surface element at x with unit normal n gives to a confocal pair at l: the bin position of its
// path, the falloff and the cosine toward the wall point (METHOD: cosine model).

struct Kernel {
    vec3 toward;   // unit, sample to wall point
    float cosine;  // n . toward
    float falloff; // (reference / r)^4; 0 for a degenerate pair
    float bin;     // path in bins from the leading edge of bin 0
};

Kernel confocal_kernel(vec3 wall, vec3 x, vec3 n) {
    Kernel k;
    vec3 d = wall - x;
    float d2 = dot(d, d);
    // A sample on a wall point has no direction; its kernel is defined as nothing.
    bool degenerate = d2 < scene.nearest * scene.nearest || d2 == 0.0;
    float inverse = degenerate ? 0.0 : inversesqrt(d2);
    k.toward = d * inverse;
    k.cosine = dot(n, k.toward);
    float scaled = scene.reference * inverse;
    scaled *= scaled;
    k.falloff = scaled * scaled;
    k.bin = (2.0 * d2 * inverse - scene.t_start) * scene.bins_per_metre;
    return k;
}

// The rest of the Lambertian model beside n . toward, for a direction n of any length: the second cosine of the
// surface, taken from n itself, and both of the wall's, whose normal is (0, 0, 1). The vector solver holds it
// constant in its gradient (lagged), so that the model stays linear in n.
float lambertian_rest(Kernel k, vec3 n) {
    float across_wall = max(-k.toward.z, 0.0);
    return max(k.cosine, 0.0) / max(length(n), 1e-30) * across_wall * across_wall;
}
