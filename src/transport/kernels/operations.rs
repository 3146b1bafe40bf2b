//! What the compiled modules do that drivers compute differently, and why each use is safe. A new use needs a row.

use std::collections::BTreeSet;
use std::path::Path;

use super::KERNELS;
use super::tests::words;

/// Instructions of GLSL.std.450 in which drivers were found wrong.
const INSTRUCTIONS: &[(u32, &str)] = &[
    (16, "asin"),         // lavapipe: four digits
    (17, "acos"),         // lavapipe: four digits
    (21, "tanh"),         // SwiftShader: NaN from 89 on
    (26, "pow"),          // lavapipe: another last bit where it is folded
    (28, "log"),          // SwiftShader: finite at zero
    (30, "log2"),         // SwiftShader: finite at zero
    (58, "packHalf2x16"), // SwiftShader: NaN beyond 65,536, spills into the other half beyond 131,072
];

/// Operations in which drivers were found wrong or may choose an order.
const OPERATIONS: &[(u32, &str)] = &[
    (138, "remainder of signed integers"), // lavapipe: computes % as remainder
    (139, "modulus of signed integers"),   // lavapipe: the same
    (140, "remainder of floats"),
    (141, "modulus of floats"),
];

/// OpGroupAll to OpGroupSMax, OpGroupNonUniformElect to OpGroupNonUniformQuadSwap: of a subgroup, whose size and order of sums differ
/// (lavapipe: LP_NATIVE_VECTOR_WIDTH).
const SUBGROUPS: [std::ops::RangeInclusive<u32>; 2] = [261..=271, 333..=366];

/// (module, operation, range of its argument).
const USES: &[(&str, &str, &str)] = &[
    ("extract", "tanh", "clamped to ±10 by bounded_tanh"),
    ("learned_head", "log", "at least 1: exp(0) of the largest logit is one of the summands"),
    ("sample", "tanh", "clamped to ±10 by bounded_tanh"),
    (
        "surface_combine",
        "log",
        "at least 1: surface_step clamps albedo to at least 0, and the faint albedo is a share of the brightest",
    ),
    ("surface_judge", "log", "at least LEAST"),
];

/// (source in glsl/, loops, turns at most), without [[unroll]]. lavapipe ends an invocation after 65,535 turns in all.
const LOOPS: &[(&str, usize, &str)] = &[
    ("carry.comp", 1, "4"),
    ("compact_count.comp", 1, "16"),
    ("compact_scan.comp", 3, "bricks / 64 + 7: 65,535 at 2^31 voxels"),
    ("compact_scatter.comp", 2, "15 + 32"),
    ("double_domain.comp", 1, "32"),
    ("extract.comp", 1, "voxels deep: LONGEST_LOOP"),
    ("filter.comp", 1, "bins: LONGEST_LOOP"),
    ("forward.comp", 1, "chunk, and moves of columns: Tuning::turns"),
    ("forward_owned.comp", 1, "chunk: Tuning::turns"),
    ("forward_product.comp", 7, "chunk, other points, moves of columns: Tuning::turns"),
    ("gaussian.comp", 1, "2001: the paper's options limit smooth_sigma * smooth_truncate"),
    ("include/arguments.glsl", 1, "FORWARD_SETS"),
    ("include/chunks.glsl", 1, "32: halves"),
    ("include/finish.glsl", 2, "losses / 2048 + samples / 4096: 65,535 at 2^26 rows and 2^27 samples"),
    ("include/gather.glsl", 5, "2 * PAIR_CHUNK"),
    ("include/pixel_lanes.glsl", 1, "lanes of a pixel: 8"),
    ("include/pull.glsl", 1, "8"),
    ("include/seats.glsl", 1, "slices: lanes of a workgroup"),
    ("include/slices.glsl", 1, "32: halves"),
    ("include/sums.glsl", 1, "32: halves"),
    ("include/window.glsl", 2, "WINDOW per move: Tuning::turns"),
    ("initialise.comp", 1, "32"),
    ("learned_activate.comp", 1, "LEARNED_RUN"),
    ("learned_bands.comp", 4, "bins + 10 + 9 * 50: LONGEST_LOOP + 460"),
    ("learned_convolve.comp", 5, "channels * (27 + 27 / 64), of a fixed network"),
    ("learned_head.comp", 5, "(2 + features / 32) * voxels deep, of a fixed network"),
    ("learned_moments.comp", 3, "partial sums / 64 of the fixed grid of the network"),
    ("learned_project.comp", 4, "1.05 * learned::MOST_PAIRS"),
    ("learned_resize.comp", 1, "channels of a fixed network"),
    ("levels.comp", 3, "LEVELS / lanes each"),
    ("limit_copy.comp", 1, "elements / 2^18: 65,535 at 2^34 elements"),
    ("limit_fma.comp", 1, "1024: the turns of a probe"),
    ("limit_scattered_atomic.comp", 1, "64: the turns of a probe"),
    ("noise.comp", 1, "bins / 64: LONGEST_LOOP"),
    ("pulse.comp", 2, "taps + 2 * PULSE_RUN: 4096 samples at most"),
    ("residual.comp", 1, "RESIDUAL_BINS"),
    ("residual_rows.comp", 5, "three passes of bins / 2, and 8: 1.5 * LONGEST_LOOP"),
    ("residual_scan.comp", 8, "bins / lanes each, and halves: LONGEST_LOOP"),
    ("rim.comp", 6, "144 * (1 + 3 * 9) and their outer loops"),
    ("room.comp", 1, "LEVELS"),
    ("spot.comp", 2, "pairs of a spot: LONGEST_LOOP, and PULSE_RUN"),
    ("surface_bonds.comp", 2, "8 each"),
    ("surface_combine.comp", 2, "4 and 8"),
    ("surface_judge.comp", 1, "batches of an epoch"),
    ("surface_points.comp", 2, "8 and 4"),
    ("surface_pull.comp", 2, "625 + 25: MOST_SPREAD"),
    ("surface_step.comp", 3, "32, 625 + 25: MOST_SPREAD"),
    ("threshold.comp", 2, "32 and 16"),
    ("update.comp", 3, "27 + 9 + 3"),
];

