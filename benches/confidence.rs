//! How true the confidence is: simulated scenes and captures with truth, reconstructed by the defaults. Prints a table
//! as in docs/confidence.md.
//!
//!     cargo bench --bench confidence [-- WORD]     THIRDBOUNCE_DATA names the folder of captures with truth
//!
//! A word selects the rows whose name contains it.

use std::path::{Path, PathBuf};

use fixtures::command::{measured, succeed};
use thirdbounce::export::report;

/// Name, options of `simulate`, options of `reconstruct`.
type Row = (&'static str, &'static [&'static str], &'static [&'static str]);

const SIMULATED: [Row; 21] = [
    ("figure", &["figure"], &[]),
    ("figure, matt", &["figure", "--model", "lambertian"], &[]),
    ("figure, retroreflective", &["figure", "--model", "retroreflective"], &[]),
    ("figure, 100 photons", &["figure", "--photons", "100", "--dark", "0.1"], &[]),
    ("figure, 10 photons", &["figure", "--photons", "10", "--dark", "0.1"], &[]),
    ("figure, 1 photon", &["figure", "--photons", "1", "--dark", "0.1"], &[]),
    ("figure, pulse of 30 mm", &["figure", "--pulse", "0.03"], &[]),
    ("figure, spot of 60 mm", &["figure", "--spot", "0.06"], &[]),
    ("figure, one laser point", &["figure", "--pairs", "one-laser"], &[]),
    ("figure, 8 x 8 laser points", &["figure", "--pairs", "exhaustive", "--grid", "8", "--scan", "8"], &[]),
    ("figure, 64 pixels", &["figure"], &["--lateral", "64"]),
    ("figure, volume only", &["figure"], &["--surface-iterations", "0"]),
    ("figure, paper's solver", &["figure"], &["--solver", "paper", "--lateral", "32", "--iterations", "40"]),
    ("torus", &["torus"], &[]),
    ("torus, matt, 10 photons", &["torus", "--model", "lambertian", "--photons", "10", "--dark", "0.1"], &[]),
    ("torus, irregular pairs", &["torus", "--pairs", "irregular"], &[]),
    ("spheres", &["spheres"], &[]),
    ("spheres, matt", &["spheres", "--model", "lambertian"], &[]),
    ("letter R", &["letter-R"], &[]),
    ("letter R, 10 photons", &["letter-R", "--photons", "10", "--dark", "0.1"], &[]),
    ("plates, one behind the other", &["plates"], &[]),
];

/// Path-traced captures: name, capture, truth.
const RENDERED: [[&str; 3]; 4] = [
    ["spheres, path-traced", "spheres_confocal_32.npz", "truth_spheres_confocal_32.npz"],
    ["letter Z, path-traced", "z_confocal_32.npz", "truth_z_confocal_32.npz"],
    ["letter Z, path-traced, curved wall", "z_bumpwall_confocal_32.npz", "truth_z_confocal_32.npz"],
    ["letter Z, path-traced, 64 x 64", "z_confocal_64.npz", "truth_z_confocal_64.npz"],
];

fn main() {
    let word = std::env::args().skip(1).find(|a| !a.starts_with("--")).unwrap_or_default();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let [capture, truth] = ["capture.npz", "truth.npz"].map(|name| folder.path().join(name));
    println!("| scene | depth MAE | within | most certain quarter | second | third | least certain |");
    println!("|---|---|---|---|---|---|---|");
    for (name, scene, options) in SIMULATED.iter().filter(|row| row.0.contains(&word)) {
        let files = ["--out", text(&capture), "--truth", text(&truth), "--noise", "0.015", "-q"];
        succeed(&[&["simulate"], *scene, &files[..]].concat());
        row(name, &capture, &truth, options);
    }
    let Some(data) = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from) else { return };
    for [name, capture, truth] in RENDERED.iter().filter(|row| row[0].contains(&word)) {
        row(name, &data.join(capture), &data.join(truth), &[]);
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of ASCII letters")
}

/// Prints the figures of one capture: each quarter with its median confidence and the share of errors within.
fn row(name: &str, capture: &Path, truth: &Path, options: &[&str]) {
    let out = tempfile::tempdir().expect("a folder for a result");
    let files = ["reconstruct", text(capture), "--truth", text(truth), "--out", text(out.path())];
    let arguments = [&files[..], &["--trace-every", "0", "-q"], options].concat();
    measured(Path::new(env!("CARGO_BIN_EXE_thirdbounce")), &arguments);
    let found = report::read(&out.path().join("report.json")).expect("a report").metrics.expect("figures");
    let mm = |v: f64| format!("{:.2} mm", 1e3 * v);
    let quarters: Vec<String> =
        found.calibration.iter().map(|[told, within]| format!("{}: {within:.2}", mm(*told))).collect();
    println!(
        "| {name} | {} | {:.2} | {} |",
        mm(found.depth_mae.unwrap_or(f64::NAN)),
        found.within_confidence.unwrap_or(f64::NAN),
        quarters.join(" | ")
    );
}
