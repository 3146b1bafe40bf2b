// The two loops that take a solve's time, in C, so that a compiler for NVIDIA's GPUs can be asked what they become:
// forward (glsl/forward.comp, float atomics, no private columns) and the gather of a gradient (glsl/include/slope.glsl), both confocal,
// cosine model, linear binning, flat wall, no voxel on a wall point. Functions have the names of the GLSL that they port
// and the same operations in the same order. tests/kernels/isa.rs holds both against the float64 twins.
//
// Compiled as CUDA for a device, and as C with loops_main.c for the test.

typedef float float4 __attribute__((vector_size(16)));

typedef struct {
    float reference, place_scale, place_offset;
    unsigned stride, bins;
} Scene;

typedef struct {
    float x, y, z;
} Vec3;

typedef struct {
    Vec3 way;
    float inverse, distance, falloff;
} Arm;

typedef struct {
    unsigned cell;
    float share;
} Place;

#define WHOLE 8388608.0f
#define ORIGIN 0x4affffffu
#define PADDING 3u
#define SPLIT 1u

#ifdef __CUDA__
#define KERNEL extern "C" __attribute__((global)) void
#define DEVICE static __attribute__((device)) inline
#define LANE (__nvvm_read_ptx_sreg_ctaid_x() * 64u + __nvvm_read_ptx_sreg_tid_x())
DEVICE float inversesqrt(float x) { return __nvvm_rsqrt_approx_ftz_f(x); }
// A clamp to [0, 1] is a modifier of the instruction before it.
DEVICE float clamped_fma(float a, float b, float c) {
    float d;
    __asm__("fma.rn.ftz.sat.f32 %0, %1, %2, %3;" : "=f"(d) : "f"(a), "f"(b), "f"(c));
    return d;
}
DEVICE unsigned float_bits(float x) { return __nvvm_bitcast_f2i(x); }
DEVICE void atomic_add(float *at, float value) { __nvvm_atom_add_gen_f(at, value); }
// Keeps the compiler from simplifying the pair of sums in place_of, as `precise` does in GLSL.
DEVICE float precise_fma(float a, float b, float c) { return __nvvm_fma_rn_ftz_f(a, b, c); }
#else
#include <math.h>
#include <string.h>
#define KERNEL void
#define DEVICE static
DEVICE float inversesqrt(float x) { return 1.0f / sqrtf(x); }
DEVICE float clamped_fma(float a, float b, float c) { return fminf(fmaxf(a * b + c, 0.0f), 1.0f); }
DEVICE unsigned float_bits(float x) {
    unsigned bits;
    memcpy(&bits, &x, 4);
    return bits;
}
DEVICE void atomic_add(float *at, float value) { *at += value; }
DEVICE float precise_fma(float a, float b, float c) { return fmaf(a, b, c); }
#endif

DEVICE float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

DEVICE Vec3 xyz(float4 v) {
    Vec3 of = {v[0], v[1], v[2]};
    return of;
}

DEVICE unsigned row_of(const Scene *scene, unsigned pair) { return pair * scene->stride - ORIGIN; }

DEVICE int in_bins(const Scene *scene, unsigned cell) {
    return cell - (ORIGIN + PADDING - SPLIT) < scene->bins + SPLIT;
}

DEVICE Place place_of(const Scene *scene, float distance) {
    Place place;
    float row_cells = (float)scene->stride;
    float part = clamped_fma(distance, scene->place_scale, scene->place_offset);
    float whole = precise_fma(part, row_cells, WHOLE - 0.5f);
    place.share = precise_fma(part, row_cells, WHOLE - whole);
    place.cell = float_bits(whole);
    return place;
}

DEVICE Arm arm_to(const Scene *scene, Vec3 point, Vec3 x) {
    Arm arm;
    arm.way.x = point.x - x.x;
    arm.way.y = point.y - x.y;
    arm.way.z = point.z - x.z;
    float d2 = dot(arm.way, arm.way);
    arm.inverse = inversesqrt(d2);
    arm.distance = d2 * arm.inverse;
    float scaled = scene->reference * arm.inverse;
    arm.falloff = scaled * scaled;
    return arm;
}

// One pair over the voxels begin to end. On the device a lane is a pair, `pair` the first of them.
KERNEL forward(
    Scene scene,
    const float4 *__restrict__ sample_points,
    const float4 *__restrict__ sample_normals,
    const float4 *__restrict__ wall,
    float *__restrict__ histograms,
    unsigned pair,
    unsigned begin,
    unsigned end
) {
#ifdef __CUDA__
    pair += LANE;
#endif
    Vec3 point = xyz(wall[pair]);
    unsigned row = row_of(&scene, pair);
    for (unsigned slot = begin; slot < end; ++slot) {
        float4 s = sample_points[slot];
        Arm a = arm_to(&scene, point, xyz(s));
        float value = s[3] * (a.falloff * a.falloff);
        float toward = dot(xyz(sample_normals[slot]), a.way);
        value *= (toward > 0.0f ? toward : 0.0f) * a.inverse;
        Place place = place_of(&scene, a.distance);
        float second = value * place.share;
        if (in_bins(&scene, place.cell)) {
            atomic_add(&histograms[row + place.cell], value - second);
            atomic_add(&histograms[row + place.cell + 1u], second);
        }
    }
}

// The gradient at one voxel over the pairs first to last. On the device a lane is a voxel, `slot` the first of them.
KERNEL gather(
    Scene scene,
    const float4 *__restrict__ sample_points,
    const float4 *__restrict__ sample_normals,
    const float4 *__restrict__ wall,
    const float *__restrict__ residual,
    float4 *__restrict__ gradient,
    unsigned slot,
    unsigned first,
    unsigned last
) {
#ifdef __CUDA__
    slot += LANE;
#endif
    Vec3 x = xyz(sample_points[slot]);
    Vec3 direction = xyz(sample_normals[slot]);
    Vec3 aside = {0.0f, 0.0f, 0.0f};
    unsigned row = row_of(&scene, first);
    for (unsigned pair = first; pair < last; ++pair) {
        Arm a = arm_to(&scene, xyz(wall[pair]), x);
        Place place = place_of(&scene, a.distance);
        float low = residual[row + place.cell];
        float rise = residual[row + place.cell + 1u] - low;
        float r = low + place.share * rise;
        r *= a.falloff * a.falloff;
        float along = dot(direction, a.way) > 0.0f ? r * a.inverse : 0.0f;
        aside.x += along * a.way.x;
        aside.y += along * a.way.y;
        aside.z += along * a.way.z;
        row += scene.stride;
    }
    float4 sum = {dot(direction, aside), aside.x, aside.y, aside.z};
    gradient[slot] = sum;
}
