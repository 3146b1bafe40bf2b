//! Positions of measured objects with truth, as docs/data.md and docs/track.md make them of the authors' files: `cheapspad` (the MATLAB
//! files of CheapSPAD) and `active-corner` (the repository of the active corner camera) in the folder of captures.

use std::path::{Path, PathBuf};
use std::process::Command;

use fixtures::command::succeed;
use serde_json::Value;

/// A script of docs/data.md by its first line, run with these arguments.
fn run(script: &str, args: &[&Path]) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/data.md");
    let page = std::fs::read_to_string(page).unwrap();
    let start = format!("```python\n# {script} ");
    let text = page.split_once(&start).and_then(|(_, rest)| rest.split_once("```")).expect("the script").0;
    let python = std::env::var_os("THIRDBOUNCE_PYTHON").map_or("python3".into(), PathBuf::from);
    let text = format!("# {text}");
    let output = Command::new(python).args(["-c", &text]).args(args).output().expect("Python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Position and standard deviations of the only object of each frame.
fn positions(folder: &Path) -> Vec<[[f64; 3]; 2]> {
    let report: Value = serde_json::from_slice(&std::fs::read(folder.join("track.json")).unwrap()).unwrap();
    let three = |value: &Value| [0, 1, 2].map(|k| value[k].as_f64().unwrap());
    let of_frame = |frame: &Value| {
        let blob = &frame["blobs"][0];
        [three(&blob["position_m"]), three(&blob["sigma_m"])]
    };
    report["frames"].as_array().unwrap().iter().map(of_frame).collect()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Root mean square of a coordinate, and shares within one and two standard deviations, of 60 positions that the calibration did not see.
pub fn calibrated_zones_have_the_errors_that_they_say(data: &Path) {
    for (name, most) in
        [("bigtarget_nomirrors", 0.20), ("smalltarget_nomirrors", 0.28), ("smalltarget_mirrors", 0.20)]
    {
        let file = data.join("cheapspad").join(name).with_extension("mat");
        if !file.exists() {
            eprintln!("skipped: there is no {}", file.display());
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        run("zones.py", &[&file, &at("zones")]);
        let [train, test] = ["train", "test"].map(|part| at("zones").join(part));
        let truth = |part: &Path| part.with_extension("csv");
        let (out, calibration) = (at("calibration"), at("calibration/calibration.json"));
        succeed(&[
            "track",
            text(&train),
            "--calibrate",
            text(&truth(&train)),
            "--out",
            text(&out),
            "--quiet",
        ]);
        succeed(&[
            "track",
            text(&test),
            "--calibration",
            text(&calibration),
            "--blobs",
            "1",
            "--out",
            text(&at("track")),
            "--quiet",
        ]);
        let lines = std::fs::read_to_string(truth(&test)).unwrap();
        let truths =
            lines.lines().map(|l| l.split(',').map(|n| n.parse::<f64>().unwrap()).collect::<Vec<_>>());
        let (mut squares, mut within) = ([0.0; 3], [0.0; 2]);
        for (truth, [at, sigma]) in truths.zip(positions(&at("track"))) {
            for k in 0..3 {
                squares[k] += (at[k] - truth[k]).powi(2) / 60.0;
                let sizes = (at[k] - truth[k]).abs() / sigma[k];
                (0..2).for_each(|n| within[n] += f64::from(u8::from(sizes < (n + 1) as f64)) / 180.0);
            }
        }
        let error = (squares.iter().sum::<f64>() / 3.0).sqrt();
        println!("{name}: {error:.3} m, x y z {:.3?}, within {within:.3?}", squares.map(f64::sqrt));
        assert!(error < most, "{name}: {error}");
        assert!((0.55..0.80).contains(&within[0]) && within[1] > 0.88, "{name}: {within:?}");
    }
}

/// Ranges and angles of an upright facet on a floor, which an edge hides from some pixels.
pub fn upright_facets_behind_an_edge_are_where_they_stand(data: &Path) {
    let source = data.join("active-corner");
    if !source.exists() {
        eprintln!("skipped: there is no {}", source.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    run("corner.py", &[&source, &at("corner")]);
    let found = |sweep: &str| {
        let (frames, empty) = (at("corner").join(sweep), at("corner").join(format!("empty-{sweep}.npz")));
        let args = ["--shape", "upright", "--model", "lambertian", "--edge", "0,0,180", "--gate", ":4"];
        let given = ["track", text(&frames), "--empty", text(&empty), "--blobs", "1", "--quiet"];
        succeed(&[&given[..], &args, &["--out", text(&at(sweep))]].concat());
        let polar = |[[x, y, _], _]: &[[f64; 3]; 2]| [x.hypot(*y), y.atan2(*x).to_degrees()];
        positions(&at(sweep)).iter().map(polar).collect::<Vec<_>>()
    };
    let ranges = found("range");
    println!("{ranges:.3?}");
    for (k, [range, angle]) in ranges.iter().enumerate() {
        assert!((range - 0.25 * (k + 2) as f64).abs() < 0.15 && (angle - 90.0).abs() < 8.0, "{ranges:?}");
    }
    let angles = found("angular");
    println!("{angles:.3?}");
    // Middles of the facets of the authors' own results with frames of 60 s: the files have no true angles.
    let theirs = [56.0, 58.6, 66.4, 72.9, 78.7, 84.2, 89.4, 94.9, 100.8, 106.7, 111.6, 119.1, 123.0, 128.6];
    assert_eq!(angles.len(), theirs.len());
    for ([range, angle], theirs) in angles.iter().zip(theirs) {
        assert!((range - 1.25).abs() < 0.15 && (angle - theirs).abs() < 8.0, "{angles:?}");
    }
}
