//! Narrow bins: results over widths of bins, the rate of passes over pairs against the bench of the kernels, and depths of real
//! captures against those by their own bins. Prints tables of docs/narrow-bins.md.
//!
//!     cargo bench --bench bins [-- widths|rates|native]     THIRDBOUNCE_DATA names the folder of real captures
//!
//! Without a word everything but `native` is run.

mod scene;

use std::path::{Path, PathBuf};

use fixtures::command::measured;
use scene::{gpu, job, spent};
use serde_json::Value;
use thirdbounce::capture::{self, Capture};
use thirdbounce::export::npz::{read_maps, write_truth};
use thirdbounce::gpu::Schedule;
use thirdbounce::simulate::{RenderOptions, Scene, simulate, truth};
use thirdbounce::solve::{Accumulation, paper};

/// Real captures: name, file below THIRDBOUNCE_DATA, and the options for what the file lacks.
const REAL: [(&str, &str, &[&str]); 3] = [
    ("LCT exit sign, 4 ps", "native/lct_data_exit_sign.mat", &[]),
    ("LCT S and U, 4 ps", "native/lct_data_s_u.mat", &[]),
    ("letter Z, 5 ps", "native/z_v73.mat", &["--wall", "0.8", "--bin-width", "0.0015"]),
];

/// Widths of bins, as multiples of the first, 1 mm.
const WIDTHS: [usize; 6] = [1, 2, 3, 6, 12, 20];

fn main() {
    let word = std::env::args().skip(1).find(|a| !a.starts_with("--")).unwrap_or_default();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let data = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from);
    match (word.as_str(), data) {
        ("", _) => {
            widths(folder.path());
            rates(folder.path());
        }
        ("widths", _) => widths(folder.path()),
        ("rates", _) => rates(folder.path()),
        ("native", Some(data)) => native(&data, folder.path()),
        ("native", None) => eprintln!("error: set THIRDBOUNCE_DATA to the folder of real captures"),
        _ => eprintln!("error: {word} is none of widths, rates, native"),
    }
}

/// Runs `reconstruct` with no options but those given. Returns its seconds, those of reading and writing included, and the
/// report.
fn reconstruct(capture: &Path, out: &Path, options: &[&str]) -> (f64, Value) {
    let [capture, out_text] = [capture, out].map(|p| p.to_str().expect("a path of ASCII letters"));
    let arguments = [&["reconstruct", capture, "--out", out_text][..], options].concat();
    let (_, taken) = measured(Path::new(env!("CARGO_BIN_EXE_thirdbounce")), &arguments);
    let text = std::fs::read(out.join("report.json")).expect("a report");
    (taken.seconds, serde_json::from_slice(&text).expect("a report of JSON"))
}

fn of<'v>(report: &'v Value, path: &str) -> &'v Value {
    report.pointer(path).unwrap_or(&Value::Null)
}

fn number(report: &Value, path: &str) -> f64 {
    of(report, path).as_f64().unwrap_or(f64::NAN)
}

fn figures(report: &Value) -> String {
    format!(
        "{:.3} | {:.2} mm | {:.1} degrees",
        number(report, "/metrics/best_iou"),
        1e3 * number(report, "/metrics/depth_mae"),
        number(report, "/metrics/normal_error_deg"),
    )
}

/// Depths by the defaults against those of the captures' own bins, where both masks are.
fn native(data: &Path, folder: &Path) {
    println!(
        "| capture | time, own bins and defaults | median difference of depth | 90 of 100 below |\n|---|---|---|---|"
    );
    for (name, file, options) in &REAL {
        let outs = [folder.join("own"), folder.join("usual")];
        let own = [options, &["--bins", "native"][..]].concat();
        let run = |options: &[&str], out: &Path| reconstruct(&data.join(file), out, options).0;
        let times = [run(&own, &outs[0]), run(options, &outs[1])];
        let [own, usual] = outs.map(|out| read_maps(&out.join("maps.npz")).expect("maps"));
        let both = (0..own.depth.len()).filter(|&i| own.mask[i] && usual.mask[i]);
        let mut apart: Vec<f32> =
            both.map(|i| (own.depth[i] - usual.depth[i]).abs()).filter(|d| d.is_finite()).collect();
        apart.sort_by(f32::total_cmp);
        let at =
            |share: f64| 1e3 * apart.get((share * apart.len() as f64) as usize).copied().unwrap_or(f32::NAN);
        println!("| {name} | {:.0} s, {:.0} s | {:.2} mm | {:.2} mm |", times[0], times[1], at(0.5), at(0.9));
    }
}

