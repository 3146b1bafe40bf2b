//! What a user gets who gives a file and nothing else, over scenes that nobody chose: the random family of
//! `src/job/benchmark/family/mod.rs`, meshes of natural shapes, and real captures against the closed-form methods. Prints rows,
//! means and the worst tenth.
//!
//!     cargo bench --bench family -- [family|meshes|captures|all] [--seeds A..B] [--program PATH] [--keep DIR]
//!         [--sheet FILE.png] [-- OPTIONS OF reconstruct]
//!
//! | option | |
//! |---|---|
//! | `--seeds A..B` | seeds of the family; 0..20 if none are given |
//! | `--program PATH` | another build of the command |
//! | `--keep DIR` | keeps captures, truths and results of closed-form methods there, and takes them from there |
//! | `--sheet FILE.png` | writes pictures, a row for each case |
//!
//! THIRDBOUNCE_DATA names the folder of meshes and real captures. Develop on seeds 0..20; report others, and never look at
//! those before.

mod captures;
mod sheet;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use fixtures::command::stderr;
use fixtures::family::Case;
use serde_json::Value;
use sheet::Sheet;
use thirdbounce::export::npz::{read_maps, read_truth, write_truth};
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::{capture, measure};

/// What a run counts that fails or finds nothing: a depth error as a share of the wall, and a normal error in degrees.
const MISSED: (f64, f64) = (0.1, 90.0);

/// What the command line asks for.
struct Arguments {
    what: String,
    seeds: Range<u64>,
    program: PathBuf,
    keep: PathBuf,
    sheet: Option<PathBuf>,
    /// For `reconstruct`.
    options: Vec<String>,
}

/// A run that ended well.
struct Run {
    maps: Maps,
    report: Value,
    /// Seconds of all CPU cores: beside other programs it says more than the time on the clock.
    cpu: f64,
}

/// Figures of a run: intersection over union of its own mask and the best one, depth error as a share of the wall, normal
/// error in degrees (NaN if the true model has none), seconds of the solve, seconds of all CPU cores of the whole run.
type Figures = [f64; 6];

fn main() {
    let temporary = tempfile::tempdir().expect("a folder for temporary files");
    let arguments = arguments(temporary.path());
    let data = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from);
    let wanted = |what: &str| arguments.what == "all" || arguments.what == what;
    let mut sheet = Sheet::default();
    if wanted("family") {
        family(&arguments, &mut sheet);
    }
    if let Some(data) = data.as_ref().filter(|_| wanted("meshes")) {
        meshes(&arguments, data, &mut sheet);
    }
    if let Some(data) = data.as_ref().filter(|_| wanted("captures")) {
        captures::all(&arguments, data, &mut sheet);
    }
    if let Some(file) = &arguments.sheet {
        sheet.write(file);
    }
}

fn arguments(temporary: &Path) -> Arguments {
    let mut all = Arguments {
        what: "all".into(),
        seeds: 0..20,
        program: env!("CARGO_BIN_EXE_thirdbounce").into(),
        keep: temporary.into(),
        sheet: None,
        options: vec![],
    };
    // cargo adds --bench.
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    while let Some(word) = words.next() {
        let mut value = || words.next().unwrap_or_else(|| panic!("{word} needs a value"));
        match word.as_str() {
            "--seeds" => {
                let text = value();
                let ends = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
                let (from, to) = ends.unwrap_or_else(|| panic!("{text} is not A..B"));
                all.seeds = from..to;
            }
            "--program" => all.program = value().into(),
            "--keep" => all.keep = value().into(),
            "--sheet" => all.sheet = Some(value().into()),
            "--" => all.options = words.by_ref().collect(),
            "family" | "meshes" | "captures" | "all" => all.what = word,
            _ => panic!("{word} is none of family, meshes, captures, all"),
        }
    }
    all
}

