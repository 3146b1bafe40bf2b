//! What a user gets who gives a file and nothing else: every simulated scene with every model of reflectance, every kind
//! of pairs, and photons, and path-traced captures, reconstructed by the defaults. Prints the tables of docs/defaults.md
//! and docs/confidence.md.
//!
//!     cargo bench --bench defaults [-- WORD]     THIRDBOUNCE_DATA names the folder of captures with truth
//!
//! A word selects the rows whose name contains it.

use std::path::{Path, PathBuf};

use fixtures::command::{measured, succeed};
use thirdbounce::export::report;
use thirdbounce::measure::Metrics;

const MODELS: [(&str, &str); 3] =
    [("cosine", "cosine"), ("matt", "lambertian"), ("retroreflective", "retroreflective")];

/// Name, options of `simulate`; each is simulated with every model.
const SCENES: [(&str, &[&str]); 12] = [
    ("figure", &["figure"]),
    ("figure, one laser point", &["figure", "--pairs", "one-laser"]),
    ("figure, 8 x 8 laser points", &["figure", "--pairs", "exhaustive", "--grid", "8", "--scan", "8"]),
    ("figure, 100 photons", &["figure", "--photons", "100", "--dark", "0.1"]),
    ("figure, 10 photons", &["figure", "--photons", "10", "--dark", "0.1"]),
    ("figure, 1 photon", &["figure", "--photons", "1", "--dark", "0.1"]),
    ("torus", &["torus"]),
    ("torus, irregular pairs", &["torus", "--pairs", "irregular"]),
    ("torus, 10 photons", &["torus", "--photons", "10", "--dark", "0.1"]),
    ("spheres", &["spheres"]),
    ("letter R", &["letter-R"]),
    ("letters S and U", &["letters-SU"]),
];

/// Light from elsewhere, pulses, spots, layers: the cosine model alone.
const OTHERS: [(&str, &[&str]); 4] = [
    ("figure, pulse of 30 mm", &["figure", "--pulse", "0.03", "--hide-pulse"]),
    ("figure, spot of 60 mm", &["figure", "--spot", "0.06"]),
    ("plates, one behind the other", &["plates"]),
    (
        "figure and light from beyond the box, pulse with a tail, 1000 photons",
        &["beyond", "--photons", "1000", "--dark", "5", "--pulse", "0.03:0.012", "--hide-pulse"],
    ),
];

/// Path-traced captures: name, capture, truth.
const RENDERED: [[&str; 3]; 4] = [
    ["spheres, path-traced", "spheres_confocal_32.npz", "truth_spheres_confocal_32.npz"],
    ["letter Z, path-traced", "z_confocal_32.npz", "truth_z_confocal_32.npz"],
    ["letter Z, path-traced, curved wall", "z_bumpwall_confocal_32.npz", "truth_z_bumpwall_confocal_32.npz"],
    ["letter Z, path-traced, 64 x 64", "z_confocal_64.npz", "truth_z_confocal_64.npz"],
];

/// A capture with truth.
struct Case {
    name: String,
    model: &'static str,
    files: [PathBuf; 2],
}

/// What a run reports.
struct Run {
    model: String,
    seconds: f64,
    trials: f64,
    metrics: Metrics,
}

fn main() {
    let word = std::env::args().skip(1).find(|a| !a.starts_with("--")).unwrap_or_default();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    println!("| scene | true model | chosen | mask's IoU (best) | depth MAE | normals | seconds (trials) |");
    println!("|---|---|---|---|---|---|---|");
    let mut quarters = vec![];
    let mut losses = vec![];
    for case in simulated(folder.path(), &word).chain(rendered(&word)) {
        let run = solve(&case, &[]);
        println!("| {} | {} | {} |", case.name, plain(case.model), figures(&run));
        if run.model != case.model {
            let named = solve(&case, &["--model", case.model]);
            println!("| | | named: {} |", figures(&named));
        }
        losses.push(run.metrics.best_iou.unwrap_or(0.0) - run.metrics.iou.unwrap_or(0.0));
        quarters.push(confidence(&case, &run));
    }
    let count = losses.len().max(1) as f64;
    let mean = losses.iter().sum::<f64>() / count;
    let beyond = losses.iter().filter(|l| **l > 0.03).count();
    println!(
        "\nThe mask is {mean:.3} below the best one on average, more than .03 in {beyond} of {count}.\n"
    );
    println!("| scene | depth MAE | within | most certain quarter | second | third | least certain |");
    println!("|---|---|---|---|---|---|---|");
    quarters.iter().for_each(|row| println!("{row}"));
}

