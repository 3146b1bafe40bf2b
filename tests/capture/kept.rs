//! Parts of captures, chosen while a file is read: the same, bit for bit, as choosing afterwards.

use std::path::Path;

use fixtures::captures::{assert_error, place};
use fixtures::files::{Stored, hdf5, matlab5, matrix, scalar, vector};
use fixtures::originals::{self, Cube};
use fixtures::readers::every_reader;
use thirdbounce::capture::{
    Bounce, Capture, Flip, Gate, Keep, Opened, ReadOptions, Turn, read_given, read_kept,
};
use thirdbounce::{Error, Kind};

/// What a part must be: all of it, read, and then made smaller.
fn chosen(path: &Path, given: &ReadOptions, keep: &Keep) -> Result<(Capture, usize), Error> {
    let Opened { mut capture, dropped, .. } = read_given(path, given)?;
    if let Some(n) = keep.stride {
        capture = capture.stride(n)?;
    }
    if let Some(n) = keep.subset {
        capture = capture.subset(n, keep.subset_seed)?;
    }
    if let Some(gate) = keep.gate {
        capture = capture.gated(gate)?;
    }
    Ok((capture, dropped))
}

/// Every part of a file is as it must be. Returns how many parts could be chosen.
fn assert_parts(path: &Path, given: &ReadOptions, what: &str) -> usize {
    let Opened { capture: whole, dropped: missing, .. } =
        read_given(path, given).unwrap_or_else(|e| panic!("{what}: {e}"));
    let (from, width) = (whole.t_start, whole.bin_width);
    let gate = |a: f64, b: f64| Gate { from: from + a * width, to: from + b * width };
    let strides = [None, Some(1), Some(2), Some(3), Some(5), Some(100)];
    let gates = [None, Some(gate(2.5, 9.0)), Some(gate(1.0, f64::INFINITY)), Some(gate(-9.0, -8.0))];
    let mut good = 0;
    for (stride, gate) in strides.iter().flat_map(|s| gates.map(|g| (*s, g))) {
        for subset in [None, Some(2), Some(whole.pair_count()), Some(0)] {
            let keep = Keep::default().with_stride(stride).with_subset(subset, 7).with_gate(gate);
            let what = format!("{what}, {keep:?}");
            match (chosen(path, given, &keep), read_kept(path, given, &keep)) {
                (Ok((capture, dropped)), Ok(kept)) => {
                    let bits = |c: &Capture| c.histograms.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(&kept.capture), bits(&capture), "{what}");
                    assert_eq!((kept.capture, kept.dropped), (capture, dropped), "{what}");
                    good += 1;
                }
                (Err(after), Err(kept)) => {
                    assert_eq!(kept.kind, after.kind, "{what}");
                    // What cannot be chosen is refused before counts tell which pairs are missing.
                    assert!(missing > 0 || kept.what == after.what, "{what}: {kept} but {after}");
                }
                (after, kept) => panic!("{what}: {after:?} but {kept:?}"),
            }
        }
    }
    good
}

/// Counts of the LCT format in a few chunks.
const SMALL: Cube = Cube {
    name: "rect_data",
    shape: [30, 7, 9],
    chunk: [8, 4, 4],
    kind: originals::Kind::Single,
    repeat: usize::MAX,
};

#[test]
fn parts_of_every_format_are_as_if_chosen_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _, path, given) in every_reader(folder.path()) {
        assert!(assert_parts(&path, &given, name) > 10, "{name}");
        for (flip, degrees) in [(Some(Flip::X), None), (Some(Flip::Xy), Some(90)), (None, Some(270))] {
            let turn = Turn::of(flip, degrees).unwrap();
            assert_parts(&path, &given.clone().with_turn(turn), &format!("{name}, {turn:?}"));
        }
        if name == "znlos.h5" {
            assert!(assert_parts(&path, &given.with_bounce(Bounce::All), "all bounces") > 10);
        }
    }
}

/// Counts of a scan of 9 x 7 points whose sizes no stride divides.
fn count(at: [usize; 3]) -> f64 {
    ((at[0] * 5 + at[1] * 3 + at[2]) % 7) as f64
}

#[test]
fn parts_of_chunked_files_are_as_if_chosen_afterwards() {
    let (_folder, path) = place("made.mat");
    let flat = vec![0.0; 63];
    let shifted: Vec<f64> = (0..63).map(|p| 32.0 * (p % 13) as f64).collect();
    let unknown: Vec<f64> =
        (0..63).map(|p| if p % 17 == 3 { f64::NAN } else { 32.0 * (p % 5) as f64 }).collect();
    use originals::Kind::{Counts, Double, Single};
    for (kind, chunk) in [(Single, [8, 4, 4]), (Single, [0; 3]), (Double, [30, 2, 1]), (Counts, [1, 7, 9])] {
        let cube = |name| Cube { name, chunk, kind, ..SMALL };
        for tof in [&flat, &shifted, &unknown] {
            originals::write(&path, &cube("meas"), &count, &[("tofgrid", &[7, 9], tof)]);
            let what = format!("{kind:?} {chunk:?} {:?}", &tof[..4]);
            assert!(assert_parts(&path, &ReadOptions::default(), &what) > 10, "{what}");
        }
        originals::write(&path, &cube("rect_data"), &count, &[("width", &[1, 1], &[0.5])]);
        assert!(assert_parts(&path, &ReadOptions::default(), "LCT") > 10);
        originals::write(&path, &cube("counts"), &count, &[]);
        let given = ReadOptions::default().with_wall(1.0).with_bin_width(0.01);
        assert!(assert_parts(&path, &given, "one array") > 10);
    }
}