impl Arguments {
    /// Reconstructs a capture with the options of the command line and these.
    fn reconstruct(&self, capture: &Path, options: &[&str]) -> Option<Run> {
        let out = tempfile::tempdir().expect("a folder for a result");
        let own: Vec<&str> = self.options.iter().map(String::as_str).collect();
        self.run(capture, out.path(), &[options, &own].concat())
    }

    /// Reconstructs a capture with these options alone. `None` if that fails.
    fn run(&self, capture: &Path, out: &Path, options: &[&str]) -> Option<Run> {
        let files = ["reconstruct", text(capture), "--out", text(out), "--no-preview", "-q"];
        let before = cpu_of_children();
        let output =
            Command::new(&self.program).args(files).args(options).output().expect("the command runs");
        if !output.status.success() {
            let said = stderr(&output);
            eprintln!("{}: {}", capture.display(), said.lines().next().unwrap_or("failed"));
            return None;
        }
        read_run(out).map(|run| Run { cpu: cpu_of_children() - before, ..run })
    }
}

/// Seconds of all CPU cores of the programs that this one started and that ended; 0 where the system does not tell.
fn cpu_of_children() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit_once(") ").map_or("", |s| s.1).split(' ').skip(13).take(2);
    fields.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// The result in a folder, if there is one.
fn read_run(folder: &Path) -> Option<Run> {
    let report = serde_json::from_slice(&std::fs::read(folder.join("report.json")).ok()?).expect("a report");
    Some(Run { maps: read_maps(&folder.join("maps.npz")).ok()?, report, cpu: 0.0 })
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of ASCII letters")
}

fn number(report: &Value, path: &str) -> f64 {
    report.pointer(path).and_then(Value::as_f64).unwrap_or(0.0)
}

impl Run {
    fn seconds(&self) -> f64 {
        number(&self.report, "/totals/solve_s")
    }

    fn trials(&self) -> f64 {
        number(&self.report, "/settings/trials_s")
    }

    fn model(&self) -> &str {
        self.report.pointer("/settings/model").and_then(Value::as_str).unwrap_or("–")
    }
}

/// The figures of a run before a wall of `wall` metres.
fn figures(run: Option<&Run>, truth: &Truth, wall: f64, has_normals: bool) -> Figures {
    let m = run.map(|run| measure::metrics(&run.maps, truth, None).expect("maps to measure"));
    let m = m.unwrap_or_default();
    [
        m.iou.unwrap_or(0.0),
        m.best_iou.unwrap_or(0.0),
        m.depth_mae.map_or(MISSED.0, |v| v / wall),
        if has_normals { m.normal_error_deg.unwrap_or(MISSED.1) } else { f64::NAN },
        run.map_or(0.0, Run::seconds),
        run.map_or(0.0, |run| run.cpu),
    ]
}

/// The end of a row.
fn cells([iou, best, depth, normal, seconds, cpu]: Figures, wall: f64, trials: Option<f64>) -> String {
    let mm = if wall > 0.0 { format!("{:.1} mm, ", 1e3 * wall * depth) } else { String::new() };
    let trials = trials.map_or(String::new(), |t| format!(" ({t:.1})"));
    let normal = if normal.is_nan() { "–".into() } else { format!("{normal:.1}°") };
    let share = 100.0 * depth;
    format!("{iou:.3} ({best:.3}) | {mm}{share:.2} % | {normal} | {seconds:.1}{trials} | {cpu:.1}")
}

const HEAD: &str =
    "true / chosen model | IoU of own mask (best) | depth MAE | normals | seconds (trials) | CPU s |";

/// Means, and means over the worst tenth of each figure, at least two.
fn summary(all: &[Figures], right: usize) {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let column = |k: usize| -> Vec<f64> { all.iter().map(|f| f[k]).filter(|v| !v.is_nan()).collect() };
    let worst = |k: usize| {
        let mut values = column(k);
        values.sort_by(f64::total_cmp);
        // Of overlaps the smallest, of errors and times the largest.
        if k > 1 {
            values.reverse();
        }
        values.truncate(all.len().div_ceil(10).max(2));
        mean(&values)
    };
    let means = std::array::from_fn(|k| mean(&column(k)));
    println!("| | **mean** | {right} of {} models right | {} |", all.len(), cells(means, 0.0, None));
    println!("| | **worst tenth** | | {} |", cells(std::array::from_fn(worst), 0.0, None));
}