/// A letter at 64 x 64 points, rendered with bins of 1 mm, in wider and wider bins of the same counts.
fn widths(folder: &Path) {
    println!("\n| bins | solve | bins, voxel | best IoU | depth | normals |\n|---|---|---|---|---|---|");
    let scene = Scene { scan: 64, bin_width: 0.001, ..Scene::named("letter-z").expect("a built-in scene") };
    let rendered =
        simulate(&scene, &RenderOptions { noise: 0.1, ..RenderOptions::default() }).expect("a capture");
    let [file, truth_file] = ["capture.npz", "truth.npz"].map(|name| folder.join(name));
    write_truth(&truth_file, &truth(&scene, 128).expect("a truth")).expect("a file");
    for sum in WIDTHS {
        let capture: Capture = rendered.capture.binned(sum).expect("bins to sum");
        capture::write(&capture, &file).expect("a file");
        let truth = truth_file.display().to_string();
        let (_, report) = reconstruct(&file, &folder.join("out"), &["--truth", &truth, "--trace-every", "0"]);
        println!(
            "| {sum} mm | {:.1} s | {}, {:.1} mm | {} |",
            number(&report, "/totals/solve_s"),
            of(&report, "/settings/bins_summed"),
            1e3 * number(&report, "/settings/depth_pitch"),
            figures(&report)
        );
    }
}

/// Pairs per second of the bench's forward and backward pass, and of those of a whole solve, in turns.
fn rates(folder: &Path) {
    let file = folder.join("figure.npz");
    let scene = Scene { scan: 64, ..Scene::named("figure").expect("a built-in scene") };
    let capture = simulate(&scene, &RenderOptions { noise: 0.02, ..RenderOptions::default() })
        .expect("a capture")
        .capture;
    capture::write(&capture, &file).expect("a file");
    let mut rows: [Vec<[f64; 2]>; 2] = [vec![], vec![]];
    for _ in 0..3 {
        rows[0].push(of_bench());
        rows[1].push(of_solve(&file, folder));
    }
    println!("\n| pass | bench | solve | share |\n|---|---|---|---|");
    for (at, name) in ["forward", "gather"].into_iter().enumerate() {
        let [bench, solve] = [0, 1].map(|k| scene::median(rows[k].iter().map(|r| r[at]).collect()));
        println!("| {name} | {:.0} M/s | {:.0} M/s | {:.2} |", bench / 1e6, solve / 1e6, solve / bench);
    }
}

/// The passes of the kernels' bench, 1,024 pairs and 20,480 voxels.
fn of_bench() -> [f64; 2] {
    const ITERATIONS: u32 = 8;
    let gpu = gpu(true);
    let mut job = job(&gpu, 32, 20_480, Accumulation::Auto, |_| ()).expect("a job");
    let level = *job.plan.finest();
    job.executor.run(&Schedule::of(|s| paper::initialise(s, &job.plan, &level))).expect("the start runs");
    for i in 0..ITERATIONS {
        job.executor
            .run(&Schedule::of(|s| paper::iteration(s, &job.plan, &level, i, 1)))
            .expect("an iteration runs");
    }
    let pairs = (job.plan.scene.pairs * level.grid.voxels()) as f64 * f64::from(ITERATIONS);
    ["forward", "backward"].map(|kernel| pairs / spent(&job, kernel))
}

/// All passes over pairs of a solve.
fn of_solve(capture: &Path, folder: &Path) -> [f64; 2] {
    let json = folder.join("profile.json");
    let [capture, json_text] = [capture, &json].map(|p| p.to_str().expect("a path of ASCII letters"));
    let program = Path::new(env!("CARGO_BIN_EXE_thirdbounce"));
    measured(program, &["profile", capture, "--pulse", "none", "--json", json_text, "-q"]);
    let profile: Value = serde_json::from_slice(&std::fs::read(&json).expect("a profile")).expect("JSON");
    let kernels = profile["kernels"].as_array().expect("kernels");
    ["forward", "backward"].map(|begins| {
        let of = kernels.iter().filter(|k| k["name"].as_str().is_some_and(|n| n.starts_with(begins)));
        let [pairs, seconds] = of.fold([0.0, 0.0], |[pairs, seconds], k| {
            [pairs + number(k, "/pairs").max(0.0), seconds + number(k, "/seconds")]
        });
        pairs / seconds
    })
}
