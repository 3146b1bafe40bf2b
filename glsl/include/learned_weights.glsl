layout(std430, set = 0, binding = 1) readonly buffer LearnedWeights { uint learned_weights[]; };

float weight(uint i) {
    vec2 both = unpackHalf2x16(learned_weights[i >> 1]);
    return (i & 1u) == 0u ? both.x : both.y;
}