#[test]
fn pairs_that_were_not_measured_are_left_out_before_pairs_are_chosen() {
    let (_folder, path) = place("made.h5");
    // A pair without any number, a dead pair, and a pair whose point is not known.
    let bright = |at: [usize; 3]| 5.0 + count(at);
    let missing = |at: [usize; 3]| match (at[2], at[1]) {
        (3, 4) => f64::NAN,
        (6, 2) => 0.0,
        _ => bright(at),
    };
    originals::write(&path, &SMALL, &missing, &[("width", &[1, 1], &[0.5])]);
    let whole = read_given(&path, &ReadOptions::default()).unwrap();
    assert_eq!((whole.dropped, whole.capture.scan), (2, [61, 1]));
    assert_eq!(whole.notes.iter().filter(|n| n.contains("left out")).count(), 2, "{:?}", whole.notes);
    assert!(assert_parts(&path, &ReadOptions::default(), "missing") > 4);
    let turned = ReadOptions::default().with_turn(Turn::of(Some(Flip::X), Some(90)).unwrap());
    assert!(assert_parts(&path, &turned, "missing, turned") > 4);

    // NLOS-Dirac keeps the coordinates of its points, in any order.
    let dirac = |unknown: bool| {
        let at = move |a: &[usize], c: usize| match (unknown, a) {
            (true, [2, 3]) => f64::NAN,
            _ => -0.1 * a[c] as f64,
        };
        [
            matrix("data_t", &[5, 6, 20], |a| count([a[2], a[1], a[0]]) + 1.0),
            matrix("xg", &[5, 6], move |a| at(a, 1)),
            matrix("yg", &[5, 6], move |a| at(a, 0)),
            vector("da", &[0.0, 0.01, 0.02]),
            scalar("offset_laser", 1.0),
        ]
    };
    for (unknown, dropped) in [(false, 0), (true, 1)] {
        hdf5(&path, &dirac(unknown));
        let whole = read_given(&path, &ReadOptions::default()).unwrap();
        assert_eq!(whole.dropped, dropped);
        assert!(assert_parts(&path, &ReadOptions::default(), "NLOS-Dirac") > 4);
    }
}

/// Also where the part that is kept is whole.
#[test]
fn counts_read_in_blocks_are_whole_by_value() {
    let (_folder, path) = place("made.mat");
    let keep = Keep::default().with_stride(3);
    for (other, whole) in [(2.0, true), (0.5, false), (-1.0, false)] {
        for kind in [originals::Kind::Single, originals::Kind::Double] {
            let cube = Cube { shape: [30, 8, 7], kind, ..SMALL };
            let value = |at: [usize; 3]| if at == [25, 2, 1] { other } else { 1.0 };
            originals::write(&path, &cube, &value, &[("width", &[1, 1], &[0.5])]);
            let read = read_kept(&path, &ReadOptions::default(), &keep).unwrap().capture;
            assert_eq!(read.integer_counts, whole, "{other}");
        }
    }
}

#[test]
fn all_counts_are_checked_not_only_those_that_are_kept() {
    let (_folder, path) = place("made.mat");
    let keep = Keep::default().with_stride(3).with_gate(Gate { from: 0.0, to: 0.02 });
    for (wrong, words) in [(f64::NEG_INFINITY, "finite"), (f64::INFINITY, "finite"), (f64::NAN, "finite")] {
        let value = |at: &[usize]| if *at == [1, 2, 25] { wrong } else { 1.0 };
        for stored in [Stored::Plain, Stored::Compressed] {
            let lct = [matrix("rect_data", &[7, 8, 30], value), scalar("width", 0.5)];
            std::fs::write(&path, matlab5(&lct, stored)).unwrap();
            let error = read_kept(&path, &ReadOptions::default(), &keep);
            assert_error(error, Kind::Input, &["made.mat", "bin 25", words]);
        }
        let cube = Cube { shape: [30, 8, 7], ..SMALL };
        let value = |at: [usize; 3]| if at == [25, 2, 1] { wrong } else { 1.0 };
        originals::write(&path, &cube, &value, &[("width", &[1, 1], &[0.5])]);
        assert_error(
            read_kept(&path, &ReadOptions::default(), &keep),
            Kind::Input,
            &["made.mat", "bin 25", words],
        );
    }
}
