//! The structs and numbers that host and kernels share, in one place; both sides are written from here.
//! Members are 32-bit scalars only, so std140, std430 and `repr(C)` agree on every offset.

/// What every kernel may know of the scene at one lateral resolution.
const SCENE: &[(&str, &str, &str)] = &[
    ("grid_x", "uint", "voxels along x"),
    ("grid_y", "uint", "voxels along y"),
    ("grid_z", "uint", "voxels along z"),
    ("bricks_x", "uint", "bricks of 8 voxels along x"),
    ("bricks_y", "uint", "bricks along y"),
    ("bricks_z", "uint", "bricks along z"),
    ("near_z", "uint", "first z index that may be active"),
    ("pairs", "uint", "laser-sensor pairs P"),
    ("scanned", "uint", "wall points of the scanned side"),
    ("others", "uint", "wall points of the other side; none in a confocal scan"),
    ("bins", "uint", "gated bins T"),
    ("stride", "uint", "cells from one histogram to the next: its bins and the padding before them"),
    ("seed", "uint", "of the random samples"),
    ("capacity", "uint", "voxels that may be active at once"),
    ("touched_capacity", "uint", "voxels that may be touched at once: active ones and their neighbours"),
    ("origin_x", "float", "centre of voxel (0, 0, 0), metres"),
    ("origin_y", "float", ""),
    ("origin_z", "float", ""),
    ("pitch_x", "float", "voxel size, metres"),
    ("pitch_y", "float", ""),
    ("pitch_z", "float", ""),
    ("t_start", "float", "leading edge of bin 0, metres of path"),
    ("bins_per_metre", "float", "1 / bin width"),
    ("place_scale", "float", "rows of cells per metre of path; of a confocal pair's distance"),
    ("place_offset", "float", "place of no path at all in a row, as a part of its cells"),
    ("grain", "float", "a power of two, 2^-11 of no distance's length or more, metres"),
    ("grains_per_metre", "float", "its inverse"),
    ("bins_per_grain", "float", "in 12 bits"),
    ("bins_per_grain_rest", "float", "what those leave"),
    ("fine_bins_per_grain", "float", "both, rounded to fp32"),
    (
        "start_bins",
        "float",
        "bins before the gate, as far as they are a multiple of the last of those 12 bits",
    ),
    ("start_bins_rest", "float", "the others, and half a bin where contributions are shared between two"),
    ("reference", "float", "length that scales r in the falloff, metres"),
    ("nearest", "float", "a sample nearer to a wall point than this gives nothing, metres"),
    ("render_scale", "float", "rendered value per accumulated value"),
    ("loss_scale", "float", "1 / (P T)"),
    ("l1_scale", "float", "alpha / voxels"),
    ("noise_base", "float", "b * peak"),
    ("noise_span", "float", "lambda * peak"),
    ("learning_rate", "float", "Adam"),
    ("decay_over", "float", "iterations over which the learning rate falls to nothing, 0 for never"),
    ("beta1", "float", "Adam"),
    ("beta2", "float", ""),
    ("epsilon", "float", ""),
    ("cone", "float", "largest |v_xy| / |v_z| of a surface vector"),
    ("variance", "float", "photon variance per measured value"),
    ("variance_floor", "float", "variance of an empty bin"),
    ("noise_factor", "float", "kappa: weight of the group term in standard deviations"),
    ("roughness", "float", "weight of the roughness term"),
    ("kernel_bound", "float", "no pair's kernel is larger than this"),
];

/// What changes from dispatch to dispatch.
const PUSH: &[(&str, &str, &str)] = &[
    ("iteration", "uint", "of the whole solve, from 0"),
    ("step", "uint", "of the optimiser since its restart, from 1"),
    ("first", "uint", "first voxel chunk, pair or set of a split dispatch"),
    ("last", "uint", "one past the last pair of a split dispatch"),
    ("flags", "uint", "kernel by kernel"),
];

