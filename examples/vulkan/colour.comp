// The program's own pass: colours the depths that were found, near red and far blue, as bright as the albedo. One invocation
// colours one pixel of a picture whose rows begin at the top.
#version 460
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 0) readonly buffer Maps { float maps[]; };
layout(std430, set = 0, binding = 1) writeonly buffer Picture { uint picture[]; };
layout(constant_id = 0) const uint SIDE = 32;

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint pixels = SIDE * SIDE;
    if (index >= pixels) return;
    // The scene as it is seen from the wall has +x on the left.
    uint pixel = (SIDE - 1u - index % SIDE) * SIDE + (SIDE - 1u - index / SIDE);
    float depth = maps[pixels + pixel];
    bool is_surface = maps[5u * pixels + pixel] == 1.0;
    float far = clamp((depth - 0.5) / 0.2, 0.0, 1.0);
    vec3 colour = is_surface ? vec3(1.0 - far, 0.3, far) : vec3(0.0);
    picture[index] = packUnorm4x8(vec4(colour, 1.0));
}
