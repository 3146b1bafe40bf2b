// From raw variables to albedo and normal: albedo = ELU(a), normal = normalize(tanh(q) + (0, 0, -1)).

float elu(float a) { return a > 0.0 ? a : exp(a) - 1.0; }

// tanh(10) is 1 in fp32; beyond 10 some drivers overflow.
vec3 bounded_tanh(vec3 q) { return tanh(clamp(q, -10.0, 10.0)); }

// The normal before normalization, and its length, bounded from below to keep the division finite.
vec3 toward_wall(vec3 q) { return bounded_tanh(q) + vec3(0.0, 0.0, -1.0); }
float safe_length(vec3 u) { return max(length(u), 1e-12); }

// From dLoss / d(albedo, normal) to dLoss / d(a, q) at a sample. The sample's own values suffice: ELU'(a) is 1 or
// albedo + 1, and tanh(q) is length * normal - (0, 0, -1).
vec4 through_surface(vec4 g, float albedo, vec3 normal, float length_u) {
    vec3 th = normal * length_u - vec3(0.0, 0.0, -1.0);
    vec3 across = (g.yzw - normal * dot(normal, g.yzw)) / length_u;
    return vec4(g.x * (albedo > 0.0 ? 1.0 : albedo + 1.0), across * max(1.0 - th * th, 0.0));
}
