//! Every option of every verb, as clap lists them, with values that make no sense.

use std::any::TypeId;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::Share;
use super::ledger::{Held, Row, holds};
use super::small::{files, leftovers, tree};

/// A run with a wrong value ends within this time, even if the value means work.
const LIMIT: Duration = Duration::from_secs(90);
/// The demo has a fixed size: it takes minutes on a machine that is shared.
const DEMO_LIMIT: Duration = Duration::from_secs(600);

const NUMBERS: [&str; 9] =
    ["0", "-1", "NaN", "inf", "-inf", "1e300", "1e-300", "4294967295", "18446744073709551615"];
const WORDS: [&str; 6] = ["", "nonsense", ":", ",,,", "\u{e9}\u{1f980}", "1:0,1:0,1:0"];

#[derive(Clone, Copy, PartialEq)]
enum Takes {
    Number,
    Path,
    /// A number or a path.
    Text,
    Word,
}

/// Arguments that make a run of the verb short and complete, positional ones first. `{}` is the case's own folder.
pub fn base(verb: &str) -> Vec<String> {
    let (capture, truth) = (files().capture().display().to_string(), files().truth().display().to_string());
    let result = result().display().to_string();
    let text = match verb {
        "demo" => "--out {}/demo --device nowhere --quiet".into(),
        "info" => format!("{capture} --lateral 8"),
        "schedule" => format!("{capture} --lateral 8 --iterations 3"),
        "reconstruct" => format!("{capture} --out {{}}/r --model cosine --lateral 8 --iterations 3 --quiet"),
        "batch" => format!("{capture} --out {{}}/r --model cosine --lateral 8 --iterations 3 --quiet"),
        "simulate" => "plane --out {}/c.npz --scan 3 --bin-width 0.05 --noise 0.5".into(),
        "live" => {
            format!("- --capture {capture} --model cosine --lateral 8 --iterations 3 --frames 1 --quiet")
        }
        "track" => format!("{capture} --out {{}}/t --blobs 1 --model cosine --quiet"),
        "evaluate" => format!("{result} --truth {truth} --no-pictures"),
        "benchmark" => {
            format!(
                "{capture} --truth {truth} --out {{}}/b --model cosine --lateral 8 --iterations 3 --repeats 1 --quiet --method surface"
            )
        }
        "histogram" => {
            let tags = files().folder().join("tags.csv");
            std::fs::write(&tags, "0,10\n1,15\n0,110\n1,117\n0,210\n1,222\n0,310\n1,311\n").expect("a file");
            format!(
                "{} --scan 2x1 --wall 1m --pulses-per-point 2 --zero 0 --out {{}}/c.npz --quiet",
                tags.display()
            )
        }
        "convert" => format!("{capture} {{}}/c.npz"),
        "profile" => format!("{capture} --lateral 8 --iterations 3 --quiet"),
        "devices" => String::new(),
        "help" => "info".into(),
        other => panic!("give the verb {other} a short run here"),
    };
    text.split_whitespace().map(String::from).collect()
}

/// A result to evaluate, made once.
fn result() -> PathBuf {
    static MADE: std::sync::OnceLock<()> = std::sync::OnceLock::new();
    let out = files().folder().join("result");
    MADE.get_or_init(|| {
        let request = thirdbounce::job::Request::new(
            super::small::surface(thirdbounce::engine::Accumulation::Auto),
            &out,
        );
        let done = thirdbounce::job::run(&request, &super::small::loaded(), &mut |_| {
            std::ops::ControlFlow::Continue(())
        });
        done.expect("a run");
    });
    out
}

fn paths() -> Vec<String> {
    let folder = files().folder();
    let garbage = folder.join("garbage");
    std::fs::write(&garbage, b"neither this nor that".repeat(9)).expect("a file");
    let hidden = folder.join("hidden.npz");
    std::fs::copy(files().capture(), &hidden).expect("a copy");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let _ = std::fs::set_permissions(&hidden, std::fs::Permissions::from_mode(0o000));
    }
    let text = |p: &Path| p.display().to_string();
    // By a link: a program that replaces its output then damages only the link.
    let device = folder.join("null");
    #[cfg(unix)]
    if !device.is_symlink() {
        std::os::unix::fs::symlink("/dev/null", &device).expect("a link");
    }
    vec![
        String::new(),
        text(&folder.join("missing.npz")),
        text(folder),
        text(&garbage),
        text(&garbage.join("below")),
        text(&hidden),
        "/proc/nowhere/file.npz".into(),
        text(&device),
    ]
}

struct Case {
    verb: String,
    option: String,
    arguments: Vec<String>,
    kind: Takes,
}

