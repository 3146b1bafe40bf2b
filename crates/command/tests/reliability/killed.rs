//! Processes that are killed, interrupted, cancelled, or write one folder together.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use thirdbounce::Kind;
use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::Faults;

use super::ledger::{Held, Row, clear, holds};
use super::small::{files, leftovers, loaded, open, solve, solvers};

/// Each case is tried `times` times.
pub fn rows(times: usize) -> Vec<Row> {
    vec![killed(times), interrupted(times), cancelled(), rivals(times)]
}

fn command(out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_thirdbounce"));
    command.arg("reconstruct").arg(files().capture()).arg("--out").arg(out);
    command.args(["--model", "cosine", "--lateral", "12", "--iterations", "24"]);
    command.args(["--deterministic", "--quiet"]);
    command.args(["--volume-file"]).arg(out.with_extension("hdf5")).args(more);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Asserts that the process ends with success, and soon.
fn succeed(mut command: Command) -> Result<(), String> {
    let output = command.output().map_err(|e| e.to_string())?;
    holds(output.status.success(), || String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Every file of a result except the report and its page, which hold times.
fn result(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let all = super::small::tree(out).into_iter().chain(super::small::tree(&out.with_extension("hdf5")));
    all.map(|(p, b)| (p.file_name().unwrap_or_default().to_string_lossy().into_owned(), b))
        .filter(|(name, _)| !["report.json", "report.html"].contains(&name.as_str()))
        .collect()
}

/// Kills a run at a share of its time, then runs it again.
fn killed(times: usize) -> Row {
    let mut row = Row::new("kill -9 at any time of a run, then the same run again: its bits");
    let folder = tempfile::tempdir().expect("a folder");
    let sound = folder.path().join("sound");
    let start = Instant::now();
    succeed(command(&sound, &[])).expect("a run");
    let (whole, sound) = (start.elapsed(), result(&sound));
    for i in 0..times {
        let out = folder.path().join(format!("killed{i}"));
        let case = || -> Held {
            let child = command(&out, &[]).spawn().map_err(|e| e.to_string())?;
            std::thread::sleep(whole.mul_f64((i as f64 + 0.6) / times as f64));
            end(child, "-KILL");
            let report = out.join("report.json");
            holds(!report.exists() || result(&out).contains_key("maps.npz"), || {
                "a report without maps".into()
            })?;
            succeed(command(&out, &[]))?;
            let left = leftovers(&out);
            holds(left.is_empty(), || format!("left behind: {left:?}"))?;
            holds(result(&out) == sound, || "other bits".into()).map(|()| None)
        };
        row.add(&format!("after {} of {times}", i + 1), case());
    }
    row
}

pub fn end(mut child: Child, signal: &str) -> Option<i32> {
    let _ = Command::new("kill").args([signal, &child.id().to_string()]).status();
    child.wait().ok().and_then(|s| s.code())
}

/// Ctrl-C at a share of the run's time: it ends soon, with no result or a whole one.
fn interrupted(times: usize) -> Row {
    let mut row = Row::new("Ctrl-C at any time: no result, or a whole one");
    let folder = tempfile::tempdir().expect("a folder");
    for i in 0..times {
        let out = folder.path().join(format!("interrupted{i}"));
        let case = || -> Held {
            let child = command(&out, &[]).spawn().map_err(|e| e.to_string())?;
            std::thread::sleep(Duration::from_millis(30 + 900 * i as u64 / times as u64));
            let start = Instant::now();
            let code = end(child, "-INT");
            holds(start.elapsed() < Duration::from_secs(20), || "it went on".into())?;
            // None: the system ended it before it listened.
            holds(matches!(code, None | Some(0 | 130)), || format!("code {code:?}"))?;
            let left = leftovers(folder.path());
            holds(left.is_empty(), || format!("left behind: {left:?}"))?;
            holds(out.join("report.json").exists() == (code == Some(0)), || format!("code {code:?}"))
                .map(|()| None)
        };
        row.add(&format!("{} of {times}", i + 1), case());
    }
    row
}

/// A caller breaks off at each point of the trace in turn.
fn cancelled() -> Row {
    let mut row = Row::new("cancelled by the caller at each point of the trace in turn");
    let capture = loaded().capture;
    for (name, solver) in solvers(Accumulation::Repeatable) {
        let gpu = open(Faults::default(), false);
        let points = solve(&gpu, &solver, &capture, None).expect("a solve").trace.len();
        // The caller is not asked again about points that are read at the very end.
        for at in 0..points.saturating_sub(2).max(1) {
            let case = || -> Held {
                let error = solve(&gpu, &solver, &capture, Some(at)).err().ok_or("it was not cancelled")?;
                holds(error.kind == Kind::Cancelled, || format!("{:?}: {error}", error.kind))?;
                holds(gpu.allocated() == 0, || format!("{} bytes stay allocated", gpu.allocated()))?;
                clear(&error)
            };
            row.add(&format!("{name}, point {at}"), case());
        }
        row.add(
            &format!("{name}, afterwards"),
            solve(&gpu, &solver, &capture, None).map(|_| None).map_err(|e| e.to_string()),
        );
    }
    row
}

/// Several processes with different options write one folder: in the end it holds the whole result of one of them.
fn rivals(times: usize) -> Row {
    let mut row = Row::new("three processes write one folder at once: the whole result of one of them");
    let folder = tempfile::tempdir().expect("a folder");
    let weights = ["0.05", "0.1", "0.2"];
    let alone: Vec<_> = weights
        .map(|weight| {
            let out = folder.path().join(format!("alone{weight}"));
            succeed(command(&out, &["--sparsity", weight])).expect("a run");
            std::fs::read(out.join("maps.npz")).expect("maps")
        })
        .into();
    for i in 0..times {
        let out = folder.path().join(format!("together{i}"));
        let case = || -> Held {
            let children = weights.map(|weight| command(&out, &["--sparsity", weight]).spawn());
            for child in children {
                let output = child.and_then(Child::wait_with_output).map_err(|e| e.to_string())?;
                let text = String::from_utf8_lossy(&output.stderr).into_owned();
                holds(output.status.success(), || text)?;
            }
            let report = std::fs::read(out.join("report.json")).map_err(|e| e.to_string())?;
            let report: serde_json::Value = serde_json::from_slice(&report).map_err(|e| e.to_string())?;
            let made = report["settings"]["sparsity"].as_f64().ok_or("no weight in the report")?;
            let which = weights.iter().position(|w| w.parse() == Ok(made)).ok_or("another weight")?;
            let maps = std::fs::read(out.join("maps.npz")).map_err(|e| e.to_string())?;
            holds(maps == alone[which], || "the maps are not those of the report".into())?;
            let left = leftovers(&out);
            holds(left.is_empty(), || format!("left behind: {left:?}")).map(|()| None)
        };
        row.add(&format!("{} of {times}", i + 1), case());
    }
    row
}