/// The operations of a module that are listed above.
fn operations(words: &[u32]) -> BTreeSet<&'static str> {
    const EXT_INST: u32 = 12;
    let named = |list: &[(u32, &'static str)], number: u32| {
        list.iter().find(|(n, _)| *n == number).map(|(_, name)| *name)
    };
    let (mut found, mut at) = (BTreeSet::new(), 5);
    while at < words.len() {
        let op = words[at] & 0xffff;
        found.extend(match op {
            EXT_INST => named(INSTRUCTIONS, words[at + 4]),
            op if SUBGROUPS.iter().any(|range| range.contains(&op)) => Some("subgroup operation"),
            op => named(OPERATIONS, op),
        });
        at += (words[at] >> 16) as usize;
    }
    found
}

#[test]
fn operations_that_drivers_compute_differently_have_a_safe_range() {
    let found: BTreeSet<_> = KERNELS
        .iter()
        .flat_map(|code| operations(&words(code)).into_iter().map(|operation| (code.name, operation)))
        .collect();
    let listed: BTreeSet<_> = USES.iter().map(|(module, operation, _)| (*module, *operation)).collect();
    assert_eq!(found, listed, "a use needs a row with its range, a row a use");
}

#[test]
fn listed_operations_are_seen() {
    // An instruction has its length, then its number; five words of a header precede.
    let module = |words: &[u32]| [&[0; 5], words].concat();
    for (number, name) in INSTRUCTIONS {
        assert_eq!(operations(&module(&[6 << 16 | 12, 1, 2, 3, *number, 4])), BTreeSet::from([*name]));
    }
    for (number, name) in OPERATIONS {
        assert_eq!(operations(&module(&[5 << 16 | number, 1, 2, 3, 4])), BTreeSet::from([*name]));
    }
    assert_eq!(operations(&module(&[6 << 16 | 349, 1, 2, 3, 0, 4])), BTreeSet::from(["subgroup operation"]));
    assert!(operations(&module(&[5 << 16 | 137, 1, 2, 3, 4])).is_empty(), "of unsigned integers");
}

#[test]
fn every_loop_has_a_bound_below_that_of_drivers() {
    let glsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let mut found = BTreeSet::new();
    for folder in ["", "include/"] {
        for entry in std::fs::read_dir(glsl.join(folder)).expect("a folder").map(|e| e.expect("an entry")) {
            let name = entry.file_name().to_string_lossy().into_owned();
            if !name.ends_with(".comp") && !name.ends_with(".glsl") {
                continue;
            }
            let text = std::fs::read_to_string(entry.path()).expect("a source");
            let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
            let loops = code
                .filter(|line| !line.contains("[[unroll]]"))
                .map(|line| line.matches("for (").count() + line.matches("while (").count())
                .sum::<usize>();
            if loops > 0 {
                found.insert((format!("{folder}{name}"), loops));
            }
        }
    }
    let listed: BTreeSet<_> = LOOPS.iter().map(|(source, loops, _)| ((*source).to_owned(), *loops)).collect();
    assert_eq!(found, listed, "a loop needs a bound of its turns in a row, a row a loop");
}
