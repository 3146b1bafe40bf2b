//! Changes from one side of a benchmark to the other, means, curves and the pages that show the stored benchmark.

#[allow(dead_code)] // the bench uses all of it
#[path = "../../benches/builds/pages.rs"]
mod pages;

use thirdbounce_benchmark::pages::*;
use thirdbounce_benchmark::pinned::Pinned;

const NAN: f64 = f64::NAN;

/// A run with these values and no others.
fn side(model: &str, values: &[(usize, f64)]) -> SideResults {
    let mut side = SideResults { model: Some(model.into()), ..SideResults::default() };
    values.iter().for_each(|(place, value)| side.values[*place] = *value);
    side
}

fn row(name: &str, a: SideResults, b: SideResults) -> CaseResults {
    let [a, b] = [(a, "a"), (b, "b")].map(|(side, name)| SideResults { name: name.into(), ..side });
    CaseResults {
        group: "family".into(),
        name: name.into(),
        model: Some("cosine".into()),
        sides: vec![a, b],
        ..CaseResults::default()
    }
}

/// Cases that differ in one quantity.
fn rows(place: usize, values: &[[f64; 2]]) -> Vec<CaseResults> {
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
        (CPU, "cpu_s"),
        (FILES, "files_s"),
    ];
    assert!(places.iter().all(|(place, key)| QUANTITIES[*place].key == *key));
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
    let alone: Vec<&CaseResults> = alone.iter().collect();
    assert_eq!(total(&alone, OWN).judged, 0);
    assert_eq!(regressions(&alone), [vec![] as Vec<String>, vec![]]);
}

#[test]
fn worst_tenth_is_of_small_overlaps_and_large_errors() {
    let values = [0.1, 0.9, NAN, 0.3, 0.5].map(|v| [v, v]);
    assert!((total_of(OWN, &values).worst[1] - 0.2).abs() < 1e-12);
    assert!((total_of(DEPTH, &values).worst[1] - 0.7).abs() < 1e-12);
    assert!(total_of(DEPTH, &[[NAN; 2]]).worst[0].is_nan());
}

