//! Milliseconds of reading a capture, of planning its reconstruction, and of writing each file of a result.
//!
//!     thirdbounce simulate figure --out capture.npz; thirdbounce reconstruct capture.npz --out result
//!     cargo bench --bench files -- capture.npz result
//!
//! Without a folder of results nothing is written. Wall time: the least and the median of some repetitions, which load of other
//! programs changes. Processor time of all threads, per repetition, changes little.

use std::path::Path;
use std::time::Instant;

use thirdbounce::export::page::PageHistograms;
use thirdbounce::export::{depth_error, exr, mat, mesh, npz, page, ply, png, print, probability, report};
use thirdbounce::files::staging::Staging;
use thirdbounce::job::{Request, planned};
use thirdbounce::settings::Settings;
use thirdbounce::{export, job};

const TIMES: usize = 7;

type Writer = fn(&Path, &thirdbounce::Maps) -> thirdbounce::Result<()>;

fn main() {
    let given: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let Some(capture) = given.first().map(Path::new) else {
        eprintln!("give a capture, and the folder of its result");
        return;
    };
    let settings = Settings::default();
    let request = Request::new(settings.clone(), "");
    let loaded = timed("read", || job::load(capture, &settings).expect("a capture"));
    timed("plan", || {
        planned::to_plan(&request.job(&loaded.capture)).expect("a plan");
    });
    let Some(result) = given.get(1).map(Path::new) else { return };
    let maps = npz::read_maps(&result.join("maps.npz")).expect("maps");
    let report = report::read(&result.join("report.json")).expect("a report");
    let light = PageHistograms::of(&loaded.capture);
    let out = tempfile::tempdir_in(result).expect("a folder");
    let writers: [(&str, Writer); 11] = [
        ("maps.npz", npz::write_maps),
        ("maps.mat", mat::write),
        ("maps.exr", exr::write),
        ("maps.svg", print::write),
        ("albedo.png", png::write_albedo),
        ("depth.png", png::write_depth),
        ("normal.png", png::write_normal),
        ("depth_error.png", depth_error::write),
        ("probability.png", probability::write),
        ("points.ply", ply::write),
        ("mesh.ply", mesh::write),
    ];
    for (name, write) in writers {
        timed(name, || write(&out.path().join(name), &maps).expect("a file"));
    }
    let write_page = |folder: &Path| {
        let page = folder.join("report.html");
        page::write(&page, "bench", &maps, &light, &report, None).expect("a page");
        page
    };
    let write_report = |folder: &Path| {
        let path = folder.join("report.json");
        report::write(&path, &report).expect("a report");
        path
    };
    timed("report.html", || write_page(out.path()));
    timed("report.json", || write_report(out.path()));
    timed("all, as a run", || {
        let staging = Staging::new(out.path()).expect("a folder");
        let mut files = export::write_maps(staging.path(), &maps).expect("maps");
        files.push(write_page(staging.path()));
        files.push(write_report(staging.path()));
        staging.commit(&files).expect("a result");
    });
}

fn timed<T>(name: &str, run: impl Fn() -> T) -> T {
    let (mut wall, before) = (vec![], processor_seconds());
    let mut last = None;
    for _ in 0..TIMES {
        let start = Instant::now();
        last = Some(run());
        wall.push(1e3 * start.elapsed().as_secs_f64());
    }
    let processor = 1e3 * (processor_seconds() - before) / TIMES as f64;
    wall.sort_by(f64::total_cmp);
    let (least, median) = (wall[0], wall[TIMES / 2]);
    println!("{name:<16} least {least:7.1} ms  median {median:7.1} ms  processor {processor:7.1} ms");
    last.expect("it ran")
}

/// Seconds of this process's threads on a processor; those of threads that ended are left out.
fn processor_seconds() -> f64 {
    let of_thread = |entry: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let text = std::fs::read_to_string(entry.ok()?.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse().ok()
    };
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten();
    1e-9 * threads.filter_map(of_thread).sum::<f64>()
}