/// Simulates one case after the other into `folder`.
fn simulated<'a>(folder: &'a Path, word: &'a str) -> impl Iterator<Item = Case> + 'a {
    let all = SCENES.iter().flat_map(|scene| MODELS.map(|model| (scene, model)));
    all.chain(OTHERS.iter().map(|scene| (scene, MODELS[0])))
        .filter(move |((name, _), (plain, _))| format!("{name}, {plain}").contains(word))
        .map(|((name, options), (_, model))| {
            let files = ["capture.npz", "truth.npz"].map(|name| folder.join(name));
            let out = ["--out", text(&files[0]), "--truth", text(&files[1]), "--noise", "0.015", "-q"];
            succeed(&[&["simulate"], *options, &["--reflectance", model], &out[..]].concat());
            Case { name: (*name).to_string(), model, files }
        })
}

fn rendered(word: &str) -> impl Iterator<Item = Case> + '_ {
    let data = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from);
    let selected = move |row: &&[&str; 3]| row[0].contains(word);
    RENDERED.iter().filter(selected).filter_map(move |[name, capture, truth]| {
        let files = [data.as_ref()?.join(capture), data.as_ref()?.join(truth)];
        Some(Case { name: (*name).to_string(), model: "lambertian", files })
    })
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of ASCII letters")
}

fn plain(model: &str) -> &str {
    MODELS.iter().find(|m| m.1 == model).map_or(model, |m| m.0)
}

fn solve(case: &Case, options: &[&str]) -> Run {
    let out = tempfile::tempdir().expect("a folder for a result");
    let [capture, truth] = &case.files;
    let files = ["reconstruct", text(capture), "--truth", text(truth), "--out", text(out.path())];
    let arguments = [&files[..], &["--trace-every", "0", "--no-preview", "-q"], options].concat();
    measured(Path::new(env!("CARGO_BIN_EXE_thirdbounce")), &arguments);
    let report = report::read(&out.path().join("report.json")).expect("a report");
    Run {
        model: report.settings["model"].as_str().expect("a model").to_string(),
        seconds: report.totals.solve_s,
        trials: report.settings["trials_s"].as_f64().expect("seconds of trials"),
        metrics: report.metrics.expect("figures"),
    }
}

fn mm(metres: Option<f64>) -> String {
    metres.map_or("–".into(), |v| format!("{:.2} mm", 1e3 * v))
}

fn figures(run: &Run) -> String {
    let m = &run.metrics;
    let two = |v: Option<f64>| v.unwrap_or(f64::NAN);
    let normals = m.normal_error_deg.map_or("–".into(), |v| format!("{v:.1}°"));
    format!(
        "{} | {:.3} ({:.3}) | {} | {normals} | {:.1} ({:.1})",
        plain(&run.model),
        two(m.iou),
        two(m.best_iou),
        mm(m.depth_mae),
        run.seconds,
        run.trials
    )
}

/// The row of one capture: each quarter of its pixels with its median confidence and the share of errors within.
fn confidence(case: &Case, run: &Run) -> String {
    let m = &run.metrics;
    let of = |[told, within]: &[f64; 2]| format!("{}: {within:.2}", mm(Some(*told)));
    let quarters: Vec<String> = m.calibration.iter().map(of).collect();
    format!(
        "| {}, {} | {} | {:.2} | {} |",
        case.name,
        plain(case.model),
        mm(m.depth_mae),
        m.within_confidence.unwrap_or(f64::NAN),
        quarters.join(" | ")
    )
}