#[test]
fn every_regression_is_named() {
    let quick = [(OWN, 0.9), (BEST, 0.9), (DEPTH, 1.0), (CPU, 1.0), (WALL, 1.0)];
    let slow = [(OWN, 0.9), (BEST, 0.9), (DEPTH, 1.0), (CPU, 1.2), (WALL, 1.5)];
    let off = [(OWN, 0.5), (BEST, 0.9), (DEPTH, NAN), (CPU, 1.0), (WALL, 1.0)];
    let all = [
        row("same", side("cosine", &quick), side("cosine", &quick)),
        row("slow", side("cosine", &quick), side("cosine", &slow)),
        row("off", side("cosine", &quick), side("lambertian", &off)),
        row("gone", side("cosine", &quick), SideResults::failed("b", "out of memory")),
        row("mended", SideResults::failed("a", "out of memory"), side("cosine", &quick)),
    ];
    let [results, clock] = regressions(&all.iter().collect::<Vec<_>>());
    assert_eq!(
        results,
        [
            "family gone: fails: out of memory",
            "family off: model cosine → lambertian",
            "family off: own IoU 0.900 → 0.500 (-0.400)",
            "family off: depth MAE, % of the wall 1.000 → –",
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
        row("gone", side("cosine", &found), SideResults::failed("b", "no device")),
    ];
    let text = changes(&all.iter().collect::<Vec<_>>()).markdown();
    let line = |begin: &str| text.lines().find(|l| l.starts_with(begin)).unwrap_or_default();
    assert_eq!(
        line("| own IoU"),
        "| own IoU | 2 | 0.900 | 0.450 | -0.450 | 0.900 | 0.450 | – | 0.01 | 0 | 1 |"
    );
    assert_eq!(line("| CPU s"), "| CPU s | 1 | 2.00 | 2.00 | +0.0 % | 2.00 | 2.00 | 1.000 | 10 % | 0 | 0 |");
    assert_eq!(line("| models right"), "| models right | 2 | 1 | 1 | +0 | – | – | – | – | 1 | 1 |");
    assert_eq!(line("| failed runs"), "| failed runs | 2 | 0 | 1 | +1 | – | – | – | – | 0 | 1 |");
    assert_eq!(line("| normals"), "", "nothing was measured");
}

/// A case of an iterative method, and of a closed form unless it does not take the case.
fn curve(iterative: &[(f64, f64)], closed: Option<(f64, f64)>) -> CaseResults {
    let point =
        |(seconds, iou): (f64, f64)| CurvePoint { seconds, values: [iou, iou, 0.1 * (1.0 - iou), 10.0] };
    let of = |name: &str, points: Vec<CurvePoint>| {
        let mut side = SideResults { name: name.into(), points, ..SideResults::default() };
        side.values[OWN] = side.points[side.points.len() - 1].values[0];
        side
    };
    let mut sides = vec![of("own", iterative.iter().copied().map(point).collect())];
    sides.extend(closed.map(|closed| of("closed", vec![point(closed)])));
    CaseResults { name: "c".into(), sides, ..CaseResults::default() }
}

#[test]
fn curves_are_means_of_staircases_in_which_failures_count() {
    let [a, b] = [curve(&[(1.0, 0.5), (3.0, 0.9)], Some((0.1, 0.6))), curve(&[(2.0, 0.7), (4.0, 0.8)], None)];
    let all = curves(&[&a, &b]);
    let own: Vec<[f64; 2]> = all[0].points.iter().map(|p| [p.seconds, p.values[0]]).collect();
    // Before its first sample a method has an empty map.
    let wanted = [[1.0, 0.25], [2.0, 0.6], [3.0, 0.8], [4.0, 0.85]];
    assert!(own.iter().flatten().zip(wanted.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12), "{own:?}");
    assert!((all[0].points[0].values[2] - 0.525).abs() < 1e-12, "a depth error of 1 in one case");
    // The closed form does not take the second case.
    assert_eq!((all[1].points.len(), all[1].points[0].seconds, all[1].points[0].values[0]), (1, 0.1, 0.3));
    assert!((mean_of(&[&a, &b], "closed", OWN) - 0.3).abs() < 1e-12);
    // The hull never becomes worse, case by case.
    let best: Vec<[f64; 2]> = hull(&[&a, &b], false).iter().map(|p| [p.seconds, p.values[0]]).collect();
    let wanted = [[0.1, 0.3], [1.0, 0.3], [2.0, 0.65], [3.0, 0.8], [4.0, 0.85]];
    assert!(
        best.iter().flatten().zip(wanted.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12),
        "{best:?}"
    );
    assert_eq!(hull(&[&a, &b], true).len(), 1);
    let wins = wins(&[&a, &b]).expect("a first side");
    assert!(wins.from == Some(2.0) && (wins.at_end - 0.55).abs() < 1e-12, "{wins:?}");
    let drawn = figure(&[&a, &b], "title", &[0, 1, 2, 3], true).svg();
    // Four samples and one closed form in each graph, and both in the legend.
    assert_eq!(drawn.matches("<circle").count(), 4 * 5 + 2, "{drawn}");
}

#[test]
fn a_stored_benchmark_is_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("page.json");
    let mut case = curve(&[(1.0, 0.5), (3.0, 0.9)], Some((0.1, 0.6)));
    case.words = "a [list] of 3, and {more}".into();
    let page = Page { cases: vec![case], ..Page::default() };
    write_json(&file, &page).expect("it is written");
    let text = std::fs::read_to_string(&file).expect("text");
    assert!(text.contains("[1.0,0.5,0.5,0.05,10.0]") && text.contains("[list] of 3"), "{text}");
    let found: Page = read_json(&file).expect("a page");
    assert_eq!(found.cases[0].sides[0].points, page.cases[0].sides[0].points);
    assert_eq!((found.cases[0].sides[0].values[OWN], &found.cases[0].words), (0.9, &page.cases[0].words));
    assert!(found.cases[0].sides[0].values[CPU].is_nan());
}

/// Default results have not changed since the tables were made.
#[test]
fn the_stored_benchmark_is_of_this_build() {
    let page: Page = read_json(&pages::root().join(pages::STORED)).expect("the stored benchmark");
    let stored = page.pinned.expect("the pinned solve of its build");
    Pinned::solved().and_then(|now| now.check(&stored)).unwrap_or_else(|e| panic!("{e}"));
}

/// `make bench-page` renews everything.
#[test]
fn pages_show_the_stored_benchmark() {
    let page: Page = read_json(&pages::root().join(pages::STORED)).expect("the stored benchmark");
    let cases = page.compared();
    assert!(cases.len() == 8 && !page.stability.is_empty());
    for part in pages::parts(&page) {
        let text = std::fs::read_to_string(pages::root().join(part.file)).expect("a page");
        let (_, found) = pages::replaced(&text, &part).expect("its comments");
        assert!(found == part.text, "{} {:?} shows other numbers", part.file, part.name);
    }
}
