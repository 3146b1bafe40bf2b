//! Captures of further publications: files built as their code writes them.

use std::path::{Path, PathBuf};

use fixtures::captures::{assert_error, capture, changed, place};
use fixtures::files::{Matrix, Stored, hdf5, matlab5, matlab5_struct, matrix, scalar, vector};
use glam::dvec3;
use thirdbounce::capture::{
    Capture, METRES_PER_PICOSECOND, Opened, ReadOptions, auto_gate, read, read_given, read_with_notes, write,
};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;
use thirdbounce::{Kind, Result};

/// Points of a scan along d1 and d2: of different numbers, so that mixed axes show.
const N: [usize; 2] = [3, 4];
const BINS: usize = 20;

/// A count that tells where it was stored, (d1, d2, t) in MATLAB.
fn count(d1: usize, d2: usize, t: usize) -> f64 {
    (1 + t + 100 * d1 + 1000 * d2) as f64
}

fn cube(name: &str) -> Matrix {
    matrix(name, &[N[0], N[1], BINS], |at| count(at[0], at[1], at[2])).of_counts()
}

/// Reads the arrays from MATLAB v7.3 and from v5, plain and compressed; all agree.
fn opened(arrays: &[Matrix], given: &ReadOptions) -> Result<Opened> {
    let (_folder, path) = place("made.mat");
    hdf5(&path, arrays);
    let first = read_given(&path, given);
    for stored in [Stored::Plain, Stored::BigEndian, Stored::Compressed] {
        std::fs::write(&path, matlab5(arrays, stored)).unwrap();
        match (&first, read_given(&path, given)) {
            (Ok(a), Ok(b)) => assert_eq!((&a.capture, &a.notes), (&b.capture, &b.notes)),
            (a, b) => assert_eq!(a.is_ok(), b.is_ok()),
        }
    }
    first
}

/// The pair whose first count is that of (d1, d2).
fn pair_of(c: &Capture, d1: usize, d2: usize) -> usize {
    (0..c.pair_count()).find(|p| c.histograms[p * c.bins] == count(d1, d2, 0) as f32).unwrap()
}

fn without(arrays: &[Matrix], name: &str) -> Vec<Matrix> {
    arrays.iter().filter(|m| m.name != name).cloned().collect()
}

