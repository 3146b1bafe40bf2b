//! Logs of a TMF8829 and of a VL53L8CH, written after the documented layouts: as sums, single readings and frames, and damaged.

use std::io::Write;
use std::path::{Path, PathBuf};

use fixtures::captures::assert_error;
use fixtures::command::{fail, stderr, succeed, thirdbounce};
use serde_json::{Value, json};
use thirdbounce::Kind;
use thirdbounce::capture::read;
use thirdbounce_tags::{Asked, Readings, Scan, histogram};

/// Readings and bins of a log; those of the sensor have filler behind.
const READINGS: usize = 3;
const BINS: usize = 64;
const USED: usize = 54;

/// Counts of a zone: the wall at a bin of its own, and an object 5 bins behind, which is brighter in each reading.
fn count(reading: usize, row: usize, column: usize, bin: usize) -> u32 {
    let wall = 10 + (row + column) / 8;
    match bin {
        _ if bin >= USED => 0,
        _ if bin == wall => 900,
        _ if bin == wall + 5 => 100 * (reading as u32 + 1) + (row + 2 * column) as u32,
        _ => (bin & 3 == 0) as u32,
    }
}

fn reading(number: usize, sides: [usize; 2]) -> Value {
    let zone = |row: usize, column: usize| json!({"bin": (0..BINS).map(|bin| count(number, row, column, bin)).collect::<Vec<_>>()});
    let rows: Vec<Value> =
        (0..sides[0]).map(|row| (0..sides[1]).map(|column| zone(row, column)).collect()).collect();
    let reference = json!({"bin": vec![7; BINS]});
    json!({"info": {"frame_number": number}, "ref_histo": vec![reference; 8], "mp_histo": rows})
}

fn log() -> Value {
    let readings: Vec<Value> = (0..READINGS).map(|number| reading(number, [16, 16])).collect();
    json!({
        "configuration": {"bin_shift": 2, "fp_mode": 2, "histogram_bins": 218, "histograms": 1},
        "info": [{"fw version": [1, 0, 0, 0]}],
        "Result_Set": readings,
    })
}

fn packed(text: &str) -> Vec<u8> {
    let mut gzip = flate2::write::GzEncoder::new(vec![], flate2::Compression::fast());
    gzip.write_all(text.as_bytes()).unwrap();
    gzip.finish().unwrap()
}

fn scan() -> Scan {
    Scan::grid([16, 16], 1.0, false).unwrap()
}

