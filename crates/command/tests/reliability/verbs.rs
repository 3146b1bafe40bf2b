//! Every verb as it is meant to be run, with paths that are not UTF-8, with little memory of the host, and ended by SIGTERM; and
//! batches in containers.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::Share;
use super::killed::end;
use super::ledger::{Held, Row, holds};
use thirdbounce_command::cli;

use super::options::{base, judge};
use super::small::{files, leftovers};

/// A run ends within this time, and soon after it is asked to.
const LIMIT: Duration = Duration::from_secs(90);
const SOON: Duration = Duration::from_secs(20);

#[derive(Debug, Clone, Copy, PartialEq)]
enum How {
    AsMeant,
    OddPaths,
    HostMemory(&'static str),
    /// Delay in milliseconds.
    Terminated(u64),
}

const WAYS: [How; 9] = [
    How::AsMeant,
    How::OddPaths,
    How::HostMemory("1K"),
    How::HostMemory("1M"),
    How::HostMemory("64M"),
    How::HostMemory("4G"),
    How::Terminated(20),
    How::Terminated(150),
    How::Terminated(600),
];

pub fn rows(share: Share) -> Vec<Row> {
    let mut rows = vec![];
    for (at, verb) in cli::command().get_subcommands().enumerate() {
        let name = verb.get_name();
        let mut row = Row::new(format!(
            "`{name}`: as meant, with paths that are not UTF-8, with `--host-memory` of 1K to 4G, ended by SIGTERM"
        ));
        for (way, how) in
            WAYS.into_iter().enumerate().filter(|(way, _)| share.takes(at * WAYS.len() + way, 0))
        {
            row.add(&format!("{way}, {how:?}"), run(name, how));
        }
        rows.push(row);
    }
    rows.push(containers(12_usize.div_ceil(share.0)));
    rows
}

fn run(verb: &str, how: How) -> Held {
    let (folder, inputs) = (tempfile::tempdir(), tempfile::tempdir());
    let (folder, inputs) = (folder.map_err(|e| e.to_string())?, inputs.map_err(|e| e.to_string())?);
    let arguments = base(verb);
    let (mut own, mut files_at) = (folder.path().to_path_buf(), files().folder().to_path_buf());
    if how == How::OddPaths {
        own.push(OsStr::from_bytes(b"w\xff\xfe"));
        std::fs::create_dir(&own).map_err(|e| e.to_string())?;
        let link = inputs.path().join(OsStr::from_bytes(b"\xfe"));
        std::os::unix::fs::symlink(&files_at, &link).map_err(|e| e.to_string())?;
        files_at = link;
    }
    let placed = |argument: &String| {
        let places =
            [("{}", own.as_os_str()), (files().folder().to_str().unwrap_or("{}"), files_at.as_os_str())];
        let replaced = places.into_iter().fold(argument.as_bytes().to_vec(), |text, (word, place)| {
            let mut parts = vec![];
            let mut rest = &text[..];
            while let Some(at) = rest.windows(word.len()).position(|w| w == word.as_bytes()) {
                parts.extend([&rest[..at], place.as_bytes()]);
                rest = &rest[at + word.len()..];
            }
            [&parts.concat(), rest].concat()
        });
        OsString::from_vec(replaced)
    };
    let mut command = Command::new(env!("CARGO_BIN_EXE_thirdbounce"));
    command.arg(verb).args(arguments.iter().map(placed)).current_dir(folder.path());
    if let How::HostMemory(size) = how {
        command.args(["--host-memory", size]);
    }
    let errors = inputs.path().join("stderr");
    let file = std::fs::File::create(&errors).map_err(|e| e.to_string())?;
    let begun = Instant::now();
    let mut child =
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(file).spawn().map_err(|e| e.to_string())?;
    let mut asked = None;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            break status;
        }
        if begun.elapsed() > LIMIT || asked.is_some_and(|at: Instant| at.elapsed() > SOON) {
            let _ = child.kill();
            let _ = child.wait();
            return Err("it went on".into());
        }
        if matches!(how, How::Terminated(after) if asked.is_none() && begun.elapsed().as_millis() >= after.into())
        {
            let _ = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
            asked = Some(Instant::now());
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let text = String::from_utf8_lossy(&std::fs::read(&errors).unwrap_or_default()).into_owned();
    // None: the system ended it before it listened.
    if asked.is_some() && matches!(status.code(), None | Some(130)) {
        let left = leftovers(folder.path());
        holds(left.is_empty() && !text.contains("internal error"), || {
            format!("left behind: {left:?}; {text}")
        })?;
        return Ok(None);
    }
    judge(&own, status, &text)
}

/// Batches in PID namespaces of their own, as containers have them, on one folder.
fn containers(times: usize) -> Row {
    const NAME: &str = "two shards of a batch in containers (PID namespaces), one folder: results whole; one killed and started anew \
                        elsewhere: all results";
    let isolated = |program: &OsStr| {
        let mut command = Command::new("unshare");
        command
            .args(["--user", "--map-root-user", "--pid", "--fork", "--kill-child", "--mount-proc"])
            .arg(program);
        command
    };
    if !isolated(OsStr::new("true")).stderr(Stdio::null()).status().is_ok_and(|status| status.success()) {
        eprintln!("skipped: containers, as `unshare --user --pid` is not permitted here");
        return Row::new(format!("{NAME}: skipped, as `unshare --user --pid` was not permitted"));
    }
    let mut row = Row::new(NAME);
    let start = |captures: &Path, out: &Path, shard: &str| -> Result<Child, String> {
        let mut command = isolated(OsStr::new(env!("CARGO_BIN_EXE_thirdbounce")));
        command.arg("batch").arg(captures.join("*.npz")).args(["--shard", shard]).arg("--out").arg(out);
        command.args(["--model", "cosine", "--lateral", "12", "--iterations", "12", "--quiet"]);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().map_err(|e| e.to_string())
    };
    let counts = |child: Child| -> Result<[u64; 3], String> {
        let output = child.wait_with_output().map_err(|e| e.to_string())?;
        let text = String::from_utf8_lossy(&output.stdout);
        let summary =
            text.lines().last().and_then(|line| serde_json::from_str::<serde_json::Value>(line).ok());
        let number = |key| summary.as_ref().and_then(|s| s[key].as_u64()).ok_or("no summary");
        holds(output.status.success(), || String::from_utf8_lossy(&output.stderr).into_owned())?;
        Ok([number("done")?, number("skipped")?, number("failed")?])
    };
    for i in 0..times {
        let case = || -> Held {
            let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
            let (captures, out) = (folder.path().join("captures"), folder.path().join("out"));
            std::fs::create_dir(&captures).map_err(|e| e.to_string())?;
            for name in ["a", "b", "c", "d"] {
                let to = captures.join(name).with_extension("npz");
                std::fs::copy(files().capture(), to).map_err(|e| e.to_string())?;
            }
            let (one, other) = (start(&captures, &out, "1/2")?, start(&captures, &out, "2/2")?);
            if i % 2 == 0 {
                let [one, other] = [counts(one)?, counts(other)?];
                holds(one[0] + other[0] == 4, || format!("done, skipped, failed: {one:?} and {other:?}"))?;
            } else {
                std::thread::sleep(Duration::from_millis(200 + 100 * i as u64));
                end(one, "-KILL");
                counts(other)?;
                let last = counts(start(&captures, &out, "1/1")?)?;
                holds(last[0] + last[1] == 4, || format!("done, skipped, failed: {last:?}"))?;
            }
            for name in ["a", "b", "c", "d"] {
                let maps = thirdbounce::export::npz::read_maps(&out.join(name).join("maps.npz"));
                holds(maps.is_ok() && out.join(name).join("report.json").is_file(), || {
                    format!("{name} is not whole")
                })?;
            }
            let left: Vec<_> = leftovers(&out);
            // Folders of a killed container stay for a week: it is unknown whether their process lives.
            holds(left.is_empty() || i % 2 == 1, || format!("left behind: {left:?}")).map(|()| None)
        };
        row.add(&format!("{} of {times}", i + 1), case());
    }
    row
}