#[test]
fn the_kilometre_data_say_bins_pulse_and_spot() {
    let arrays = [
        cube("sig_in"),
        scalar("width", 0.425),
        scalar("timeRes", 32e-12),
        scalar("pulsewidth", 794.45),
        scalar("radius", 0.14),
    ];
    let Opened { capture: c, notes, .. } = opened(&arrays, &ReadOptions::default()).unwrap();
    assert_eq!((c.scan, c.bins, c.integer_counts), ([3, 4], BINS, true));
    assert!((c.bin_width - 32.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
    let span = c.laser.iter().map(|p| p.y).fold(0.0, f64::max) * 2.0;
    assert!((span - 0.85).abs() < 1e-12, "the longer side is twice `width`: {span}");
    // d1 runs to the left, d2 up.
    let [low, left, up] = [(0, 0), (1, 0), (0, 1)].map(|(a, b)| c.laser[pair_of(&c, a, b)]);
    assert!(left.x > low.x && left.y == low.y && up.y > low.y && up.x == low.x);
    let pulse = c.pulse.as_ref().unwrap();
    assert!((pulse.fwhm() / (794.45 * METRES_PER_PICOSECOND) - 1.0).abs() < 0.02, "{}", pulse.fwhm());
    // Their beam, exp(-r² / (radius / 2)²), is half as high at √ln 2 of radius / 2: 0.117 m wide for a radius of 0.14 m.
    let spot = c.laser_spot.unwrap();
    assert!(c.sensor_spot == Some(spot) && (spot / 2f64.sqrt() - 0.1166).abs() < 1e-3, "{spot}");
    let reported = notes.join("\n");
    for words in ["width is half", "picoseconds", "notes say seconds", "radius 0.14"] {
        assert!(reported.contains(words), "{words}: {reported}");
    }
    // Seconds, as the notes of the publication say.
    let mut seconds = arrays.to_vec();
    seconds[3] = scalar("pulsewidth", 794.45e-12);
    let width = opened(&seconds, &ReadOptions::default()).unwrap().capture.pulse.unwrap().fwhm();
    assert!((width / pulse.fwhm() - 1.0).abs() < 1e-9);
    let sharp = opened(&without(&without(&arrays, "pulsewidth"), "radius"), &ReadOptions::default()).unwrap();
    assert!(sharp.capture.pulse.is_none() && sharp.capture.laser_spot.is_none());
    let read = |name| opened(&without(&arrays, name), &ReadOptions::default());
    assert_error(read("width"), Kind::Input, &["width", "sig_in"]);
    assert_error(read("timeRes"), Kind::Options, &["timeRes", "bin width"]);
    let twice = opened(&arrays, &ReadOptions::default().with_bin_width(0.01));
    assert_error(twice, Kind::Options, &["timeRes", "leave"]);
    for (at, name) in [(1, "width"), (2, "timeRes"), (3, "pulsewidth"), (4, "radius")] {
        let mut wrong = arrays.to_vec();
        wrong[at] = scalar(name, -1.0);
        assert_error(opened(&wrong, &ReadOptions::default()), Kind::Input, &[name, "-1"]);
    }
}

/// Fields of NLOSDATA: a wall at z = 1.08, the points d2 fastest.
fn nlosdata(confocal: bool) -> Vec<Matrix> {
    let z = 1.08;
    let confocal_points = |name: &str| {
        matrix(name, &[12, 3], |at| [0.1 * (at[0] / 4) as f64, 0.2 * (at[0] % 4) as f64, z][at[1]])
    };
    let list = |name: &str, n: usize, y: f64| matrix(name, &[n, 3], |at| [0.1 * at[0] as f64, y, z][at[1]]);
    let [l, s] = match confocal {
        true => ["l", "s"].map(confocal_points),
        false => [list("l", 3, 0.0), list("s", 4, 0.5)],
    };
    vec![
        cube("transient"),
        l,
        s,
        matrix("times", &[1, BINS], |at| 0.0012 + 0.0192 * at[1] as f64),
        scalar("delta", 0.0192),
        scalar("target_dist", z),
        scalar("is_confocal", f64::from(u8::from(confocal))),
        vector("x", &[0.0, 0.1]),
    ]
}

/// Reads fields of a struct from either kind of file.
fn opened_struct(fields: &[Matrix]) -> Result<Opened> {
    let (_folder, path) = place("made.mat");
    let named = |m: &Matrix| Matrix { name: format!("NLOSDATA/{}", m.name), ..m.clone() };
    hdf5(&path, &fields.iter().map(named).collect::<Vec<_>>());
    let first = read_with_notes(&path);
    for stored in [Stored::Plain, Stored::Compressed] {
        std::fs::write(&path, matlab5_struct("NLOSDATA", fields, stored)).unwrap();
        match (&first, read_with_notes(&path)) {
            (Ok(a), Ok(b)) => assert_eq!(a.capture, b.capture),
            (a, b) => assert_eq!(a.is_ok(), b.is_ok()),
        }
    }
    first
}

#[test]
fn convolutional_approximations_confocal_and_not() {
    let Opened { capture: c, notes, .. } = opened_struct(&nlosdata(true)).unwrap();
    assert_eq!((c.scan, c.bins, c.bin_width), ([3, 4], BINS, 0.0192));
    assert!(c.t_start.abs() < 1e-12, "bins begin at whole multiples of delta: {}", c.t_start);
    for (d1, d2) in [(0, 0), (2, 0), (0, 3), (1, 2)] {
        let wanted = dvec3(-0.1 * d1 as f64, 0.2 * d2 as f64, 0.0);
        assert!(c.laser[pair_of(&c, d1, d2)].distance(wanted) < 1e-12, "{d1} {d2}");
    }
    assert!(notes.join("\n").contains("z = 1.08"), "{notes:?}");
    let c = opened_struct(&nlosdata(false)).unwrap().capture;
    assert_eq!(c.scan, [3, 4]);
    let p = pair_of(&c, 2, 3);
    assert!(c.laser[p].distance(dvec3(-0.2, 0.0, 0.0)) < 1e-12);
    assert!(c.sensor[p].distance(dvec3(-0.3, 0.5, 0.0)) < 1e-12);
    // A later first bin, and one that is named by its own end.
    for (first, start) in [(0.0192, 0.0), (0.0204, 0.0192), (0.0384, 0.0192), (0.0, 0.0)] {
        let mut late = nlosdata(true);
        late[3] = matrix("times", &[1, BINS], |at| first + 0.0192 * at[1] as f64);
        let got = opened_struct(&late).unwrap().capture.t_start;
        assert!((got - start).abs() < 1e-9, "{first}: {got}, not {start}");
    }
    for name in ["l", "times", "delta"] {
        assert_error(
            opened_struct(&without(&nlosdata(true), name)),
            Kind::Input,
            &[name, "NLOSDATA/transient"],
        );
    }
    assert_error(opened_struct(&without(&nlosdata(false), "s")), Kind::Input, &["NLOSDATA/s"]);
    let mut apart = nlosdata(true);
    apart[1] = matrix("l", &[11, 3], |_| 0.0);
    assert_error(opened_struct(&apart), Kind::Input, &["[20, 4, 3]", "11 points l"]);
}

/// `lighting` with x fastest, of a wall 0.7 m wide.
fn lighting(name: &str) -> Matrix {
    matrix(name, &[12, 3], |at| [0.35 * (at[0] % 3) as f64 - 0.35, 0.2 * (at[0] / 3) as f64, 0.0][at[1]])
}

#[test]
fn surface_optimisation_measured_and_rendered() {
    let counts = |name: &str| matrix(name, &[12, BINS], |at| count(at[0] % 3, at[0] / 3, at[1])).of_counts();
    let measured = [counts("transient"), lighting("lighting")];
    let Opened { capture: c, notes, .. } = opened(&measured, &ReadOptions::default()).unwrap();
    assert_eq!((c.scan, c.bins), ([3, 4], BINS));
    assert!((c.bin_width - 4.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
    let [low, left, down] = [(0, 0), (1, 0), (0, 1)].map(|(a, b)| c.laser[pair_of(&c, a, b)]);
    assert!((left.x - low.x - 0.35).abs() < 1e-12 && left.y == low.y, "x of lighting runs to the left");
    assert!((low.y - down.y - 0.2).abs() < 1e-12 && down.x == low.x, "y of lighting runs down");
    assert!(notes.iter().any(|n| n.contains("4 ps")) && notes.iter().any(|n| n.contains("to the left")));
    let wide = opened(&measured, &ReadOptions::default().with_bin_width(0.002)).unwrap();
    assert_eq!(wide.capture.bin_width, 0.002);
    let rendered =
        [counts("gt_transient"), lighting("lighting"), lighting("sensor"), scalar("bin_width", 0.0012)];
    let c = opened(&rendered, &ReadOptions::default()).unwrap().capture;
    assert_eq!(c.bin_width, 0.0012);
    let [low, right, up] = [(0, 0), (1, 0), (0, 1)].map(|(a, b)| c.laser[pair_of(&c, a, b)]);
    assert!(right.x > low.x && up.y > low.y, "coordinates are kept");
    assert_error(
        opened(&rendered, &ReadOptions::default().with_bin_width(0.01)),
        Kind::Options,
        &["bin_width", "leave"],
    );
    let apart = [counts("transient"), matrix("lighting", &[11, 3], |_| 0.0)];
    assert_error(opened(&apart, &ReadOptions::default()), Kind::Input, &["[20, 12]", "[3, 11]"]);
}

/// The three files of a CC-SOCR capture of a bent wall in a folder, counts by `value` of (pair, bin).
fn socr(value: impl Fn(usize, usize) -> f64, deep: bool) -> (tempfile::TempDir, PathBuf) {
    let (folder, path) = place("instance");
    let pairs = path.join("full");
    std::fs::create_dir_all(&pairs).unwrap();
    // Column by column, each from the highest: as in their files.
    let steps = |p: usize| [if deep { p % 4 } else { 0 }, p / 3, 2 - p % 3];
    for name in ["C_i", "C_d"] {
        let m = matrix(name, &[12, 3], |at| steps(at[0])[at[1]] as f64);
        std::fs::write(pairs.join(format!("{name}.mat")), matlab5(&[m], Stored::Plain)).unwrap();
    }
    let signal = matrix("sub_Sig", &[12, BINS], |at| value(at[0], at[1]));
    std::fs::write(pairs.join("sub_Sig.mat"), matlab5(&[signal], Stored::Compressed)).unwrap();
    (folder, pairs)
}

#[test]
fn socr_units_are_found_beside_the_capture() {
    let whole = |p: usize, t: usize| (1 + p + t) as f64;
    let (_folder, path) = socr(whole, true);
    assert_error(read(&path), Kind::Options, &["wall size"]);
    let wall = || ReadOptions::default().with_wall(0.6);
    assert_error(read_given(&path, &wall()), Kind::Options, &["3 steps deep", "experimental_setup.m"]);
    let by_hand = read_given(&path, &wall().with_depth_unit(0.01)).unwrap().capture;
    assert_eq!(by_hand.scan, [4, 3]);
    let depth = |c: &Capture| c.laser.iter().map(|p| p.z).fold(0.0, f64::max);
    assert!((depth(&by_hand) - 0.03).abs() < 1e-12);
    let first = by_hand.laser[by_hand.histograms.iter().position(|v| *v == 1.0).unwrap() / BINS];
    assert!(
        (first - dvec3(-0.3, 0.2, 0.0)).length() < 1e-9,
        "the first pair is at the right, at the top: {first}"
    );
    // The script of their code, in the folder above.
    let script =
        "%% c = 7;\nc = 3E8; delta_t = 16E-12;\nbx = 0.01; by = 0.2; bz = 1/5; % steps\nxb = xb - nbx * bx;";
    let above = path.parent().unwrap().join("experimental_setup.m");
    std::fs::write(&above, script).unwrap();
    let reported = read_with_notes(&path).unwrap();
    let off = |c: &Capture| {
        let apart = c.laser.iter().zip(&by_hand.laser).map(|(a, b)| a.distance(*b));
        apart.fold(0.0, f64::max)
    };
    assert!(off(&reported.capture) < 1e-9, "{}", off(&reported.capture));
    assert!((reported.capture.bin_width - 16.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
    assert!(reported.notes.join("\n").contains("experimental_setup.m"), "{:?}", reported.notes);
    // Any of the files names the capture, and what the user gives comes first.
    let given = wall().with_wall(1.2).with_depth_unit(0.02).with_bin_width(0.01);
    let larger = read_given(&path.join("C_i.mat"), &given).unwrap().capture;
    assert!((depth(&larger) - 0.06).abs() < 1e-12 && larger.bin_width == 0.01);
    // The points that General-NLOS made of the same pairs, in rows of 4 with some to spare.
    std::fs::remove_file(above).unwrap();
    let setup = |scale: f64| {
        matrix("laserpoints", &[4, 4, 3], |at| {
            let p = (at[0] * 4 + at[1]) % 12;
            scale * [0.2 * (p / 3) as f64, 0.2 * (2 - p % 3) as f64, 0.01 * (p % 4) as f64][at[2]]
        })
    };
    let beside = path.join("setup.mat");
    std::fs::write(&beside, matlab5(&[setup(1.0)], Stored::Plain)).unwrap();
    let reported = read_with_notes(&path).unwrap();
    assert!(reported.notes.join("\n").contains("setup.mat"));
    assert!(off(&reported.capture) < 1e-9, "{}", off(&reported.capture));
    let mut other = setup(1.0);
    other.values[1] += 0.05;
    std::fs::write(&beside, matlab5(&[other], Stored::Plain)).unwrap();
    assert_error(read(&path), Kind::Input, &["setup.mat", "other points"]);
    // Only this format has such a unit.
    let (_folder, lct) = place("lct.mat");
    hdf5(&lct, &[cube("rect_data"), scalar("width", 0.5)]);
    assert_error(
        read_given(&lct, &ReadOptions::default().with_depth_unit(0.01)),
        Kind::Options,
        &["CC-SOCR"],
    );
}

#[test]
fn socr_square_roots_are_squared_and_nothing_else_is() {
    let counts = |p: usize, t: usize| ((p * 7 + t * 3) % 11) as f64;
    let wall = ReadOptions::default().with_wall(1.0);
    let read = |value: &dyn Fn(usize, usize) -> f64| {
        let (_folder, path) = socr(value, false);
        read_given(&path, &wall).unwrap()
    };
    let plain = read(&counts);
    let roots = read(&|p, t| counts(p, t).sqrt());
    assert_eq!(plain.capture, roots.capture);
    assert!(roots.capture.integer_counts);
    assert!(roots.notes.iter().any(|n| n.contains("squared")), "{:?}", roots.notes);
    assert!(!plain.notes.iter().any(|n| n.contains("squared")));
    // Rendered signals below 1, whose squares are close to 0, and others that are no roots.
    for value in
        [&|p, t| 1e-3 * counts(p, t), &|p, t| 1.1 * counts(p, t)] as [&dyn Fn(usize, usize) -> f64; 2]
    {
        let rendered = read(value);
        assert!(!rendered.notes.iter().any(|n| n.contains("squared")));
        let most = rendered.capture.histograms.iter().fold(0.0f32, |a, b| a.max(*b));
        assert!(f64::from(most) < 1.2 * value(1, 1), "{most}: the largest is that of count 10");
    }
}

/// Writes `setup.mat`, and peaks, for 2 x 3 points.
fn general_setup(folder: &Path) {
    let points =
        |name: &str| matrix(name, &[2, 3, 3], |at| [0.1 * at[0] as f64, 0.2 * at[1] as f64, 0.0][at[2]]);
    let write = |name: &str, arrays: &[Matrix]| {
        std::fs::write(folder.join(name), matlab5(arrays, Stored::Plain)).unwrap();
    };
    write("setup.mat", &[points("laserpoints"), points("detectpoints")]);
    write("peak1.mat", &[matrix("peak1", &[2, 3], |at| (at[0] + at[1]) as f64)]);
    write("peak2.mat", &[matrix("peak2", &[2, 3], |at| (2 + at[0] + at[1]) as f64)]);
}

#[test]
fn general_nlos_counts_of_the_instrument() {
    let (folder, path) = place("data_made.mat");
    general_setup(folder.path());
    // Of point (i, j), with path 0 in bin 1 + i + j: row i * 3 + j, but 5 - j in the second line. Two rows belong to no point.
    let raw = |row: usize, t: usize| {
        let (i, j) = (row / 3, if row / 3 == 1 { 5 - row } else { row % 3 });
        if row > 5 {
            7000.0
        } else {
            (100 * (i + 1) + 10 * (j + 1)) as f64 + (t as f64 - (1 + i + j) as f64).max(0.0)
        }
    };
    std::fs::write(&path, matlab5(&[matrix("counts", &[8, BINS], |at| raw(at[0], at[1]))], Stored::Plain))
        .unwrap();
    let Opened { capture: c, notes, .. } = read_with_notes(&path).unwrap();
    assert_eq!((c.scan, c.bins), ([2, 3], BINS - 4), "the latest path 0 is in bin 4");
    for (p, point) in c.laser.iter().enumerate() {
        let (i, j) = ((point.x / 0.1).round(), (point.y / 0.2).round());
        let first = 100.0 * (i + 1.0) + 10.0 * (j + 1.0);
        assert_eq!(
            c.histograms[p * c.bins..][..3],
            [0.0, 1.0, 2.0].map(|t| (first + t) as f32),
            "({i}, {j})"
        );
    }
    let reported = notes.join("\n");
    assert!(reported.contains("odd rows run backwards") && reported.contains("2 of 8 rows"), "{reported}");
    // Counts that were put in order are those of `data`, and either finds its points.
    let worked =
        |name: &str| matrix(name, &[2, 3, BINS], |at| (1 + at[0] + 10 * at[1] + at[2]) as f64).of_counts();
    let captures = ["counts", "data"].map(|name| {
        std::fs::write(&path, matlab5(&[worked(name)], Stored::Plain)).unwrap();
        read(&path).unwrap()
    });
    assert_eq!(captures[0], captures[1]);
    std::fs::write(&path, matlab5(&[matrix("counts", &[5, BINS], |_| 1.0)], Stored::Plain)).unwrap();
    assert_error(read(&path), Kind::Input, &["5 rows", "2 x 3"]);
    std::fs::remove_file(folder.path().join("peak2.mat")).unwrap();
    assert_error(read(&path), Kind::Input, &["peak2.mat", "worked-up"]);
}

#[test]
fn zones_of_a_low_cost_sensor() {
    let (_folder, path) = place("volume.npz");
    let hists: Vec<f64> = (0..16 * BINS).map(|v| 0.5 + v as f64).collect();
    let cloud: Vec<f64> =
        (0..16).flat_map(|z| [0.2 * (z % 4) as f64 - 0.3, 0.2 * (z / 4) as f64 - 0.3, 0.0]).collect();
    let arrays = |zones: usize| {
        let hists = Array::from_f64(&[zones, BINS], &hists[..zones * BINS]);
        [
            ("hists", hists),
            ("pt_cloud", Array::from_f64(&[16, 3], &cloud)),
            ("particles", Array::from_f64(&[1, 3], &[0.0; 3])),
        ]
    };
    std::fs::write(&path, npz_bytes(&arrays(16)).unwrap()).unwrap();
    let Opened { capture: c, notes, .. } = read_with_notes(&path).unwrap();
    assert_eq!((c.pair_count(), c.bins), (16, BINS));
    assert!((c.bin_width - 250.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
    assert!((c.sensor_spot.unwrap() - 0.136).abs() < 1e-3, "{:?}", c.sensor_spot);
    assert_eq!(c.histograms[c.bins], hists[BINS] as f32);
    let reported = notes.join("\n");
    assert!(
        reported.contains("250 ps") && reported.contains("confocal") && reported.contains("spots of 0.136"),
        "{reported}"
    );
    std::fs::write(&path, npz_bytes(&arrays(15)).unwrap()).unwrap();
    assert_error(read(&path), Kind::Input, &["[15, 20]", "[16, 3]"]);
}

#[test]
fn fields_of_view_are_spots() {
    let (_folder, path) = place("fov.npz");
    let mut arrays = vec![
        ("H", Array::from_f64(&[2, 2, 1], &[1.0, 2.0, 3.0, 4.0])),
        ("sensor_xyz", Array::from_f64(&[2, 1, 3], &[0.0, 0.0, 0.0, 0.1, 0.0, 0.0])),
        ("laser_xyz", Array::from_f64(&[1, 3], &[0.05, 0.0, 0.0])),
        ("delta_t", Array::from_f64(&[], &[0.075])),
        ("sensor_fov", Array::from_f64(&[], &[11.25])),
    ];
    std::fs::write(&path, npz_bytes(&arrays).unwrap()).unwrap();
    assert_error(read(&path), Kind::Input, &["device_xyz"]);
    arrays.push(("device_xyz", Array::from_f64(&[3], &[0.05, 0.0, -1.0])));
    std::fs::write(&path, npz_bytes(&arrays).unwrap()).unwrap();
    let Opened { capture: c, notes, .. } = read_with_notes(&path).unwrap();
    assert!((c.sensor_spot.unwrap() - 0.134).abs() < 1e-3 && c.laser_spot.is_none(), "{:?}", c.sensor_spot);
    assert!(notes.iter().any(|n| n.contains("11.25 degrees")), "{notes:?}");
}

#[test]
fn known_direct_light_need_not_be_strong() {
    // Direct light 4 times as strong as the scene, spread over some bins; the scene rises from bin 60 on.
    let weak = capture([4, 4], 200, |p, b| match b {
        0..=3 => [10.0, 40.0, 40.0, 10.0][b] + (p % 2) as f32,
        60..100 => 10.0,
        _ => 0.0,
    });
    assert_eq!(auto_gate(&weak), None, "that may be any surface");
    let (_folder, path) = place("direct.npz");
    let known = changed(&weak, |c| c.direct = Some(c.t_start + 2.0 * c.bin_width));
    let found = auto_gate(&known).unwrap();
    let bin = (found.gate.from - known.t_start) / known.bin_width;
    assert!((4.0..60.0).contains(&bin), "{bin}: {}", found.reason);
    write(&known, &path).unwrap();
    assert_eq!(read(&path).unwrap(), changed(&known, |c| c.name = "direct".into()));
    let notes = write(&known, &path.with_extension("h5")).unwrap();
    assert!(notes.iter().any(|n| n.contains("direct")), "{notes:?}");
    // Without bins around that path there is nothing to leave out.
    let elsewhere = changed(&weak, |c| c.direct = Some(-1.0));
    assert_eq!(auto_gate(&elsewhere), None);
    assert_error(write(&changed(&weak, |c| c.direct = Some(f64::NAN)), &path), Kind::Input, &["direct"]);
}
