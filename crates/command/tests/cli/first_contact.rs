//! Files of newcomers: read as they are meant, or with advice that makes a capture once it is followed to the letter.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Output;

use fixtures::captures::{changed, histogram};
use fixtures::command::{stderr, succeed, thirdbounce};
use fixtures::files::{
    Matrix, Stored, hdf5, matlab_cell, matlab_file, matlab_matrix, matlab5, matlab5_struct, matrix, scalar,
    stored_zip,
};
use glam::{DVec3, dvec3};
use thirdbounce::capture::{Capture, METRES_PER_PICOSECOND, read};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::{Array, transpose};
use thirdbounce::job::{Loaded, load};
use thirdbounce::settings::Settings;

const SIDE: usize = 16;
const BINS: usize = 240;
const WIDTH: f64 = 32.0 * METRES_PER_PICOSECOND;

/// Photons of a small thing 0.6 m behind the middle of a wall of 1 m, of another one, and of a background.
fn scene() -> Capture {
    let at = |i: usize| i as f64 / (SIDE - 1) as f64 - 0.5;
    let points: Vec<DVec3> = (0..SIDE * SIDE).map(|p| dvec3(at(p / SIDE), at(p % SIDE), 0.0)).collect();
    let mut random = fixtures::files::noise(1);
    let mut light = |point: &DVec3, bin: usize| {
        let of = |thing: DVec3, most: f64| {
            let after = bin as f64 - 2.0 * point.distance(thing) / WIDTH;
            if after < 0.0 { 0.0 } else { most * (-0.3 * after).exp() }
        };
        let mean = of(dvec3(0.05, -0.1, 0.6), 300.0) + of(dvec3(-0.1, 0.15, 0.75), 150.0);
        (mean + (random() % 4) as f64).round() as f32
    };
    let counts = points.iter().flat_map(|p| (0..BINS).map(|bin| light(p, bin)).collect::<Vec<_>>()).collect();
    let mut made = Capture::new([SIDE; 2], points.clone(), points, BINS, WIDTH, counts);
    made.integer_counts = true;
    made
}

/// The pair of a point in the order of a scan: row by row from the lowest left.
fn pair_of(point: usize) -> usize {
    point % SIDE * SIDE + point / SIDE
}

