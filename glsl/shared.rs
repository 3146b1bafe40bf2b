//! Structs and numbers shared by host and kernels. The build generates the GLSL and the Rust side from these tables.
//! Members are 32-bit scalars only, so std140, std430 and `repr(C)` agree on every offset.

/// The scene at one resolution, readable by every kernel.
const SCENE: &[(&str, &str, &str)] = &[
    ("grid_x", "uint", "voxels along x"),
    ("grid_y", "uint", "voxels along y"),
    ("grid_z", "uint", "voxels along z"),
    ("bricks_x", "uint", "bricks of 8 voxels along x"),
    ("bricks_y", "uint", "bricks along y"),
    ("bricks_z", "uint", "bricks along z"),
    ("near_z", "uint", "first z index that may be active"),
    ("pairs", "uint", "laser-sensor pairs P"),
    ("scanned", "uint", "scanned points of the wall"),
    ("others", "uint", "other points of the wall; none in a confocal scan"),
    ("bins", "uint", "gated bins T"),
    ("stride", "uint", "cells from one histogram to the next: its bins and the padding before them"),
    ("capacity", "uint", "voxels that may be active at once"),
    ("touched_capacity", "uint", "voxels that may be touched at once: active ones and the rim"),
    ("origin_x", "float", "x of the centre of voxel (0, 0, 0), metres"),
    ("origin_y", "float", "y of the centre of voxel (0, 0, 0), metres"),
    ("origin_z", "float", "z of the centre of voxel (0, 0, 0), metres"),
    ("pitch_x", "float", "voxel size along x, metres"),
    ("pitch_y", "float", "voxel size along y, metres"),
    ("pitch_z", "float", "voxel size along z, metres"),
    ("t_start", "float", "leading edge of bin 0, metres of path"),
    ("bins_per_metre", "float", "1 / bin width"),
    (
        "place_scale",
        "float",
        "rows of cells per metre of path; in a confocal scan, per metre of the one distance",
    ),
    ("place_offset", "float", "place of path 0 in a row, as a share of its cells"),
    (
        "grain",
        "float",
        "unit of fine distances, metres: a power of two of which no distance has more than 2^11",
    ),
    ("grains_per_metre", "float", "1 / grain"),
    ("bins_per_grain", "float", "bins per grain, the part in 12 bits"),
    ("bins_per_grain_rest", "float", "bins per grain, the rest"),
    ("fine_bins_per_grain", "float", "bins per grain, rounded to fp32"),
    (
        "start_bins",
        "float",
        "bins before the gate, the part that is a multiple of the last bit of bins_per_grain",
    ),
    (
        "start_bins_rest",
        "float",
        "bins before the gate, the rest; plus half a bin where contributions are shared between two bins",
    ),
    ("reference", "float", "length that scales distances in the falloff, metres"),
    ("nearest", "float", "distance to a wall point below which a sample gives no light, metres"),
    ("render_scale", "float", "rendered value per accumulated value"),
    ("loss_scale", "float", "1 / (P T)"),
    ("kernel_bound", "float", "upper bound of every pair's kernel"),
];

/// The paper's solver at one resolution: its objective and its optimiser.
const PAPER: &[(&str, &str, &str)] = &[
    ("seed", "uint", "seed of the random samples"),
    ("l1_scale", "float", "alpha / voxels"),
    ("noise_base", "float", "b * peak"),
    ("noise_span", "float", "lambda * peak"),
    ("learning_rate", "float", "Adam: learning rate"),
    ("decay_over", "float", "iterations over which the learning rate falls to zero; 0 for a constant rate"),
    ("beta1", "float", "Adam: decay of the first moment"),
    ("beta2", "float", "Adam: decay of the second moment"),
    ("epsilon", "float", "Adam: added to the root of the second moment"),
];

/// The objective of the surface solver. Its weights and rates change from fit to fit: they are in `surface_weights`.
const SURFACE: &[(&str, &str, &str)] = &[
    ("slow_decay", "float", "decay per bin of the smoother that the objective's high-pass takes off"),
    ("slow_share", "float", "share of its output that is taken off; 0 without a high-pass"),
    (
        "slow_wrap",
        "float",
        "1 / (1 - slow_decay^(2 bins)): sum of a series over the row and its mirror image",
    ),
];

