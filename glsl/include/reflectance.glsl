// How the hidden surface sends light back (METHOD: light transport). A variant holds the code of one of these.
const uint COSINE = 0u;          // one cosine, toward the scanned point
const uint LAMBERTIAN = 1u;      // both cosines of the surface and both of the wall
const uint RETROREFLECTIVE = 2u; // no cosine; the falloff is the square root of the others'
const uint ISOTROPIC = 3u;       // no cosine
layout(constant_id = 21) const uint REFLECTANCE = 0u;
const bool NORMALS = REFLECTANCE <= LAMBERTIAN; // surfaces have a direction
