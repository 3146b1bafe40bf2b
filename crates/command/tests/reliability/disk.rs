//! Every file that a run writes fails in turn: on a full disk, in a read-only folder, and when it is moved to its place.

use std::ops::ControlFlow;
use std::path::Path;

use thirdbounce::engine::Accumulation;
use thirdbounce::files::atomic::{DiskFault, inject};
use thirdbounce::job::{self, Request};
use thirdbounce::{Error, Kind, Result, capture};
use thirdbounce_command::profile::{self, ProfileRequest};
use thirdbounce_command::simulated::{Simulation, simulate};
use thirdbounce_simulate::{RenderOptions, Scene};

use super::Share;
use super::ledger::{Held, Row, clear, holds};
use super::small::{files, leftovers, loaded, solvers, tree};

type Work<'w> = Box<dyn Fn(&Path) -> Result<()> + 'w>;

pub fn rows(share: Share) -> Vec<Row> {
    let loaded = loaded();
    let solver = || solvers(Accumulation::Repeatable)[1].1.clone();
    let run = |out: &Path, volume: &str| {
        let request = Request {
            truth: Some(files().truth()),
            volume_file: Some(out.join(volume)),
            ..Request::new(solver(), out.join("result"))
        };
        job::run(&request, &loaded, &mut |_| ControlFlow::Continue(())).map(drop)
    };
    let works: Vec<(&str, bool, Work<'_>)> = vec![
        ("reconstruct, volume.npz", true, Box::new(|out| run(out, "v.npz"))),
        ("reconstruct, volume.hdf5", true, Box::new(|out| run(out, "v.hdf5"))),
        (
            "simulate",
            false,
            Box::new(|out| {
                let scene = Scene { scan: 4, bin_width: 0.05, ..Scene::named("plane")? };
                let render = RenderOptions { noise: 0.5, ..RenderOptions::default() };
                let truth = Some((out.join("truth.npz"), 8));
                simulate(
                    &Simulation {
                        scene,
                        hide_pulse: false,
                        render,
                        out: out.join("c.npz"),
                        truth,
                        empty: None,
                        is_truth_of_things: false,
                        exposure: None,
                    },
                    &|_| {},
                    &mut || {},
                )
                .map(drop)
            }),
        ),
        (
            "convert to npz, hdf5, mat",
            false,
            Box::new(|out| {
                ["c.npz", "c.hdf5", "c.mat"]
                    .iter()
                    .try_for_each(|name| capture::write(&loaded.capture, &out.join(name)).map(drop))
            }),
        ),
        (
            "profile",
            false,
            Box::new(|out| {
                let what = ProfileRequest {
                    request: Request::new(solver(), ""),
                    json: Some(out.join("p.json")),
                    trace: Some(out.join("t.json")),
                    out: Some(out.join("maps")),
                };
                profile::profile(&what, &loaded, &mut |_| {}, &mut |_| ControlFlow::Continue(())).map(drop)
            }),
        ),
    ];
    let mut rows: Vec<Row> = works.iter().enumerate().map(|(i, w)| each(w, share, i)).collect();
    #[cfg(target_os = "linux")]
    rows.push(small_disk(share));
    rows
}

/// Runs `work` once for each of its files and each way to fail.
fn each((name, whole, work): &(&str, bool, Work<'_>), share: Share, salt: usize) -> Row {
    let out = tempfile::tempdir().expect("a folder");
    inject(None);
    work(out.path()).expect("it works without faults");
    let count = inject(None);
    let before = tree(out.path());
    let mut row =
        Row::new(format!("{name}: {count} files, each in turn denied, on a full disk, not movable"));
    let kinds = [DiskFault::Denied, DiskFault::Full, DiskFault::Unmoved];
    let all = (0..count).flat_map(|n| kinds.map(|fault| (fault, n))).enumerate();
    for (_, (fault, number)) in all.filter(|(i, _)| share.takes(*i, salt)) {
        let case = || -> Held {
            inject(Some((fault, number)));
            let result = work(out.path());
            inject(None);
            let error: Error = result.err().ok_or("the fault was not noticed")?;
            holds(error.kind == Kind::Output, || format!("{:?}: {error}", error.kind))?;
            let said = if fault == DiskFault::Full { "full" } else { "folder" };
            holds(error.hint.to_string().contains(said), || format!("{said:?} is not in: {error}"))?;
            let left = leftovers(out.path());
            holds(left.is_empty(), || format!("left behind: {left:?}"))?;
            if *whole {
                // The volume is a file of its own and may be new. The result is all or nothing.
                let result = |t: &std::collections::BTreeMap<_, Vec<u8>>| {
                    let inside =
                        |(p, _): &(&std::path::PathBuf, &Vec<u8>)| p.starts_with(out.path().join("result"));
                    t.iter().filter(inside).map(|(p, b)| (p.clone(), b.clone())).collect::<Vec<_>>()
                };
                holds(result(&tree(out.path())) == result(&before), || "the older result changed".into())?;
            }
            clear(&error)
        };
        row.add(&format!("{fault:?} {number}"), case());
    }
    inject(None);
    let again = work(out.path()).map(|()| None).map_err(|e| format!("afterwards: {e}"));
    row.add("and then without faults", again);
    row
}

/// The command with a limit on the size of files: every writer meets the system's own error.
#[cfg(target_os = "linux")]
fn small_disk(share: Share) -> Row {
    use std::process::Command;
    let mut row = Row::new("the command where files cannot grow beyond 0.5 to 32 KiB (ulimit -f)");
    let capture = files().capture().display().to_string();
    for (i, blocks) in [1usize, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64].into_iter().enumerate() {
        if !share.takes(i, 4) {
            continue;
        }
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("result").display().to_string();
        let volume = folder.path().join("v.hdf5").display().to_string();
        let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
        let output = Command::new("sh")
            .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_thirdbounce"), "reconstruct", &capture])
            .args(["--out", &out, "--volume-file", &volume, "--model", "cosine"])
            .args(["--lateral", "12", "--iterations", "3", "--quiet"])
            .output()
            .expect("a shell");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let case = || -> Held {
            let left = leftovers(folder.path());
            holds(left.is_empty(), || format!("left behind: {left:?}"))?;
            if output.status.success() {
                return Ok(None);
            }
            holds(output.status.code() == Some(1), || format!("{:?}: {text}", output.status))?;
            holds(text.matches("error:").count() == 1, || text.clone())?;
            let report = folder.path().join("result/report.json");
            holds(!report.exists(), || "there is a report all the same".into())?;
            let mut lines = text.lines().map(|l| l.trim_start_matches("error: ").trim().to_string());
            Ok(lines.next().zip(lines.next()))
        };
        row.add(&format!("{blocks} blocks"), case());
    }
    row
}