/// Parameters of one dispatch.
const PUSH: &[(&str, &str, &str)] = &[
    ("iteration", "uint", "iteration of the whole solve, from 0"),
    ("step", "uint", "step of the optimiser since its restart, from 1"),
    (
        "first",
        "uint",
        "first chunk of voxels or first pair of a split dispatch; of some kernels another number",
    ),
    ("last", "uint", "one past the last pair of a split dispatch; of some kernels the number of pixels"),
    ("flags", "uint", "flags or bits of a float, kernel by kernel"),
    (
        "unbias_first",
        "float",
        "Adam of volumes: 1 / (1 - beta1^age), which takes the bias off a first moment",
    ),
    (
        "unbias_second",
        "float",
        "Adam of volumes: 1 / (1 - beta2^age), which takes the bias off a second moment",
    ),
];

/// Parameters of one dispatch of the learned start, in the place of [`PUSH`].
const LEARNED: &[(&str, &str, &str)] = &[
    ("n_x", "uint", "cells along x of what is read; of two layers, of the coarser one"),
    ("n_y", "uint", "cells along y"),
    ("n_z", "uint", "cells along z"),
    ("inputs", "uint", "channels that are read; of some kernels another number"),
    ("more", "uint", "channels that are read after them; of some kernels another number"),
    ("outputs", "uint", "channels that are written; of some kernels another number"),
    ("weights", "uint", "first of the layer's weights"),
];