fn family(arguments: &Arguments, sheet: &mut Sheet) {
    println!("\n| seed | scene | {HEAD}\n|---|---|---|---|---|---|---|---|");
    let (mut all, mut right) = (vec![], 0);
    for seed in arguments.seeds.clone() {
        let case = Case::of(seed);
        let [capture, truth] = simulated(arguments, &case);
        let truth = read_truth(&truth).expect("a truth");
        let mut run = arguments.reconstruct(&capture, &[]);
        run.iter_mut().for_each(|run| case.without_back(&mut run.maps));
        let (wall, model) = (case.scene.wall, case.scene.reflectance.name());
        let row = Row { name: seed.to_string(), words: case.words, model, wall };
        right += row.judge(run.as_ref(), &truth, &mut all, sheet);
    }
    summary(&all, right);
}

/// Capture and truth of a case, from the folder of what is kept if they are there.
fn simulated(arguments: &Arguments, case: &Case) -> [PathBuf; 2] {
    // Another generator makes other files.
    let mut hash = DefaultHasher::new();
    format!("{case:?}").hash(&mut hash);
    let folder = arguments.keep.join(format!("family/{}-{:016x}", case.scene.seed, hash.finish()));
    let files = ["capture.npz", "truth.npz"].map(|name| folder.join(name));
    if !files[1].exists() {
        std::fs::create_dir_all(&folder).expect("a folder");
        capture::write(&case.capture().expect("a capture"), &files[0]).expect("a file");
        write_truth(&files[1], &case.truth().expect("a truth")).expect("a file");
    }
    files
}

/// A case with truth.
struct Row {
    name: String,
    words: String,
    model: &'static str,
    wall: f64,
}

impl Row {
    /// Prints the row. Returns 1 if the model is the true one.
    fn judge(self, run: Option<&Run>, truth: &Truth, all: &mut Vec<Figures>, sheet: &mut Sheet) -> usize {
        let figures = figures(run, truth, self.wall, self.model != "retroreflective");
        let chosen = run.map_or("failed", Run::model);
        let cells = cells(figures, self.wall, Some(run.map_or(0.0, Run::trials)));
        println!("| {} | {} | {} / {chosen} | {cells} |", self.name, self.words, self.model);
        all.push(figures);
        sheet.judged(&format!("{}: {}", self.name, self.words), run.map(|run| &run.maps), truth, figures[0]);
        usize::from(chosen == self.model)
    }
}

fn meshes(arguments: &Arguments, data: &Path, sheet: &mut Sheet) {
    println!("\n| mesh | scene | {HEAD}\n|---|---|---|---|---|---|---|---|");
    let (mut all, mut right) = (vec![], 0);
    for name in ["bear2", "bust2", "soap"] {
        let folder = arguments.keep.join("meshes");
        std::fs::create_dir_all(&folder).expect("a folder");
        let [capture, truth] = ["capture", "truth"].map(|what| folder.join(format!("{name}-{what}.npz")));
        if !truth.exists() {
            let mesh = data.join(format!("meshes/{name}.obj"));
            let files = ["simulate", text(&mesh), "--out", text(&capture), "--truth", text(&truth)];
            let options = ["--model", "lambertian", "--scan", "32", "--noise", "0.02", "-q"];
            let done = Command::new(&arguments.program).args(files).args(options).output();
            assert!(done.is_ok_and(|done| done.status.success()), "{} is not simulated", mesh.display());
        }
        let run = arguments.reconstruct(&capture, &[]);
        let words = "confocal 32², 1 m, exact".into();
        let row = Row { name: name.into(), words, model: "lambertian", wall: 1.0 };
        right += row.judge(run.as_ref(), &read_truth(&truth).expect("a truth"), &mut all, sheet);
    }
    summary(&all, right);
}
