// Samples of active voxels, read by renderings for every pair.

layout(std430, set = 0, binding = 2) readonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 3) readonly buffer SampleNormals { vec4 sample_normals[]; };
vec4 point_at(uint slot) { return sample_points[slot]; }
vec3 normal_at(uint slot) { return sample_normals[slot].xyz; }