/// Numbers shared by both sides.
const NUMBERS: &[(&str, u32, &str)] = &[
    ("GROUPS_X", 32768, "workgroups along x before a dispatch continues along y"),
    ("WORKGROUP", 64, "invocations of a workgroup, unless the kernel has a size of its own"),
    ("RESIDUAL_BINS", 16, "cells per invocation of the residual kernel"),
    ("PULSE_RUN", 4, "cells per invocation of the pulse kernel"),
    ("PADDING", 3, "cells before every histogram, and after the last one, that are no bins"),
    (
        "OWNED_CHUNK",
        49152,
        "voxels per dispatch of the owned forward kernel: below the loop limit of lavapipe",
    ),
    ("PAIR_CHUNK", 24576, "pairs per dispatch of the backward kernel: below the loop limit of lavapipe"),
    ("PATIENCE", 16, "contributions outside a window after which it moves"),
    ("OTHERS_FORWARD", 2, "other points that a workgroup of the forward kernel processes together"),
    (
        "OTHERS_BACKWARD",
        4,
        "other points that an invocation of the backward kernels processes together, in registers",
    ),
    ("COUNT_ACTIVE", 0, "index in `counts`: active voxels"),
    ("COUNT_TOUCHED", 1, "index in `counts`: touched voxels, that is active ones and the rim"),
    ("COUNT_PEAK_ALBEDO", 2, "index in `counts`: bits of the largest |albedo| of this iteration"),
    ("COUNT_PEAK_SMOOTH", 3, "index in `counts`: bits of the largest smoothed albedo"),
    (
        "COUNT_LEAST_SMOOTH",
        4,
        "index in `counts`: bits of the least smoothed albedo that fits into the room, 0 if all above the threshold fit",
    ),
    (
        "LEVELS",
        256,
        "length of `levels`: steps of a thirty-second of an octave below the largest smoothed albedo",
    ),
    ("LEVEL_SHIFT", 18, "bits of a float's mantissa below a step of `levels`"),
    ("COUNT_FAULTS", 5, "index in `counts`: bits of the kernels that found a value that is not finite"),
    ("COUNT_ARRIVED", 6, "index in `counts`: workgroups of a dispatch that are done, 0 between dispatches"),
    ("COUNTS", 7, "length of `counts`"),
    ("FAULT_SAMPLE", 1, "fault bit: sample, surface_points. Bits are in the order of a schedule"),
    ("FAULT_FORWARD", 2, "fault bit: forward, found by residual"),
    ("FAULT_RESIDUAL", 4, "fault bit: residual"),
    ("FAULT_NOISE", 8, "fault bit: noise"),
    ("FAULT_BACKWARD", 16, "fault bit: backward, surface_gather"),
    ("FAULT_UPDATE", 32, "fault bit: update, surface_step"),
    ("ARGUMENTS_SAMPLE", 0, "index in `arguments`, in triples: one invocation per active voxel"),
    ("ARGUMENTS_BACKWARD", 1, "index in `arguments`, in triples: backward"),
    ("ARGUMENTS_UPDATE", 2, "index in `arguments`, in triples: one invocation per touched voxel"),
    (
        "ARGUMENTS_FORWARD",
        3,
        "index in `arguments`, in triples: first of forward; there is one for each of its dispatches",
    ),
    ("TRACE_DATA", 0, "index in a row of `trace`: data loss"),
    ("TRACE_L1", 1, "index in a row of `trace`: sum of |albedo|"),
    ("TRACE_ACTIVE", 2, "index in a row of `trace`: active voxels (uint)"),
    ("TRACE_PEAK", 3, "index in a row of `trace`: largest |albedo|"),
    (
        "TRACE_OBJECTIVE",
        4,
        "index in a row of `trace`: the solver's data term, weighted where the solver weights",
    ),
    (
        "TRACE_FAULTS",
        5,
        "index in a row of `trace`: bits of the kernels that found a value that is not finite (uint)",
    ),
    (
        "TRACE_LEAST",
        6,
        "index in a row of `trace`: least smoothed albedo that fitted into the room, 0 if no voxel was left out",
    ),
    ("TRACE_ROW", 7, "length of a row of `trace`"),
    (
        "SURFACE_BEND",
        0,
        "index in `surface_weights`: weight of squared distances of pixels from their neighbours' planes",
    ),
    ("SURFACE_JUMP", 1, "index in `surface_weights`: weight of squared differences of neighbouring albedos"),
    ("SURFACE_DEPTH_RATE", 2, "index in `surface_weights`: first step of depths, metres"),
    ("SURFACE_ALBEDO_RATE", 3, "index in `surface_weights`: first step of albedos"),
    ("SURFACE_ITERATIONS", 4, "index in `surface_weights`: iterations over which steps fall to zero"),
    (
        "SURFACE_LARGEST",
        5,
        "index in `surface_weights`: largest gradient so far by depth; the next word: by albedo",
    ),
    (
        "SURFACE_SPREAD",
        7,
        "index in `surface_weights`: first sigma of the Gaussian that spreads gradients, pixels",
    ),
    ("SURFACE_SPARSE", 8, "index in `surface_weights`: weight of the term that keeps few pixels lit"),
    (
        "SURFACE_FAINT",
        9,
        "index in `surface_weights`: albedo above which more albedo adds little to that term",
    ),
    ("SURFACE_BEND_SHARE", 10, "index in `surface_weights`: SURFACE_BEND over the objective"),
    ("SURFACE_JUMP_SHARE", 11, "index in `surface_weights`: SURFACE_JUMP over the objective"),
    ("SURFACE_FACTOR", 12, "index in `surface_weights`: length of the steps as a share of the longest ones"),
    ("SURFACE_DEPTH_LONGEST", 13, "index in `surface_weights`: SURFACE_DEPTH_RATE of the longest steps"),
    ("SURFACE_ALBEDO_LONGEST", 14, "index in `surface_weights`: SURFACE_ALBEDO_RATE of the longest steps"),
    ("SURFACE_RESTED", 15, "index in `surface_weights`: steps of the schedule until Adam was last at rest"),
    ("SURFACE_ACTION", 16, "index in `surface_weights`: what surface_keep does, one of ACTION_*"),
    (
        "SURFACE_SCALE",
        17,
        "index in `surface_weights`: factor of the albedos that explains most of the data; 0 if none explains any",
    ),
    ("SURFACE_TIMES", 18, "index in `surface_weights`: factor of the albedos of ACTION_SCALE"),
    (
        "SURFACE_BRIGHTEST",
        19,
        "index in `surface_weights`: largest albedo of the pixels where they are placed",
    ),
    ("SURFACE_ENERGY", 20, "index in `surface_weights`: data term of the measurement of all pairs"),
    ("SURFACE_COMPARED", 21, "index in `surface_weights`: that of the pairs whose light gives the scale"),
    (
        "SURFACE_PLACED",
        22,
        "index in `surface_weights`: data term that the pixels leave where they are placed",
    ),
    ("SURFACE_BEFORE", 23, "index in `surface_weights`: that which weighs the prior at first, at most"),
    ("SURFACE_BEST", 24, "index in `surface_weights`: logarithm of the best objective over the energy"),
    ("SURFACE_BEST_LEFT", 25, "index in `surface_weights`: its data term over the energy"),
    ("SURFACE_BEST_LOSS", 26, "index in `surface_weights`: the best objective, prior included"),
    ("SURFACE_BEST_DATA", 27, "index in `surface_weights`: its plain data loss"),
    ("SURFACE_WEIGHTS", 28, "length of `surface_weights`"),
    ("JUDGE_SCALE", 1, "flag of surface_judge: two renderings give the scale of the albedos"),
    ("JUDGE_FIRST", 2, "flag of surface_judge: these are the first iterations of the fit"),
    ("JUDGE_LAST", 4, "flag of surface_judge: these are the last ones: the best state is the result"),
    ("JUDGE_GUESS", 8, "flag of surface_judge: that scale is found once more from there"),
    ("KEEP_TWICE", 1, "flag of surface_keep: doubles the albedos and does nothing else"),
    ("ACTION_NONE", 0, "surface_keep: leaves the state as it is"),
    ("ACTION_SCALE", 1, "surface_keep: multiplies the albedos, and keeps the state"),
    ("ACTION_KEEP", 2, "surface_keep: keeps the state"),
    ("ACTION_RESTORE", 3, "surface_keep: puts the kept state back, and Adam at rest"),
    ("FORWARD_DIRECT", 4, "flag: add straight to the histograms"),
    ("BACKWARD_CONTINUE", 1, "flag: add to the sums of the previous dispatch"),
    ("BACKWARD_FINISH", 2, "flag: this dispatch holds the last pairs"),
    ("LEARNED_SAMPLES", 560, "samples of a pair's light along the path, for the network"),
    ("LEARNED_TAPS", 24, "taps on each side of the filters over these samples"),
    ("LEARNED_BANDS", 5, "filters"),
    (
        "LEARNED_RUN",
        4,
        "cells of an invocation of the network's kernels, and channels that it computes together",
    ),
    ("SCAN_START", 0, "index in `learned_scan`: path at which the first bin begins, walls"),
    ("SCAN_WIDTH", 1, "index in `learned_scan`: width of a bin, walls"),
    ("SCAN_STEP", 2, "index in `learned_scan`: path from sample to sample, walls"),
    ("SCAN_PITCH", 3, "index in `learned_scan`: width of a voxel, walls"),
    ("SCAN_NEAR", 4, "index in `learned_scan`: near end of the box, walls"),
    ("SCAN_TAPS", 5, "index in `learned_scan`: first of the taps of all bands"),
];