/// A folder with files.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Place {
        Place(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn name(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// What `info` says against a file.
    #[track_caller]
    fn refused(&self, name: &str, more: &[&str]) -> String {
        let file = self.name(name);
        let output = thirdbounce(&[&["info", &file], more].concat());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.contains(name) && !text.contains("panicked"), "{text}");
        text
    }

    /// Runs the command that an advice contains, with these words in place of others; returns the capture.
    #[track_caller]
    fn follow(&self, advice: &str, words: &[(&str, &str)]) -> Capture {
        let start = advice.find("thirdbounce histogram").unwrap_or_else(|| panic!("no command in {advice}"));
        let end = advice[start..].find("capture.npz").unwrap() + start + "capture.npz".len();
        let words: HashMap<&str, &str> = words.iter().copied().collect();
        let out = self.name("capture.npz");
        let arguments = advice[start..end].split_whitespace().skip(1);
        let arguments: Vec<&str> = arguments
            .map(|word| if word == "capture.npz" { out.as_str() } else { words.get(word).unwrap_or(&word) })
            .collect();
        succeed(&arguments);
        let made = read(Path::new(&out)).unwrap();
        std::fs::remove_file(out).unwrap();
        made
    }

    fn loaded(&self, name: &str, settings: &[(&str, &str)]) -> Loaded {
        let all = settings.iter().copied().chain([("auto_gate", "false")]);
        let settings = Settings::from_texts(all).unwrap();
        load(&self.path(name), &settings).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    fn put(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    fn written(&self, name: &str, capture: &Capture) -> Loaded {
        self.put(name, npz_of(capture));
        self.loaded(name, &[])
    }
}

/// The file that numpy writes: ours is refused for wrong counts.
fn npz_of(capture: &Capture) -> Vec<u8> {
    let (pairs, [nx, ny]) = (capture.pair_count(), capture.scan);
    let h = transpose(&capture.histograms, pairs, capture.bins).unwrap();
    let points: Vec<f64> = capture.laser.iter().flat_map(|p| p.to_array()).collect();
    let points = || Array::from_f64(&[nx, ny, 3], &points);
    let arrays = [
        ("H", Array::from_f32(&[capture.bins, nx, ny], &h)),
        ("laser_xyz", points()),
        ("sensor_xyz", points()),
        ("delta_t", Array::from_f64(&[], &[capture.bin_width])),
    ];
    npz_bytes(&arrays).unwrap()
}

#[track_caller]
fn assert_same(found: &Capture, wanted: &Capture) {
    assert_eq!((found.scan, found.bins), (wanted.scan, wanted.bins));
    assert!(found.histograms == wanted.histograms, "other counts");
    let moved = found.laser.iter().zip(&wanted.laser).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(
        moved < 1e-9 && (found.bin_width / wanted.bin_width - 1.0).abs() < 1e-6,
        "{moved} {}",
        found.bin_width
    );
}

#[track_caller]
fn assert_noted(loaded: &Loaded, words: &[&str]) {
    let notes = loaded.notes.join("\n");
    assert!(words.iter().all(|word| notes.contains(word)), "{words:?} are not in\n{notes}");
}

/// Rows of a matrix are points in the order of a scan.
fn of_points(name: &str) -> Matrix {
    let right = scene();
    matrix(name, &[SIDE * SIDE, BINS], |at| f64::from(histogram(&right, pair_of(at[0]))[at[1]]))
}

#[test]
fn a_proper_capture_has_no_note_of_a_fault() {
    let place = Place::new();
    let loaded = place.written("proper.npz", &scene());
    assert!(
        loaded.dropped == 0 && loaded.warnings.is_empty() && loaded.faults.is_empty(),
        "{:?}",
        loaded.warnings
    );
    for word in ["multiples", "enlarged", "backwards", "missing ones", "left out:", "began again"] {
        assert!(!loaded.notes.iter().any(|note| note.contains(word)), "{:?}", loaded.notes);
    }
}

#[test]
fn a_matrix_of_pairs_and_bins() {
    let place = Place::new();
    let rows = of_points("Confocal_signal");
    let columns = rows.reversed();
    place.put("rows.mat", matlab5(std::slice::from_ref(&rows), Stored::Compressed));
    place.put("columns.mat", matlab5(std::slice::from_ref(&columns), Stored::Plain));
    hdf5(&place.path("rows73.mat"), std::slice::from_ref(&rows));
    hdf5(&place.path("columns.h5"), std::slice::from_ref(&rows));
    for name in ["rows.mat", "columns.mat", "rows73.mat", "columns.h5"] {
        let advice = place.refused(name, &[]);
        assert!(
            advice.contains("Confocal_signal is a matrix of") && advice.contains("--scan 16x16"),
            "{advice}"
        );
        assert_same(&place.follow(&advice, &[("FILE", &place.name(name))]), &scene());
    }
}

/// Histograms as long as those of PicoQuant's instruments, and lists of coordinates beside a matrix, show its axes.
#[test]
fn the_axes_of_a_matrix_follow_from_long_histograms_and_lists_beside_it() {
    let place = Place::new();
    let data = |bins: usize| matrix("data", &[16, bins], |at| ((at[0] + at[1]) % 7) as f64);
    hdf5(&place.path("long.h5"), &[data(1 << 16)]);
    assert!(place.refused("long.h5", &[]).contains("--scan 4x4 "));
    place.put(
        "long.npz",
        npz_bytes(&[("data", Array::from_f32(&[16, 1 << 16], &vec![1.0; 1 << 20]))]).unwrap(),
    );
    assert!(place.refused("long.npz", &[]).contains(r#"H = np.moveaxis(np.load("FILE")["data"], -1, 0)"#));
    let lists = [("xpos", 8), ("zpos", 2)].map(|(name, n)| matrix(name, &[1, n], |at| at[1] as f64));
    hdf5(&place.path("lists.h5"), &[&[data(144)][..], &lists].concat());
    assert!(place.refused("lists.h5", &[]).contains("--scan 8x2 "));
}

#[test]
fn what_a_newcomer_types_leads_on() {
    let place = Place::new();
    let right = scene();
    let points: Vec<f64> = right.laser.iter().flat_map(|p| p.to_array()).collect();
    let points = || Array::from_f64(&[SIDE, SIDE, 3], &points);
    let h = transpose(&right.histograms, SIDE * SIDE, BINS).unwrap();
    let arrays =
        [("H", Array::from_f32(&[BINS, SIDE, SIDE], &h)), ("laser_xyz", points()), ("sensor_xyz", points())];
    place.put("no_width.npz", npz_bytes(&arrays).unwrap());
    assert!(place.refused("no_width.npz", &[]).contains("--bin-width 32ps"));
    assert!(place.refused("no_width.npz", &["--bin-width", "20"]).contains("--bin-width 20ps"));
    assert_same(&place.loaded("no_width.npz", &[("bin_width", "32ps")]).capture, &right);
    // The distance that `info` prints is that of the option.
    let said = succeed(&["info", &place.name("no_width.npz"), "--bin-width", "32ps"]);
    assert!(said.contains("outermost points 1.0000 m apart: the wall size to give"), "{said}");
    assert!(
        place
            .loaded("no_width.npz", &[("bin_width", "32ps"), ("wall", "70cm")])
            .notes
            .join(" ")
            .contains("are 0.7 m apart")
    );
    // Coordinates in cells are not to be joined into counts.
    let cells: Vec<_> = (0..9).map(|k| matrix("", &[1, 3], |at| (k * at[1]) as f64)).collect();
    place.put("cells.mat", matlab_file(&[matlab_cell("positions", &cells)], Stored::Compressed));
    assert!(place.refused("cells.mat", &[]).contains("positions is a MATLAB cell array of coordinates"));
    // The longest of three axes comes first.
    place.put("cube.npz", npz_bytes(&[("H", Array::from_f32(&[4, 4, 48], &[1.0; 768]))]).unwrap());
    assert!(place.refused("cube.npz", &[]).contains(r#"H = np.moveaxis(np.load("FILE")["H"], -1, 0)"#));
    // A line of words is no line of numbers.
    place.put("words.txt", format!("a b c d\n{}", "1 2 3 4\n".repeat(20)));
    assert!(place.refused("words.txt", &[]).contains(r#"if s.lstrip()[:1] in "+-.0123456789""#));
    place.put("zones.csv", format!("sep=,\n#RAWBIN,{}\n#RAW000,0,1,2\n", "0,1,2"));
    assert!(place.refused("zones.csv", &[]).contains(".json.gz"));
}

#[test]
fn cells_of_columns_and_of_arrival_times() {
    let place = Place::new();
    let right = scene();
    let cell = |name: &str, as_row: bool| {
        let element = |point: usize| {
            let counts = histogram(&right, pair_of(point)).to_vec();
            let dims = if as_row { [1, BINS] } else { [BINS, 1] };
            matrix("", &dims, |at| f64::from(counts[at[0].max(at[1])]))
        };
        matlab_cell(name, &(0..SIDE * SIDE).map(element).collect::<Vec<_>>())
    };
    let more = matlab_cell("names", &[scalar("", 1.0)]);
    for (as_row, axis) in [(false, 2), (true, 1)] {
        for stored in [Stored::Plain, Stored::Compressed] {
            place.put("cells.mat", matlab_file(&[cell("signals", as_row), more.clone()], stored));
            let advice = place.refused("cells.mat", &[]);
            let words = format!("H = cat({axis}, signals{{:}}); save('counts.mat', 'H')");
            assert!(
                advice.contains(&words) && advice.contains("names, signals are 2 MATLAB cell arrays"),
                "{advice}"
            );
            // What MATLAB then saves.
            let rows = of_points("H");
            let made = if as_row { rows } else { rows.reversed() };
            place.put("counts.mat", matlab5(&[made], Stored::Compressed));
            let advice = place.refused("counts.mat", &[]);
            assert_same(&place.follow(&advice, &[("FILE", &place.name("counts.mat"))]), &right);
        }
    }
    // Arrival times of a few photons a pixel, none in some: histcounts in bins of 32 ps.
    let few = changed(&right, |c| c.histograms.iter_mut().for_each(|v| *v = (*v / 40.0).floor()));
    let times = |point: usize| {
        let row = histogram(&few, pair_of(point));
        let all = row.iter().enumerate().flat_map(|(bin, n)| vec![(bin as f64 + 0.5) * 32e-12; *n as usize]);
        all.collect::<Vec<f64>>()
    };
    let element = |point: usize| {
        let all = times(point);
        matrix("", &[all.len(), 1], |at| all[at[0]])
    };
    let elements: Vec<_> = (0..SIDE * SIDE).map(element).collect();
    place.put("times.mat", matlab_file(&[matlab_cell("toa", &elements)], Stored::Compressed));
    let advice = place.refused("times.mat", &[]);
    assert!(advice.contains("histcounts(t, e), toa(:)") && advice.contains("e = 0:32e-12:max("), "{advice}");
    let most = (0..SIDE * SIDE).flat_map(times).fold(0.0, f64::max);
    let bins = ((most + 32e-12) / 32e-12).floor() as usize;
    let counted = matrix("H", &[SIDE * SIDE, bins], |at| {
        let edge = |bin: usize| bin as f64 * 32e-12;
        times(at[0]).iter().filter(|t| (edge(at[1])..edge(at[1] + 1)).contains(t)).count() as f64
    });
    place.put("counts.mat", matlab5(&[counted], Stored::Plain));
    let advice = place.refused("counts.mat", &[]);
    let made = place.follow(&advice, &[("FILE", &place.name("counts.mat"))]);
    for pair in 0..SIDE * SIDE {
        assert!(histogram(&made, pair) == &histogram(&few, pair)[..bins], "{pair}");
    }
}

#[test]
fn pictures_and_volumes_are_no_captures() {
    let place = Place::new();
    let pixels = Array::from_f32(&[40, 60, 3], &vec![1.0; 40 * 60 * 3]);
    place.put("photo.npy", pixels.to_npy());
    place.put("photo.npz", npz_bytes(&[("arr_0", pixels)]).unwrap());
    place.put("photo.mat", matlab5(&[matrix("frame", &[40, 60, 3], |at| at[0] as f64)], Stored::Plain));
    place.put("scan.mat", b"\x89PNG\r\n\x1a\n and more");
    for name in ["photo.npy", "photo.npz", "photo.mat", "scan.mat"] {
        let advice = place.refused(name, &["--wall", "1m", "--bin-width", "32ps"]);
        assert!(
            advice.contains("a picture") && advice.contains("give the histograms of the scan"),
            "{advice}"
        );
    }
    let right = scene();
    // (y, x, t) with rows from the top and columns from the left.
    let named = |name: &str| {
        matrix(name, &[SIDE, SIDE, BINS], |at| {
            let pair = (SIDE - 1 - at[1]) * SIDE + SIDE - 1 - at[0];
            f64::from(histogram(&right, pair)[at[2]])
        })
    };
    let given = [("wall", "1m"), ("bin_width", "32ps")];
    for name in ["volume", "recon_vol2", "albedo"] {
        place.put("result.mat", matlab5(&[named(name)], Stored::Plain));
        let advice = place.refused("result.mat", &["--wall", "1m", "--bin-width", "32ps"]);
        assert!(
            advice.contains("reconstructed volume") && advice.contains(&format!("--array {name}")),
            "{advice}"
        );
        let loaded = place.loaded("result.mat", &[&given[..], &[("array", name)]].concat());
        assert_same(&loaded.capture, &right);
    }
    place.put("data.mat", matlab5(&[named("resolved")], Stored::Plain));
    assert_same(&place.loaded("data.mat", &given).capture, &right);
    place.put("result.npz", npz_bytes(&[("volume", Array::from_f32(&[8, 8, 8], &[1.0; 512]))]).unwrap());
    assert!(place.refused("result.npz", &[]).contains("give the capture that it was made from"));
    // Distances and speeds beside the counts are no points.
    let beside = [
        named("counts3"),
        matrix("laser_distances", &[SIDE * SIDE, 3], |_| 1.5),
        matrix("light_speed", &[3, 1], |_| 3e8),
        scalar("sensor_range", 4.0),
    ];
    place.put("beside.mat", matlab5(&beside, Stored::Compressed));
    assert_same(&place.loaded("beside.mat", &given).capture, &right);
}

#[test]
fn a_text_table_of_times_and_counts() {
    let place = Place::new();
    let right = scene();
    let points: String = (0..SIDE * SIDE)
        .map(|point| {
            let p = right.laser[pair_of(point)];
            format!("{},{},{}\n", p.x, p.y, p.z)
        })
        .collect();
    place.put("points.csv", points);
    let table = |points: usize| -> String {
        let line = |bin: usize| {
            let counts = (0..points).map(|p| format!(",{}", histogram(&right, pair_of(p))[bin]));
            format!("{:.3}{}\n", 0.032 * bin as f64, counts.collect::<String>())
        };
        (0..BINS).map(line).collect()
    };
    for head in ["", "# time and counts\n", "time_ns,channel 1,channel 2\n"] {
        place.put("table.csv", format!("{head}{}", table(SIDE * SIDE)));
        let advice = place.refused("table.csv", &[]);
        assert!(advice.contains("a table of times and counts, one histogram a column"), "{advice}");
        let words = [("FILE", place.name("table.csv")), ("POINTS", place.name("points.csv"))];
        let made = place.follow(&advice, &words.each_ref().map(|(a, b)| (*a, b.as_str())));
        assert_eq!((made.pair_count(), made.bins), (SIDE * SIDE, BINS));
        for (pair, point) in made.laser.iter().enumerate() {
            let of = right.laser.iter().position(|p| p.distance(*point) < 1e-6).unwrap();
            assert!(histogram(&made, pair) == histogram(&right, of), "{pair}");
        }
    }
    // Two columns of counts are no channel and time, but numbers, channels and times of tags are.
    place.put("table.csv", table(2));
    assert!(place.refused("table.csv", &[]).contains("one histogram a column"));
    let tags: String = (0..200).map(|i| format!("{i},{},{}\n", i % 2, 1000 * i)).collect();
    place.put("tags.csv", tags);
    assert!(!stderr(&thirdbounce(&["info", &place.name("tags.csv")])).contains("one histogram a column"));
}

#[test]
fn archives_with_a_folder_or_packed_by_others() {
    let place = Place::new();
    let right = scene();
    place.put("right.npz", npz_of(&right));
    let mut npz = thirdbounce::files::archive::Npz::open(&place.path("right.npz")).unwrap();
    let all = npz.names().into_iter().map(|name| {
        let array = npz.get(&name).unwrap().unwrap();
        (name, array.to_npy())
    });
    let all: Vec<(String, Vec<u8>)> = all.collect();
    let inside: Vec<_> =
        all.iter().map(|(name, bytes)| (format!("scan 7/{name}.npy"), bytes.clone())).collect();
    let mut files: Vec<_> = inside.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
    place.put("folder.npz", stored_zip(&files));
    assert_same(&place.loaded("folder.npz", &[]).capture, &right);
    files.push(("__MACOSX/scan 7/._H.npy", vec![0; 40]));
    place.put("folder.npz", stored_zip(&files));
    assert_same(&place.loaded("folder.npz", &[]).capture, &right);
    // Method 12 is bzip2, 14 is LZMA: their entries are named, with numpy's line.
    for method in [12, 14] {
        let mut bytes = std::fs::read(place.path("folder.npz")).unwrap();
        for at in 0..bytes.len() - 12 {
            let from = match &bytes[at..at + 4] {
                b"PK\x03\x04" => 8,
                b"PK\x01\x02" => 10,
                _ => continue,
            };
            bytes[at + from] = method;
        }
        place.put("packed.npz", bytes);
        let advice = place.refused("packed.npz", &[]);
        let line = r#"np.savez_compressed("capture.npz", **np.load("FILE"))"#;
        assert!(advice.contains("pack it again") && advice.contains(line), "{advice}");
    }
}

#[test]
fn a_digitiser_upside_down_in_counts_and_volts() {
    let place = Place::new();
    let right = scene();
    let mut noise = fixtures::files::noise(4);
    for (factor, baseline) in [(-1.0, 0.0), (-0.001, 0.0), (-0.001, 0.013), (-0.001, -0.2)] {
        let volts = changed(&right, |c| {
            let mut read = |v: f32| factor * v + baseline + 1e-3 * ((noise() % 5) as f32 - 2.0);
            c.histograms.iter_mut().for_each(|v| *v = read(*v));
            c.integer_counts = false;
        });
        place.put("volts.npz", npz_of(&volts));
        let advice = match baseline > 0.0 {
            true => place.loaded("volts.npz", &[]).warnings.join(" "),
            false => place.refused("volts.npz", &[]),
        };
        assert!(
            advice.contains("upside down") && advice.contains("H = np.median(H) - H"),
            "{baseline}: {advice}"
        );
        let mut sorted = volts.histograms.clone();
        sorted.sort_by(f32::total_cmp);
        let median = sorted[sorted.len() / 2];
        let upright = changed(&volts, |c| c.histograms.iter_mut().for_each(|v| *v = median - *v));
        assert!(place.written("mended.npz", &upright).warnings.is_empty());
        let mended = place.loaded("mended.npz", &[]).capture;
        let peak = |c: &Capture, pair: usize| {
            let row = histogram(c, pair);
            (0..row.len()).max_by(|a, b| row[*a].total_cmp(&row[*b])).unwrap() as f64 * c.bin_width
                + c.t_start
        };
        for pair in [0, 77, 255] {
            assert!((peak(&mended, pair) - peak(&right, pair)).abs() < 1.5 * WIDTH, "{pair}");
        }
    }
}

#[test]
fn fill_values_multiples_and_a_reversed_axis() {
    let place = Place::new();
    let right = scene();
    let gated = place.written("right.npz", &right).capture;
    for fill in [999_999.0, -9999.0] {
        let filled = changed(&right, |c| {
            for pair in [18, 19, 20, 130] {
                c.histograms[pair * BINS + 100..(pair + 1) * BINS].fill(fill);
            }
            c.integer_counts = fill > 0.0;
        });
        let loaded = place.written("filled.npz", &filled);
        assert_eq!(loaded.capture.pair_count(), SIDE * SIDE - 4);
        assert_noted(
            &loaded,
            &["4 of 256 pairs are left out", &format!("hold {fill}"), "in place of missing ones"],
        );
    }
    // In every histogram, as of bins that a gate left out: the error's line.
    for fill in [999_999.0, -9999.0] {
        let filled = changed(&right, |c| {
            c.histograms.chunks_exact_mut(BINS).for_each(|row| row[..20].fill(fill));
            c.integer_counts = fill > 0.0;
        });
        place.put("all.npz", npz_of(&filled));
        assert!(place.refused("all.npz", &[]).contains(&format!("H[H == {fill}] = 0")));
        let mended =
            changed(&filled, |c| c.histograms.iter_mut().filter(|v| **v == fill).for_each(|v| *v = 0.0));
        let loaded = place.written("mended.npz", &mended);
        assert!(loaded.capture.histograms == mended.histograms && loaded.warnings.is_empty());
    }
    let shifted = changed(&right, |c| c.histograms.iter_mut().for_each(|v| *v *= 16.0));
    let loaded = place.written("shifted.npz", &shifted);
    assert_noted(&loaded, &["multiples of 16"]);
    assert_same(&loaded.capture, &gated);
    let backwards = changed(&right, |c| c.histograms.chunks_exact_mut(BINS).for_each(<[f32]>::reverse));
    let loaded = place.written("backwards.npz", &backwards);
    assert_noted(&loaded, &["the time axis runs backwards", "H = H[::-1]"]);
    assert_same(&loaded.capture, &gated);
}

#[test]
fn enlarged_scans_lose_their_copies() {
    let place = Place::new();
    let right = scene();
    let half = right.stride(2).unwrap();
    // Every point twice along both axes, on a wall of the same size.
    let twice = changed(&right, |c| {
        let from = |pair: usize| pair / SIDE / 2 * (SIDE / 2) + pair % SIDE / 2;
        c.histograms = (0..SIDE * SIDE).flat_map(|pair| histogram(&half, from(pair)).to_vec()).collect();
    });
    let loaded = place.written("twice.npz", &twice);
    assert_noted(&loaded, &["192 of 256 pairs are left out", "copies of the one beside", "8 x 8 points"]);
    assert_eq!(loaded.capture.scan, [8, 8]);
    assert!((loaded.capture.laser[0] - dvec3(-7.0, -7.0, 0.0) / 15.0).length() < 1e-9);
    // Lines between, as imresize and zoom make them.
    let lines = 2 * SIDE - 1;
    let at = |i: usize| i as f64 / (lines - 1) as f64 - 0.5;
    let points: Vec<DVec3> = (0..lines * lines).map(|p| dvec3(at(p / lines), at(p % lines), 0.0)).collect();
    let mean = |pair: usize| -> Vec<f32> {
        let [x, y] = [pair / lines, pair % lines].map(|i| [i / 2, i.div_ceil(2)]);
        let four = [x[0] * SIDE + y[0], x[0] * SIDE + y[1], x[1] * SIDE + y[0], x[1] * SIDE + y[1]];
        (0..BINS).map(|bin| four.iter().map(|p| histogram(&right, *p)[bin]).sum::<f32>() / 4.0).collect()
    };
    let counts = (0..lines * lines).flat_map(mean).collect();
    let zoomed = Capture::new([lines; 2], points.clone(), points, BINS, WIDTH, counts);
    let loaded = place.written("zoomed.npz", &zoomed);
    assert_noted(&loaded, &["705 of 961 pairs are left out", "means of the two beside", "16 x 16 points"]);
    assert_eq!(loaded.capture.scan, [SIDE; 2]);
    assert!(loaded.capture.laser.iter().zip(&right.laser).all(|(a, b)| a.distance(*b) < 1e-9));
}

#[test]
fn structs_of_keys_and_axes_that_matlab_drops() {
    let place = Place::new();
    let right = scene();
    let (x, y) = (|p: usize| right.laser[p * SIDE].x, |p: usize| right.laser[p].y);
    let points = |name: &str| matrix(name, &[SIDE, SIDE, 3], |at| [x(at[0]), y(at[1]), 0.0][at[2]]);
    let h = matrix("H", &[BINS, SIDE, SIDE], |at| f64::from(histogram(&right, at[1] * SIDE + at[2])[at[0]]));
    let keys = [h, points("laser_xyz"), points("sensor_xyz"), scalar("delta_t", WIDTH)];
    for stored in [Stored::Plain, Stored::Compressed] {
        place.put("struct.mat", matlab5_struct("capture", &keys, stored));
        assert_same(&place.loaded("struct.mat", &[]).capture, &right);
    }
    let inside: Vec<_> =
        keys.iter().map(|m| Matrix { name: format!("capture/{}", m.name), ..m.clone() }).collect();
    hdf5(&place.path("struct73.mat"), &inside);
    assert_same(&place.loaded("struct73.mat", &[]).capture, &right);
    // Other variables beside the struct, and two structs.
    let fields: Vec<_> = keys
        .iter()
        .map(|m| (m.name.as_str(), matlab_matrix(&Matrix { name: String::new(), ..m.clone() }, false)))
        .collect();
    let one = |name: &str| fixtures::files::matlab_struct(name, &fields);
    place.put(
        "beside.mat",
        matlab_file(&[one("day1"), matlab_matrix(&scalar("fs", 1.0), false)], Stored::Plain),
    );
    assert_same(&place.loaded("beside.mat", &[]).capture, &right);
    place.put("two.mat", matlab_file(&[one("day1"), one("day2")], Stored::Plain));
    let advice = place.refused("two.mat", &[]);
    assert!(advice.contains("save('capture.mat', '-struct', 'day1')"), "{advice}");
    // H [T, Lx, Ly, Sx, 1] with sensor points [Sx, 1, 3]: MATLAB stores (T, Lx, Ly, Sx).
    let sensors = 4;
    let count = |t: usize, lx: usize, ly: usize, s: usize| ((t * 7 + lx * 5 + ly * 3 + s) % 11) as f64;
    let all = [
        matrix("H", &[40, 3, 2, sensors], |at| count(at[0], at[1], at[2], at[3])),
        matrix("laser_xyz", &[3, 2, 3], |at| [0.1 * at[0] as f64, 0.1 * at[1] as f64, 0.0][at[2]]),
        matrix("sensor_xyz", &[sensors, 1, 3], |at| [0.2 * at[0] as f64, 0.0, 0.0][at[2]]),
        scalar("delta_t", WIDTH),
    ];
    place.put("dropped.mat", matlab5(&all, Stored::Compressed));
    let found = read(&place.path("dropped.mat")).unwrap();
    assert_eq!((found.pair_count(), found.bins), (3 * 2 * sensors, 40));
    for pair in 0..found.pair_count() {
        let (laser, s) = (pair / sensors, pair % sensors);
        let (lx, ly) = (laser / 2, laser % 2);
        assert_eq!(f64::from(histogram(&found, pair)[9]), count(9, lx, ly, s));
        assert!(found.laser[pair].distance(dvec3(0.1 * lx as f64, 0.1 * ly as f64, 0.0)) < 1e-12);
        assert!(found.sensor[pair].distance(dvec3(0.2 * s as f64, 0.0, 0.0)) < 1e-12);
    }
    // A single row: H [T, X, 1] with points [X, 1, 3].
    let all = [
        matrix("H", &[40, 6], |at| count(at[0], at[1], 0, 0)),
        matrix("laser_xyz", &[6, 1, 3], |at| [0.1 * at[0] as f64, 0.0, 0.0][at[2]]),
        matrix("sensor_xyz", &[6, 1, 3], |at| [0.1 * at[0] as f64, 0.0, 0.0][at[2]]),
        scalar("delta_t", WIDTH),
    ];
    place.put("row.mat", matlab5(&all, Stored::Plain));
    assert_eq!(read(&place.path("row.mat")).unwrap().pair_count(), 6);
}

/// Tags of a laser of 30 MHz and of a detector that sees a direct peak and light behind it: (channel, picoseconds).
fn tags(laser: i32, detector: i32) -> Vec<(i32, i64)> {
    let mut random = fixtures::files::noise(9);
    let mut all = vec![];
    for pulse in 0..160_000i64 {
        let time = 500 + pulse * 33_333;
        all.push((laser, time));
        match random() % 20 {
            0 => all.push((detector, time + 4000 + (random() % 60) as i64)),
            1 => all.push((detector, time + 9000 + (random() % 3000) as i64)),
            // Dark counts.
            2 => all.push((detector, time + (random() % 33_000) as i64)),
            _ => {}
        }
    }
    all.sort_by_key(|(_, time)| *time);
    all
}

fn csv(tags: &[(i32, i64)]) -> String {
    tags.iter().map(|(channel, time)| format!("{channel},{time}\n")).collect()
}

#[test]
fn the_channel_of_the_laser_is_the_regular_one() {
    let place = Place::new();
    let scan = [("SIZE", "1m"), ("COLUMNSxROWS", "4x4"), ("N", "10000")];
    place.put("usual.csv", csv(&tags(0, 1)));
    let shown = succeed(&["info", &place.name("usual.csv")]);
    assert!(shown.contains("30.0003 MHz") && !shown.contains("--sync-channel"), "{shown}");
    let wanted = place.follow(&shown, &scan);
    for (laser, detector) in [(1, 0), (2, 1), (3, 0)] {
        place.put("tags.csv", csv(&tags(laser, detector)));
        let shown = succeed(&["info", &place.name("tags.csv")]);
        assert!(
            shown.contains("30.0003 MHz") && shown.contains(&format!("--sync-channel {laser} ")),
            "{laser}, {detector}: {shown}"
        );
        assert_same(&place.follow(&shown, &scan), &wanted);
    }
    // Markers of a scanner are regular, too.
    let mut marked = tags(2, 0);
    marked.extend((0..160).map(|point| (7, 400 + point * 1000 * 33_333)));
    marked.sort_by_key(|(_, time)| *time);
    place.put("marked.csv", csv(&marked));
    let shown = succeed(&["info", &place.name("marked.csv")]);
    assert!(shown.contains("--sync-channel 2 --marker-channels 7"), "{shown}");
    // Read by the number, photons are no laser: a note says so.
    let taken = histogram_of(&place, "tags.csv", "500", &["--zero", "0ps"], "wrong.npz");
    assert!(stderr(&taken).contains("not regular"), "{}", stderr(&taken));
}

/// `histogram` of tags over a scan of 4 x 4 points.
fn histogram_of(place: &Place, tags: &str, pulses: &str, more: &[&str], out: &str) -> Output {
    let [tags, out] = [tags, out].map(|name| place.name(name));
    let all = ["histogram", &tags, "--scan", "4x4", "--wall", "1m", "--pulses-per-point", pulses];
    thirdbounce(&[&all[..], more, &["--out", &out]].concat())
}

#[test]
fn counters_that_begin_again_in_tags() {
    let place = Place::new();
    let all = tags(0, 1);
    let run = |name: &str, more: &[&str]| {
        let out = place.name("made.npz");
        let taken = histogram_of(&place, name, "10000", more, "made.npz");
        assert!(taken.status.success(), "{name}: {}", stderr(&taken));
        (read(Path::new(&out)).unwrap(), stderr(&taken))
    };
    place.put("right.csv", csv(&all));
    let (right, notes) = run("right.csv", &[]);
    assert!(!notes.contains("begin again"), "{notes}");
    // 5.3 ms in ticks of a picosecond: 2^30 is 1.07 ms.
    for bits in [30, 28] {
        let wrapped: Vec<_> = all.iter().map(|(channel, time)| (*channel, time % (1 << bits))).collect();
        place.put("wrapped.csv", csv(&wrapped));
        let (made, notes) = run("wrapped.csv", &[]);
        let times = all.last().unwrap().1 >> bits;
        assert!(notes.contains(&format!("(2^{bits}), {times} times")), "{notes}");
        assert_same(&made, &right);
        let [channels, times] = [|t: &(i32, i64)| i64::from(t.0), |t: &(i32, i64)| t.1]
            .map(|of| wrapped.iter().map(of).collect::<Vec<_>>());
        let n = [wrapped.len()];
        let arrays =
            [("timestamps", Array::from_i64(&n, &times)), ("channels", Array::from_i64(&n, &channels))];
        place.put("wrapped.npz", npz_bytes(&arrays).unwrap());
        assert_same(&run("wrapped.npz", &[]).0, &right);
    }
    // In another unit: 2^20 ns.
    let coarse: Vec<_> = all.iter().map(|(channel, time)| (*channel, time / 1000)).collect();
    place.put("coarse.csv", csv(&coarse));
    let unit = ["--tag-unit", "1ns", "--zero", "4ns"];
    let (right, _) = run("coarse.csv", &unit);
    let wrapped: Vec<_> = coarse.iter().map(|(channel, time)| (*channel, time % (1 << 20))).collect();
    place.put("coarse.csv", csv(&wrapped));
    let (made, notes) = run("coarse.csv", &unit);
    assert!(notes.contains("(2^20), 5 times"), "{notes}");
    assert_same(&made, &right);
    // A file sorted by channel is refused as before.
    let mut sorted = all.clone();
    sorted.sort_by_key(|(channel, time)| (*channel, *time));
    place.put("sorted.csv", csv(&sorted));
    let taken = histogram_of(&place, "sorted.csv", "10000", &[], "none.npz");
    assert!(stderr(&taken).contains("not in the order of time"), "{}", stderr(&taken));
}
