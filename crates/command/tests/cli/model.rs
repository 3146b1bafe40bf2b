//! The model of reflectance, estimated if unspecified.

use std::path::Path;

use fixtures::command::{stderr, succeed, thirdbounce};
use serde_json::Value;

/// Options that make a run short and repeat its bits. So few pairs do not tell the models apart by fast light alone. Pixels much wider
/// than bins would look like an impulse response.
const SHORT: [&str; 9] =
    ["--lateral", "64", "--iterations", "10", "--support", "fixed", "--high-pass", "0", "--deterministic"];

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("the file is there")).expect("it is JSON")
}

/// A folder with scenes of 12 x 12 points and bins of 1 cm: as few pairs as tell the models apart.
struct Figures(tempfile::TempDir);

impl Figures {
    fn new() -> Figures {
        Figures(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    /// Simulates a figure that reflects so, with laser and sensor that see areas of this width. Returns its capture and
    /// its truth.
    fn simulated(&self, reflectance: &str, spot: f64) -> [String; 2] {
        // Spots take many more samples.
        let noise = if spot > 0.0 { "0.05" } else { "0.02" };
        self.simulated_scene("figure", reflectance, &["--noise", noise, "--spot", &spot.to_string()])
    }

    fn simulated_scene(&self, scene: &str, reflectance: &str, more: &[&str]) -> [String; 2] {
        let files =
            [self.path(&format!("{reflectance}.npz")), self.path(&format!("{reflectance}_truth.npz"))];
        let usual = ["simulate", scene, "--scan", "12", "--bin-width", "0.01", "--quiet"];
        let rest = ["--out", &files[0], "--truth", &files[1], "--reflectance", reflectance];
        succeed(&[&usual[..], &rest, more].concat());
        files
    }

    /// Reconstructs into a folder of that name. Returns the report and what was said.
    fn solved(&self, capture: &str, name: &str, more: &[&str]) -> (Value, String) {
        let out = self.path(name);
        let output = thirdbounce(&[&["reconstruct", capture, "--out", &out], &SHORT[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let (report, said) = (json(&Path::new(&out).join("report.json")), stderr(&output));
        // What was said stands in the report, too.
        let notes = report["settings"]["notes"].to_string();
        for note in said.lines().filter_map(|line| line.strip_prefix("note: ")) {
            assert!(notes.contains(note), "{note}: {notes}");
        }
        (report, said)
    }
}

/// The models that were tried, with the shares of squares that they left.
fn tried(report: &Value) -> Vec<(String, f64)> {
    let trials = report["settings"]["model_found"]["trials"].as_array().expect("trials").clone();
    let of = |t: &Value| (t[0].as_str().expect("a model").to_string(), t[2].as_f64().expect("a share"));
    trials.iter().map(of).collect()
}

#[test]
fn trials_find_how_a_surface_reflects() {
    let figures = Figures::new();
    for reflectance in ["cosine", "lambertian"] {
        let [capture, _] = figures.simulated(reflectance, 0.0);
        // One is asked for by the option, the other by default.
        let auto: &[&str] = if reflectance == "cosine" { &["--model", "auto"] } else { &[] };
        let (report, said) = figures.solved(&capture, reflectance, auto);
        assert!(said.contains(&format!("the model of reflectance: {reflectance}, by trials")), "{said}");
        let settings = &report["settings"];
        for key in ["model", "reflectance"] {
            assert_eq!(settings[key], reflectance, "{key}");
        }
        assert_eq!(settings["model_found"]["reflectance"], reflectance);
        let tried = tried(&report);
        let models: Vec<&str> = tried.iter().map(|t| &t.0[..]).collect();
        // At last a pulse with the best model.
        assert_eq!(models, ["cosine", "lambertian", "retroreflective", reflectance]);
        assert!(settings["pulse_found"].is_null(), "paths are sharp: {said}");
        let own = tried.iter().find(|t| t.0 == reflectance).unwrap().1;
        assert!(tried[..3].iter().all(|t| t.1 >= 0.98 * own && t.1 < 1.0), "{tried:?}");
        // The trials are part of the time.
        let trials = settings["trials_s"].as_f64().unwrap();
        let trace = report["trace"].as_array().unwrap();
        assert!(trials > 0.0 && trace.iter().all(|p| p["seconds"].as_f64().unwrap() > trials));
        assert!(report["totals"]["solve_s"].as_f64().unwrap() > trials);
    }
}

#[test]
#[ignore = "long: make soak"]
fn a_pulse_that_shows_is_found_and_the_model_with_it() {
    let figures = Figures::new();
    let pulse = ["--noise", "0.02", "--pulse", "0.06", "--hide-pulse"];
    let [capture, _] = figures.simulated_scene("figure", "cosine", &pulse);
    let (report, said) = figures.solved(&capture, "found", &[]);
    assert_eq!(report["settings"]["model"], "cosine", "{said}");
    let fwhm = report["settings"]["pulse_found"]["fwhm"].as_f64().expect("a pulse");
    assert!((fwhm / 0.06 - 1.0).abs() < 0.2, "{fwhm}");
    // Not estimated if set to none.
    let (report, _) = figures.solved(&capture, "none", &["--pulse", "none", "--stride", "2"]);
    assert!(report["settings"]["pulse_found"].is_null() && !tried(&report).is_empty());
}

#[test]
fn a_plan_tells_of_the_trials_and_a_named_model_skips_them() {
    let figures = Figures::new();
    let [capture, _] = figures.simulated("lambertian", 0.0);
    let notes = |more: &[&str]| -> String {
        let text = succeed(&[&["info", &capture, "--json"], &SHORT[..], more].concat());
        serde_json::from_str::<Value>(&text).unwrap()["notes"].to_string()
    };
    for auto in [&[][..], &["--model", "auto"], &["--solver", "paper", "--model", "auto"]] {
        // Options of the surface solver alone are no options of the paper's.
        let reported = match auto {
            ["--solver", ..] => succeed(&[&["info", &capture, "--lateral", "32"], auto].concat()),
            _ => notes(auto),
        };
        assert!(reported.contains("a run tries models first"), "{auto:?}: {reported}");
    }
    assert!(!notes(&["--model", "cosine"]).contains("tries models"));
    let paper = succeed(&["info", &capture, "--lateral", "32", "--solver", "paper"]);
    assert!(!paper.contains("tries models"), "the paper has its own model: {paper}");
    let (report, said) = figures.solved(&capture, "named", &["--model", "cosine"]);
    assert!(!said.contains("by trials"), "{said}");
    assert!(report["settings"]["model_found"].is_null());
    assert_eq!(
        (&report["settings"]["model"], &report["settings"]["trials_s"]),
        (&"cosine".into(), &0.0.into())
    );
}

#[test]
fn a_few_pairs_cannot_tell_the_model() {
    let figures = Figures::new();
    let [capture, _] = figures.simulated("lambertian", 0.0);
    for pairs in ["1", "31"] {
        let (report, said) = figures.solved(&capture, pairs, &["--subset", pairs]);
        let reported = format!("cosine is taken: estimates need 32 pairs, the capture has {pairs}");
        assert!(said.contains(&reported), "{said}");
        assert_eq!(report["settings"]["model"], "cosine");
    }
    let (report, said) = figures.solved(&capture, "32", &["--subset", "32"]);
    assert!(tried(&report).len() >= 3 && said.contains("by trials"), "{said}");
}

#[test]
#[ignore = "long: make soak"]
fn trials_know_the_spot() {
    let figures = Figures::new();
    // As wide as two steps of the scan.
    let [capture, _] = figures.simulated("lambertian", 0.16);
    // Without its spot, a pulse would explain the capture nearly as well.
    let (report, _) = figures.solved(&capture, "with", &["--pulse", "none"]);
    let (without, _) = figures.solved(&capture, "without", &["--pulse", "none", "--spot", "none"]);
    let least = |r: &Value| tried(r).iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
    assert!(least(&report) < 0.8 * least(&without), "{} {}", least(&report), least(&without));
}
