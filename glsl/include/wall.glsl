// The wall's points. Needs transport.glsl and the buffer wall.

Arm arm_at(uint point, vec3 x) {
    vec3 normal = CURVED != 0u ? wall[scene.scanned + scene.others + point].xyz : vec3(0.0, 0.0, 1.0);
    return arm_to(wall[point].xyz, normal, x);
}
