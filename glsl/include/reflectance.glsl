// Reflectance models. A pipeline contains the code of one.
const uint COSINE = 0u;          // one cosine, toward the scanned point
const uint LAMBERTIAN = 1u;      // both cosines of the surface and both of the wall
const uint RETROREFLECTIVE = 2u; // no cosine; the falloff is the square root of that of the others
const uint ISOTROPIC = 3u;       // no cosine
layout(constant_id = 21) const uint REFLECTANCE = 0u;
const bool NORMALS = REFLECTANCE <= LAMBERTIAN; // whether the surface has normals
