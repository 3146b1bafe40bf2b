//! What the bench that compares two builds makes of its measurements: `benches/builds/summary.rs`.

#[allow(dead_code)] // the bench uses all of it
#[path = "../benches/builds/summary.rs"]
mod summary;

use summary::*;

const NAN: f64 = f64::NAN;

/// A run with these values and no others.
fn side(model: &str, values: &[(usize, f64)]) -> Side {
    let mut all = [NAN; COUNT];
    values.iter().for_each(|(place, value)| all[*place] = *value);
    Side { values: all, model: Some(model.into()), error: None, reused: false }
}

fn row(name: &str, a: Side, b: Side) -> Row {
    Row {
        group: "family",
        name: name.into(),
        words: "one laser".into(),
        model: Some("cosine"),
        sides: vec![a, b],
    }
}

/// Cases that differ in one quantity.
fn rows(place: usize, values: &[[f64; 2]]) -> Vec<Row> {
    let of = |[a, b]: &[f64; 2]| row("0", side("cosine", &[(place, *a)]), side("cosine", &[(place, *b)]));
    values.iter().map(of).collect()
}

fn total_of(place: usize, values: &[[f64; 2]]) -> Total {
    total(&rows(place, values).iter().collect::<Vec<_>>(), place)
}

#[test]
fn places_name_their_quantities() {
    let places = [
        (OWN, "own_iou"),
        (DEPTH, "depth_percent"),
        (NORMALS, "normals_deg"),
        (WITHIN, "within_depth_error"),
    ];
    let others =
        [(AGREEMENT, "agreement"), (BESIDE, "beside"), (CPU, "cpu_s"), (WALL, "wall_s"), (FILES, "files_s")];
    for (place, key) in places.into_iter().chain(others) {
        assert_eq!(QUANTITIES[place].key, key);
    }
    assert_eq!(FILES, COUNT - 1);
}

#[test]
fn changes_within_the_margin_do_not_count() {
    let better_by = |place: usize, a: f64, b: f64| QUANTITIES[place].change(a, b);
    // An IoU rises when it is better; a hundredth is within the margin, though .81 - .8 is above .01 as a float.
    assert_eq!(better_by(OWN, 0.8, 0.81), Some(Change::Same));
    assert_eq!(better_by(OWN, 0.8, 0.811), Some(Change::Better));
    assert_eq!(better_by(OWN, 0.8, 0.789), Some(Change::Worse));
    // An error of 2 % of the wall may change by a twentieth of it, seconds by a tenth.
    assert_eq!(better_by(DEPTH, 2.0, 2.1), Some(Change::Same));
    assert_eq!(better_by(DEPTH, 2.0, 2.11), Some(Change::Worse));
    assert_eq!(better_by(DEPTH, 2.0, 1.89), Some(Change::Better));
    assert_eq!(better_by(CPU, 10.0, 11.0), Some(Change::Same));
    assert_eq!(better_by(CPU, 10.0, 11.1), Some(Change::Worse));
    // No error at all can only get worse.
    assert_eq!(better_by(DEPTH, 0.0, 0.1), Some(Change::Worse));
    assert_eq!(better_by(DEPTH_MM, 1.0, 9.0), None, "the share of the wall is judged");
}

#[test]
fn a_value_that_one_build_lacks_counts_only_where_it_must_be_there() {
    // Depths that are no longer found are worse, and those found at last are better.
    assert_eq!(QUANTITIES[DEPTH].change(2.0, NAN), Some(Change::Worse));
    assert_eq!(QUANTITIES[DEPTH].change(NAN, 2.0), Some(Change::Better));
    assert_eq!(QUANTITIES[DEPTH].change(NAN, NAN), None);
    // A report may call a stage by another name.
    assert_eq!(QUANTITIES[ESTIMATES].change(2.0, NAN), None);
    assert_eq!(QUANTITIES[ESTIMATES].change(NAN, 2.0), None);
}