fn place(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn a_log_of_a_tmf8829_is_a_sum_a_reading_or_frames() {
    let folder = tempfile::tempdir().unwrap();
    let text = serde_json::to_string_pretty(&log()).unwrap();
    // Plain, packed, and as the values that a running logger appends.
    let parts = log();
    let mut appended = format!("{}\n{}\n", json!({"time": "now"}), parts["configuration"]);
    parts["Result_Set"]
        .as_array()
        .unwrap()
        .iter()
        .for_each(|one| appended += &format!("{}\n", json!({"Result_Set": one})));
    let files = [
        place(folder.path(), "log.json", text.as_bytes()),
        place(folder.path(), "log.json.gz", &packed(&text)),
        place(folder.path(), "log.txt", appended.as_bytes()),
    ];
    let strongest = |c: &thirdbounce::Capture, pair: usize, behind: usize| {
        let zero = (-c.t_start / c.bin_width).round() as usize;
        c.histogram(pair)[zero + behind - 1..zero + behind + 2].iter().copied().fold(0.0, f32::max)
    };
    for file in &files {
        let asked = Asked { readings: Readings::Each, ..Asked::default() };
        let made = histogram(file, &scan(), &asked).unwrap();
        let sum = &made.capture;
        assert_eq!((sum.scan, sum.pair_count(), made.readings.len()), ([16, 16], 256, READINGS));
        // Four bins of 200 ps.
        assert!((sum.bin_width / (800.0 * thirdbounce::capture::METRES_PER_PICOSECOND) - 1.0).abs() < 1e-9);
        for (number, reading) in made.readings.iter().enumerate() {
            assert_eq!((&reading.laser, reading.t_start, reading.bins), (&sum.laser, sum.t_start, sum.bins));
            assert_eq!(strongest(reading, 0, 0), 900.0);
            assert_eq!(strongest(reading, 0, 5), 100.0 * (number as f32 + 1.0));
        }
        assert_eq!(strongest(sum, 0, 5), 600.0);
        // Columns along x, rows along y.
        assert_eq!(strongest(&made.readings[0], 16 * 3 + 2, 5), 100.0 + 2.0 + 6.0);
        assert!(
            made.notes
                .iter()
                .any(|note| note.contains("3 readings of 16 x 16 zones, 54 bins; its reference"))
        );
        let one =
            histogram(file, &scan(), &Asked { readings: Readings::One(2), ..Asked::default() }).unwrap();
        assert_eq!(one.capture.histograms, made.readings[2].histograms);
    }

    // By the command: a sum, one reading, frames, and positions of the frames.
    let at = |name: &str| folder.path().join(name).display().to_string();
    let args = ["histogram", &at("log.json.gz"), "--scan", "16x16", "--wall", "1.2m"];
    let output = thirdbounce(&[&args[..], &["--out", &at("sum.npz")]].concat());
    assert!(
        output.status.success() && stderr(&output).contains("the 3 readings of the log are added up"),
        "{output:?}"
    );
    succeed(&[&args[..], &["--reading", "1", "--out", &at("one.npz")]].concat());
    assert_eq!(strongest(&read(Path::new(&at("one.npz"))).unwrap(), 0, 5), 200.0);
    let text = succeed(&[&args[..], &["--each-reading", "--out", &at("frames")]].concat());
    assert!(text.contains("frames: 3 captures"), "{text}");
    succeed(&["track", &at("frames"), "--blobs", "1", "--quiet", "--out", &at("track")]);
    let table = std::fs::read_to_string(at("track/track.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + READINGS, "{table}");
    fail(&[&args[..], &["--reading", "3", "--out", &at("x.npz")]].concat(), 1, "has 3 readings");
    fail(
        &["reconstruct", &at("log.json"), "--out", &at("x")],
        1,
        "a log of a TMF8829, without the wall points",
    );
    assert!(!Path::new(&at("x.npz")).exists() && !Path::new(&at("x")).exists());
}

#[test]
fn a_damaged_log_is_one_error() {
    let folder = tempfile::tempdir().unwrap();
    let text = serde_json::to_string(&log()).unwrap();
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut all = log();
        change(&mut all);
        serde_json::to_string(&all).unwrap()
    };
    let row = |number: usize| reading(number, [16, 16])["mp_histo"][0].clone();
    let cases: [(Vec<u8>, &str); 7] = [
        (text.as_bytes()[..text.len() / 2].to_vec(), "damaged or ends early"),
        (packed(&text)[..5000].to_vec(), "damaged or ends early"),
        (
            changed(&|all| all["Result_Set"][1] = reading(1, [8, 16])).into_bytes(),
            "reading 1 of the log has other zones",
        ),
        (changed(&|all| all["Result_Set"] = json!([{"results": []}])).into_bytes(), "has no histograms"),
        (changed(&|all| all["configuration"]["bin_shift"] = json!(40)).into_bytes(), "joins bins by 2^40"),
        (
            changed(&|all| {
                for number in 0..READINGS {
                    for at in 0..16 {
                        let zone = row(number)[at].clone();
                        all["Result_Set"][number]["mp_histo"][at] = vec![zone; 16].into();
                    }
                }
            })
            .into_bytes(),
            "all zones of a row of the log have the same histogram",
        ),
        (
            json!({"configuration": {"bin_shift": 2}, "frames": [{}]}).to_string().into_bytes(),
            "halves of a reading",
        ),
    ];
    for (bytes, why) in cases {
        let path = place(folder.path(), "log.json", &bytes);
        assert_error(histogram(&path, &scan(), &Asked::default()), Kind::Input, &["log.json", why]);
    }
    let path = place(folder.path(), "log.json", text.as_bytes());
    let other = Scan::grid([8, 8], 1.0, false).unwrap();
    assert_error(histogram(&path, &other, &Asked::default()), Kind::Input, &["does not fit 64 points"]);
}

#[test]
fn histograms_of_a_vl53l8ch_are_read_as_table_and_as_text() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    // Fractions without ambient light: a wall and an object 6 bins behind.
    let value = |reading: usize, zone: usize, bin: usize| match bin {
        3 => 800.5,
        9 => 20.5 + zone as f64 + reading as f64,
        _ => 0.5 - (bin % 3) as f64,
    };
    let names: Vec<String> =
        (0..64).flat_map(|zone| (0..24).map(move |bin| format!("cnh__hist_bin_{bin}_a{zone}"))).collect();
    let mut table = format!("frame,{}\n", names.join(","));
    let mut text = String::from("Sensor and CNH configured, ranging started\n");
    for reading in 0..2 {
        table += &reading.to_string();
        text += "Ranging Results:\n";
        for zone in 0..64 {
            text += &format!("Aggregate {zone}, Ambient: 3.5, Bins: ");
            for bin in 0..24 {
                table += &format!(",{}", value(reading, zone, bin));
                text += &format!("{:.1}, ", value(reading, zone, bin));
            }
            text += "\n";
        }
        table += "\n";
    }
    std::fs::write(at("data_1.csv"), table).unwrap();
    std::fs::write(at("serial.txt"), text).unwrap();
    let mut captures = vec![];
    for name in ["data_1.csv", "serial.txt"] {
        let args = ["histogram", &at(name), "--scan", "8x8", "--wall", "0.7m"];
        let out = at(&format!("{name}.npz"));
        fail(&[&args[..], &["--out", &out]].concat(), 1, "does not say how wide its bins are");
        let output = thirdbounce(&[&args[..], &["--bin-width", "250ps", "--out", &out]].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(stderr(&output).contains("2 readings of 64 zones, 24 bins"), "{}", stderr(&output));
        assert!(stderr(&output).contains("all are lifted by 1.5"), "{}", stderr(&output));
        captures.push(read(Path::new(&out)).unwrap());
    }
    let [table, text] = &captures[..] else { panic!("two captures") };
    assert_eq!(table.histograms, text.histograms);
    assert!(!table.integer_counts && table.scan == [8, 8], "{table:?}");
    let zero = (-table.t_start / table.bin_width).round() as usize;
    // Of two readings, lifted by 1.5 each, in the zone of column 2 and row 1.
    let object = table.histogram(2 * 8 + 1)[zero + 5..zero + 8].iter().copied().fold(0.0, f32::max);
    assert!((object - (2.0 * (20.5 + 10.0 + 1.5) + 1.0)).abs() < 0.01, "{object}");
    fail(
        &[
            "histogram",
            &at("serial.txt"),
            "--scan",
            "4x4",
            "--wall",
            "1m",
            "--bin-width",
            "1ns",
            "--out",
            &at("x.npz"),
        ],
        1,
        "does not fit 16 points",
    );
}