/// The block of a solver, for the kernels that need more than the scene.
pub fn block(name: &str) -> Option<String> {
    if name == "learned" {
        return Some(numbers() + &push("Learned", "layer", LEARNED));
    }
    let (title, binding, fields) = match name {
        "paper" => ("Paper", 16, PAPER),
        "surface" => ("Surface", 17, SURFACE),
        _ => return None,
    };
    let mut text = format!("#ifndef BLOCK_{title}\n#define BLOCK_{title}\n");
    text += &format!("layout(std140, set = 0, binding = {binding}) uniform {title} {{\n");
    for (name, kind, _) in fields {
        text += &format!("    {kind} {name};\n");
    }
    Some(text + &format!("}} {name};\n#endif\n"))
}

fn numbers() -> String {
    NUMBERS.iter().map(|(name, value, _)| format!("const uint {name} = {value}u;\n")).collect()
}

fn push(title: &str, name: &str, fields: &[(&str, &str, &str)]) -> String {
    let all: String = fields.iter().map(|(name, kind, _)| format!("    {kind} {name};\n")).collect();
    format!("layout(push_constant) uniform {title} {{\n{all}}} {name};\n")
}

pub fn glsl() -> String {
    let mut text = numbers();
    text += "layout(std140, set = 0, binding = 0) uniform Scene {\n";
    for (name, kind, _) in SCENE {
        text += &format!("    {kind} {name};\n");
    }
    text + "} scene;\n" + &push("Push", "push", PUSH)
}

pub fn rust() -> String {
    let mut text = String::new();
    for (name, value, about) in NUMBERS {
        text += &format!("/// {about}\npub const {name}: u32 = {value};\n");
    }
    for (title, about, fields) in [
        ("SceneData", "The scene at one lateral resolution, as every kernel may read it.", SCENE),
        ("PaperData", "The paper's solver at one resolution: its objective and its optimiser.", PAPER),
        ("SurfaceData", "The objective of the surface solver.", SURFACE),
        ("Push", "Parameters of one dispatch.", PUSH),
        ("LearnedPush", "Parameters of one dispatch of the learned start.", LEARNED),
    ] {
        text += &format!(
            "\n/// {about}\n#[repr(C)]\n#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]\npub struct {title} {{\n"
        );
        for (name, kind, about) in fields {
            let kind = if *kind == "uint" { "u32" } else { "f32" };
            text += &format!("    /// {about}\n    pub {name}: {kind},\n");
        }
        text += "}\n";
    }
    text + "\n"
}