#[test]
fn means_are_over_cases_with_both_values() {
    let all = total_of(DEPTH, &[[2.0, 1.0], [4.0, 8.0], [1.0, NAN], [NAN, 50.0], [NAN, NAN]]);
    assert_eq!((all.both, all.judged), (2, 4));
    assert_eq!(all.means, [3.0, 4.5]);
    assert!((all.ratio - 1.0).abs() < 1e-12, "a half and a double");
    assert_eq!((all.better, all.worse), (2, 2));
    let none = total_of(ESTIMATES, &[[1.0, NAN], [NAN, NAN]]);
    assert_eq!((none.both, none.judged, none.better, none.worse), (0, 0, 0, 0));
    assert!(none.means[0].is_nan() && none.ratio.is_nan());
}

#[test]
fn a_row_of_one_build_changes_nothing() {
    let mut alone = rows(OWN, &[[0.5, 0.9]]);
    alone[0].sides.truncate(1);
    let alone: Vec<&Row> = alone.iter().collect();
    assert_eq!(total(&alone, OWN).judged, 0);
    assert_eq!(regressions(&alone), [vec![] as Vec<String>, vec![]]);
}

#[test]
fn worst_tenth_is_of_small_overlaps_and_large_errors() {
    let values = || [0.1, 0.9, NAN, 0.3, 0.5].into_iter();
    assert!((worst_tenth(OWN, values()) - 0.2).abs() < 1e-12);
    assert!((worst_tenth(DEPTH, values()) - 0.7).abs() < 1e-12);
    assert!(worst_tenth(DEPTH, [NAN].into_iter()).is_nan());
}

#[test]
fn every_regression_is_named() {
    let quick = [(OWN, 0.9), (DEPTH, 1.0), (CPU, 1.0), (WALL, 1.0)];
    let slow = [(OWN, 0.9), (DEPTH, 1.0), (CPU, 1.2), (WALL, 1.5)];
    let off = [(OWN, 0.5), (DEPTH, NAN), (CPU, 1.0), (WALL, 1.0)];
    let all = [
        row("same", side("cosine", &quick), side("cosine", &quick)),
        row("slow", side("cosine", &quick), side("cosine", &slow)),
        row("off", side("cosine", &quick), side("lambertian", &off)),
        row("gone", side("cosine", &quick), Side::failed("out of memory", &[OWN, DEPTH, CPU])),
        row("mended", Side::failed("out of memory", &[OWN, DEPTH, CPU]), side("cosine", &quick)),
    ];
    let [results, clock] = regressions(&all.iter().collect::<Vec<_>>());
    assert_eq!(
        results,
        [
            "family gone: fails: out of memory",
            "family off: model cosine → lambertian",
            "family off: own IoU 0.900 → 0.500 (-0.400)",
            "family off: depth MAE, % of the wall 1.000 → -",
            "family slow: CPU s 1.00 → 1.20 (+20.0 %)",
        ]
    );
    assert_eq!(clock, ["family slow: wall s 1.00 → 1.50 (+50.0 %)"]);
}

#[test]
fn the_last_table_has_failures_and_models() {
    let found = [(OWN, 0.9), (CPU, 2.0)];
    let all = [
        row("right", side("lambertian", &found), side("cosine", &found)),
        row("gone", side("cosine", &found), Side::failed("no device", &[OWN, CPU])),
    ];
    let text = table(&all.iter().collect::<Vec<_>>());
    let line = |begin: &str| text.lines().find(|l| l.starts_with(begin)).unwrap_or_default();
    assert_eq!(line("| own IoU"), "| own IoU | 2 | 0.900 | 0.450 | -0.450 | - | 0.01 | 0 | 1 |");
    assert_eq!(line("| CPU s"), "| CPU s | 1 | 2.00 | 2.00 | +0.0 % | 1.000 | 10 % | 0 | 0 |");
    assert_eq!(line("| models right"), "| models right | 2 | 1 | 1 | +0 | - | - | 1 | 1 |");
    assert_eq!(line("| failed runs"), "| failed runs | 2 | 0 | 1 | +1 | - | - | 0 | 1 |");
    assert_eq!(line("| normals"), "", "nothing was measured");
}