/// All cases. An option that no base has is added to it.
fn cases() -> Vec<Case> {
    let mut all = vec![];
    let paths = paths();
    for verb in thirdbounce_command::cli::command().get_subcommands() {
        let name = verb.get_name().to_string();
        let mut position = 0;
        for argument in verb.get_arguments() {
            let positional = argument.is_positional();
            let at = position;
            position += usize::from(positional);
            if !positional && !argument.get_action().takes_values() {
                continue;
            }
            let kind = argument.get_value_parser().type_id();
            let is = |t: TypeId| kind == t;
            let number =
                [TypeId::of::<f64>(), TypeId::of::<usize>(), TypeId::of::<u64>(), TypeId::of::<u32>()];
            let kind = if number.into_iter().any(is) {
                Takes::Number
            } else if is(TypeId::of::<PathBuf>()) {
                Takes::Path
            } else if is(TypeId::of::<String>()) && argument.get_possible_values().is_empty() {
                Takes::Text
            } else {
                Takes::Word
            };
            let values: Vec<String> = match kind {
                Takes::Number => NUMBERS.iter().map(ToString::to_string).collect(),
                Takes::Path => paths.clone(),
                Takes::Text => {
                    let plain = NUMBERS.iter().chain(&WORDS).map(ToString::to_string);
                    plain.chain(paths.clone()).collect()
                }
                Takes::Word => WORDS.iter().chain(&NUMBERS[..2]).map(ToString::to_string).collect(),
            };
            let solvers: &[&str] =
                if name == "reconstruct" && !positional { &["surface", "paper"] } else { &["surface"] };
            for value in values {
                for solver in solvers {
                    let mut arguments = base(&name);
                    let option = match argument.get_long() {
                        Some(long) => {
                            let flag = format!("--{long}");
                            if let Some(there) = arguments.iter().position(|a| *a == flag) {
                                arguments.drain(there..there + 2);
                            }
                            arguments.push(format!("{flag}={value}"));
                            flag
                        }
                        None => {
                            arguments[at] = value.clone();
                            argument.get_id().to_string()
                        }
                    };
                    if *solver == "paper" && option != "--solver" {
                        arguments.push("--solver=paper".into());
                    }
                    all.push(Case { verb: name.clone(), option, arguments, kind });
                }
            }
        }
    }
    all
}

pub fn rows(share: Share) -> Vec<Row> {
    let all: Vec<Case> = cases();
    let options = all.iter().map(|c| (&c.verb, &c.option)).collect::<std::collections::BTreeSet<_>>().len();
    assert!(
        options > 200 && all.len() > 2000,
        "{options} options, {} cases: is clap asked rightly?",
        all.len()
    );
    let chosen: Vec<&Case> =
        all.iter().enumerate().filter(|(i, _)| share.takes(*i, 0)).map(|(_, c)| c).collect();
    let next = Mutex::new(chosen.into_iter());
    let rows: Mutex<BTreeMap<String, Row>> = Mutex::default();
    // Made once, before the workers start.
    result();
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(case) = { next.lock().expect("no panic").next() } {
                    let held = run(case);
                    let kind = match case.kind {
                        Takes::Number => "numbers",
                        Takes::Path => "paths",
                        Takes::Text => "text",
                        Takes::Word => "words",
                    };
                    let name = format!("`{}`: options that take {kind}", case.verb);
                    let mut rows = rows.lock().expect("no panic");
                    rows.entry(name.clone())
                        .or_insert_with(|| Row::new(name))
                        .add(&case.arguments.join(" "), held);
                }
            });
        }
    });
    let device = files().folder().join("null");
    assert!(device.is_symlink() || cfg!(not(unix)), "a run replaced a device by a file");
    rows.into_inner().expect("no panic").into_values().collect()
}

/// Runs the command in a folder of its own: success, or one clear error and nothing written.
fn run(case: &Case) -> Held {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let own = folder.path().display().to_string();
    let mut child = Command::new(env!("CARGO_BIN_EXE_thirdbounce"))
        .arg(&case.verb)
        .args(case.arguments.iter().map(|a| a.replace("{}", &own)))
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::from(std::fs::File::create(folder.path().join(".stderr")).map_err(|e| e.to_string())?))
        .stdin(Stdio::null())
        .spawn()
        .map_err(|e| e.to_string())?;
    let limit = if case.verb == "demo" { DEMO_LIMIT } else { LIMIT };
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            break status;
        }
        if start.elapsed() > limit {
            let _ = child.kill();
            let _ = child.wait();
            return Err(format!("it went on for {limit:?}"));
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let text = String::from_utf8_lossy(&std::fs::read(folder.path().join(".stderr")).unwrap_or_default())
        .into_owned();
    let _ = std::fs::remove_file(folder.path().join(".stderr"));
    judge(folder.path(), status, &text)
}

/// A run in a folder of its own held if it ended well, or in one clear error and wrote nothing.
pub fn judge(folder: &Path, status: ExitStatus, text: &str) -> Held {
    holds(!text.contains("internal error") && !text.contains("panicked"), || text.into())?;
    let left = leftovers(folder);
    holds(left.is_empty(), || format!("left behind: {left:?}"))?;
    match status.code() {
        Some(0) => Ok(None),
        Some(1 | 2) => {
            holds(text.matches("error:").count() == 1, || format!("not one error: {text}"))?;
            let written: Vec<_> = tree(folder).into_keys().collect();
            holds(written.is_empty(), || format!("an error, but written: {written:?}"))?;
            let mut lines = text
                .lines()
                .filter(|l| !["note:", "warning:"].iter().any(|begin| l.starts_with(begin)))
                .map(|l| l.trim().to_string());
            let what = lines.next().unwrap_or_default().trim_start_matches("error: ").to_string();
            let hint = lines.find(|l| !l.is_empty()).unwrap_or_default();
            holds(what.len() > 8 && hint.len() > 8, || format!("it says too little: {text}"))?;
            Ok(Some((what, hint)))
        }
        _ => Err(format!("{status}: {text}")),
    }
}