/// Numbers both sides use.
const NUMBERS: &[(&str, u32, &str)] = &[
    ("GROUPS_X", 32768, "groups along x before a dispatch goes on along y"),
    ("WORKGROUP", 64, "invocations of a kernel without a size of its own"),
    ("RESIDUAL_BINS", 16, "cells of an invocation of the residual kernel"),
    ("PULSE_RUN", 4, "cells of an invocation of the pulse kernel"),
    ("PADDING", 3, "cells before every histogram, and after the last one, that are no bins"),
    (
        "OWNED_CHUNK",
        32768,
        "voxels per dispatch of the owned forward kernel: below the loop limit of lavapipe",
    ),
    ("PAIR_CHUNK", 24576, "pairs per dispatch of the backward kernel, for the same reason"),
    ("PATIENCE", 16, "contributions beside a private column after which it moves"),
    ("OTHERS_FORWARD", 4, "other points that a workgroup of the forward kernel takes at once"),
    ("OTHERS_BACKWARD", 4, "the same for an invocation of the backward kernels, in registers"),
    ("COUNT_ACTIVE", 0, "index in `counts`: active voxels"),
    ("COUNT_TOUCHED", 1, "index in `counts`: voxels that a sample may read, active ones and the rim"),
    ("COUNT_PEAK_ALBEDO", 2, "index in `counts`: bits of the largest |albedo| of this iteration"),
    ("COUNT_PEAK_SMOOTH", 3, "index in `counts`: bits of the largest smoothed albedo"),
    (
        "COUNT_LEAST_SMOOTH",
        4,
        "index in `counts`: bits of the least smoothed albedo that there is room for, 0 for all above the threshold",
    ),
    (
        "LEVELS",
        256,
        "steps of a thirty-second of an octave, below the largest smoothed albedo, in which voxels are counted",
    ),
    ("LEVEL_SHIFT", 18, "bits of a float's mantissa below such a step"),
    ("COUNT_FAULTS", 5, "index in `counts`: which kernels gave a value that is not finite"),
    ("COUNTS", 6, "length of `counts`"),
    ("FAULT_BOUND", 1, "bit of the faults, in the order of a schedule: bound"),
    ("FAULT_SAMPLE", 2, "sample, extrapolate"),
    ("FAULT_FORWARD", 4, "forward"),
    ("FAULT_RESIDUAL", 8, "residual"),
    ("FAULT_NOISE", 16, "noise"),
    ("FAULT_BACKWARD", 32, "backward, the gradient of step"),
    ("FAULT_UPDATE", 64, "update, the iterate of step"),
    ("ARGUMENTS_SAMPLE", 0, "index in `arguments`, in triples"),
    ("ARGUMENTS_BACKWARD", 1, ""),
    ("ARGUMENTS_UPDATE", 2, ""),
    ("ARGUMENTS_FORWARD", 3, "first of the forward triples: one, or one per owned chunk"),
    ("TRACE_DATA", 0, "index in a row of `trace`: data loss"),
    ("TRACE_L1", 1, "index in a row of `trace`: sum of |albedo|"),
    ("TRACE_ACTIVE", 2, "index in a row of `trace`: active voxels (uint)"),
    ("TRACE_PEAK", 3, "index in a row of `trace`: largest |albedo|"),
    (
        "TRACE_OBJECTIVE",
        4,
        "index in a row of `trace`: the solver's data term, weighted where the solver weights",
    ),
    ("TRACE_RESTARTS", 5, "index in a row of `trace`: restarts of the momentum so far"),
    (
        "TRACE_FAULTS",
        6,
        "index in a row of `trace`: which kernels have given a value that is not finite (uint)",
    ),
    (
        "TRACE_LEAST",
        7,
        "index in a row of `trace`: the least smoothed albedo that there was room for, 0 if nothing was left out",
    ),
    ("TRACE_ROW", 8, "length of a row of `trace`"),
    ("MOMENTUM_T", 0, "index in `momentum`: FISTA's t"),
    ("MOMENTUM_BETA", 1, "index in `momentum`: extrapolation of the next iteration"),
    ("MOMENTUM_OBJECTIVE", 2, "index in `momentum`: objective of the iteration before"),
    ("MOMENTUM_RESTARTS", 3, "index in `momentum`: restarts so far"),
    ("MOMENTUM_SHARE", 4, "index in `momentum`: share of the bound D that a step divides by"),
    ("MOMENTUM", 5, "length of `momentum`"),
    (
        "SURFACE_BEND",
        0,
        "index in `surface_weights`: of how far pixels are off their neighbours' planes, squared",
    ),
    ("SURFACE_JUMP", 1, "index in `surface_weights`: of how much neighbouring albedos differ, squared"),
    ("SURFACE_DEPTH_RATE", 2, "index in `surface_weights`: first step of depths, metres"),
    ("SURFACE_ALBEDO_RATE", 3, "index in `surface_weights`: first step of albedos"),
    ("SURFACE_ITERATIONS", 4, "index in `surface_weights`: iterations over which steps fall to nothing"),
    (
        "SURFACE_LARGEST",
        5,
        "index in `surface_weights`: largest gradients of depth and, next to it, of albedo so far",
    ),
    ("SURFACE_SMOOTH", 7, "index in `surface_weights`: Gaussian under which albedos are seen, pixels"),
    (
        "SURFACE_SPREAD",
        8,
        "index in `surface_weights`: Gaussian over which gradients are averaged at first, pixels",
    ),
    ("SURFACE_SPARSE", 9, "index in `surface_weights`: of how many pixels are lit, for a faint one's albedo"),
    ("SURFACE_FAINT", 10, "index in `surface_weights`: albedo from which on more of it costs little more"),
    ("SURFACE_WEIGHTS", 11, "length of `surface_weights`"),
    ("FORWARD_DIRECT", 4, "flag: add straight to the histograms"),
    ("BACKWARD_CONTINUE", 1, "flag: add to the sums of the dispatch before"),
    ("BACKWARD_FINISH", 2, "flag: this dispatch holds the last pairs"),
];

pub fn glsl() -> String {
    let mut text = String::new();
    for (name, value, _) in NUMBERS {
        text += &format!("const uint {name} = {value}u;\n");
    }
    text += "layout(std140, set = 0, binding = 0) uniform Scene {\n";
    for (name, kind, _) in SCENE {
        text += &format!("    {kind} {name};\n");
    }
    text += "} scene;\nlayout(push_constant) uniform Push {\n";
    for (name, kind, _) in PUSH {
        text += &format!("    {kind} {name};\n");
    }
    text + "} push;\n"
}

pub fn rust() -> String {
    let mut text = String::new();
    for (name, value, about) in NUMBERS {
        let about = if about.is_empty() { "see the one above" } else { about };
        text += &format!("/// {about}\npub const {name}: u32 = {value};\n");
    }
    for (title, about, fields) in [
        ("SceneData", "What every kernel may know of the scene at one lateral resolution.", SCENE),
        ("Push", "What changes from dispatch to dispatch.", PUSH),
    ] {
        text += &format!(
            "\n/// {about}\n#[repr(C)]\n#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]\npub struct {title} {{\n"
        );
        for (name, kind, about) in fields {
            let kind = if *kind == "uint" { "u32" } else { "f32" };
            let about = if about.is_empty() { "see the one above" } else { about };
            text += &format!("    /// {about}\n    pub {name}: {kind},\n");
        }
        text += "}\n";
    }
    text + "\n"
}
