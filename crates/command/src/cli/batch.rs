//! `thirdbounce batch LIST|CAPTURE|GLOB.. --out DIR`: the options of `reconstruct`, with what is different for many captures.

use std::collections::BTreeMap;
use std::io::{IsTerminal, Read};
use std::ops::ControlFlow;
use std::path::{Component, Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};

use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, Args as _, Command, FromArgMatches};
use indicatif::ProgressBar;
use serde_json::json;
use thirdbounce::engine::Progress;
use thirdbounce::job::{Loaded, Request};
use thirdbounce::{Error, Result, gpu};

use crate::batch::{self, Batch, Caller, CaptureEnd, Listed, Status, Tally, named};
use crate::found::{captures_in, is_capture};

use super::progress::{Phase, bar};
use super::terminal::{print, say, say_error};
use super::{advice, interrupt, reconstruct, tables};

/// Options of `reconstruct` that a batch does not have: a capture that was not finished begins anew.
const NOT_HERE: [&str; 3] = ["no_preview", "open", "timings"];
/// Arguments that do not change results.
const NO_DIFFERENCE: [&str; 8] =
    ["capture", "out", "device", "memory", "pipeline_cache", "validation", "quiet", "json"];
/// Most threads.
const MOST_JOBS: usize = 256;
/// Exit code after Ctrl-C, as for the other verbs.
const STOPPED: u8 = 130;

pub struct BatchArgs {
    /// Captures, patterns and lists.
    captures: Vec<PathBuf>,
    /// Every option that changes results, as given.
    options: Vec<String>,
    /// An option that a batch does not have.
    unfit: Option<&'static str>,
    own: Own,
    each: reconstruct::ReconstructArgs,
}

#[derive(clap::Args)]
struct Own {
    /// Captures that are reconstructed at once, each with its share of the threads [default: on the host one per thread, as far as
    /// there is memory; on a GPU 1]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Reconstruct every Nth capture of the list, beginning with the Kth: for the tasks of a Slurm array or of GNU parallel
    #[arg(long, visible_alias = "shard", value_name = "K/N")]
    part: Option<String>,
}

impl clap::Args for BatchArgs {
    fn augment_args(command: Command) -> Command {
        let command = Own::augment_args(reconstruct::ReconstructArgs::augment_args(command))
            .mut_arg("capture", |arg| {
                arg.value_name("CAPTURE|FOLDER|GLOB|LIST.txt").num_args(1..).action(ArgAction::Append).help(
                    "Captures, folders of captures, patterns such as 'scans/*.npz', or text files (.txt, or - for stdin) \
                     with one of these a line",
                )
            })
            .mut_arg("out", |arg| arg.help("Folder for the results: one folder for each capture, named after it"))
            .mut_arg("truth", |arg| {
                arg.help("Measure the results against these truths; {} stands for the capture's name: truth/{}.npz")
            })
            .mut_arg("json", |arg| {
                arg.help("Print a line of JSON for each capture on a terminal, too; elsewhere they are always printed")
            })
            .mut_arg("quiet", |arg| arg.help("Only errors and the summary on stderr"));
        NOT_HERE.into_iter().fold(command, |command, id| command.mut_arg(id, |arg| arg.hide(true)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for BatchArgs {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<BatchArgs, clap::Error> {
        let all = reconstruct::ReconstructArgs::augment_args(Command::new("reconstruct"));
        let was_given = |id: &str| matches.value_source(id) == Some(ValueSource::CommandLine);
        let mut options = vec![];
        for id in all.get_arguments().map(|arg| arg.get_id().as_str()).filter(|id| was_given(id)) {
            if !NO_DIFFERENCE.contains(&id) {
                let values: Vec<_> = matches.get_raw(id).into_iter().flatten().collect();
                options.push(format!("{id} {values:?}"));
            }
        }
        options.sort();
        Ok(BatchArgs {
            captures: matches.get_many("capture").into_iter().flatten().cloned().collect(),
            options,
            unfit: NOT_HERE.into_iter().find(|id| was_given(id)),
            own: Own::from_arg_matches(matches)?,
            each: reconstruct::ReconstructArgs::from_arg_matches(matches)?,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = BatchArgs::from_arg_matches(matches)?;
        Ok(())
    }
}

pub fn run(args: &BatchArgs) -> Result<ExitCode> {
    let wrong = |what: String, hint: &'static str| Err(Error::options(what, hint));
    if let Some(option) = args.unfit {
        let option = option.replace('_', "-");
        return wrong(
            format!("--{option} is no option of a batch"),
            "leave it out, or reconstruct this capture by itself",
        );
    }
    if let Some(jobs) = args.own.jobs.filter(|jobs| !(1..=MOST_JOBS).contains(jobs)) {
        return wrong(format!("--jobs is {jobs}"), "give 1 to 256");
    }
    let shard = args.own.part.as_deref().unwrap_or("1/1");
    let parts = shard.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
    let Some(parts) = parts.filter(|(part, of)| (1..=*of).contains(part)) else {
        return wrong(
            format!("the part is {shard:?}"),
            "give a part and the number of parts: 1/8, 2/8, and so on to 8/8",
        );
    };
    args.each.check()?;
    let device = &args.each.capture.device;
    let batch = Batch {
        captures: named(&captures(&args.captures)?),
        shard: parts,
        out: args.each.out.clone(),
        options: args.options.clone(),
        device: gpu::GpuOptions {
            device: args.each.capture.settings.settings()?.device,
            pipeline_cache: device.pipeline_cache(),
            validation: device.validation,
            ..gpu::GpuOptions::default()
        },
        jobs: args.own.jobs,
    };
    interrupt::stop_in_order();
    let running =
        RunningBatch { args, bar: bar(args.each.quiet, "{wide_msg} {elapsed}"), begun: Mutex::default() };
    let tally = batch::batch(&batch, &running, &mut |end| report(end, &running));
    running.bar.iter().for_each(ProgressBar::finish_and_clear);
    let tally = tally?;
    if running.prints_json() {
        let mut summary = json!(tally);
        summary["summary"] = true.into();
        print(&summary.to_string());
    }
    let Tally { captures, done, skipped, failed, stopped, seconds } = tally;
    let left = if stopped { format!(", {} left", captures - done - skipped - failed) } else { String::new() };
    let index = if done + skipped > 0 {
        format!("; all results: {}", batch.out.join("index.html").display())
    } else {
        String::new()
    };
    say(&format!(
        "{captures} captures: {done} done, {skipped} skipped, {failed} failed{left}, in {seconds:.1} s{index}"
    ));
    Ok(match (interrupt::asked().is_break() && stopped, failed) {
        (true, _) => ExitCode::from(STOPPED),
        (false, 0) => ExitCode::SUCCESS,
        (false, _) => ExitCode::from(1),
    })
}

/// A line of JSON on stdout; where the batch is, warnings and errors on stderr.
fn report(end: &CaptureEnd, running: &RunningBatch<'_>) {
    let (args, name, [number, of]) = (running.args, &end.capture.name, end.number);
    if running.prints_json() {
        print(&line(end, &args.each.out));
    }
    if let Some(e) = &end.error {
        running.note(|| say_error(&format!("{name}: "), &e.what, &advice::text(&e.hint)));
    }
    if args.each.quiet {
        return;
    }
    let left = match (end.remaining, of - number) {
        (Some(seconds), 1..) => format!("; about {} left", tables::seconds(seconds)),
        _ => String::new(),
    };
    let how = match end.status {
        Status::Done => format!("done in {}", tables::seconds(end.seconds)),
        Status::Skipped => "is there already".into(),
        Status::Failed => "failed".into(),
    };
    running.note(|| {
        say(&format!("{number} of {of}: {name} {how}{left}"));
        end.warnings.iter().for_each(|warning| say(&format!("warning: {name}: {warning}")));
    });
}

fn line(end: &CaptureEnd, out: &Path) -> String {
    let name = &end.capture.name;
    json!({
        "capture": end.capture.path.to_string_lossy(),
        "name": name,
        "status": end.status,
        "seconds": end.seconds,
        "error": end.error.as_ref().map(|e| &e.what),
        "hint": end.error.as_ref().map(|e| advice::text(&e.hint)),
        "folder": end.error.is_none().then(|| out.join(name).to_string_lossy().into_owned()),
        "figures": end.figures,
        "warnings": end.warnings,
    })
    .to_string()
}

/// A batch that runs, with the bar of a terminal.
struct RunningBatch<'a> {
    args: &'a BatchArgs,
    bar: Option<ProgressBar>,
    /// Numbers and phases of captures that began, by name.
    begun: Mutex<BTreeMap<String, (usize, Phase)>>,
}

impl RunningBatch<'_> {
    /// Whether lines of JSON are for a program, or asked for.
    fn prints_json(&self) -> bool {
        self.args.each.json || !std::io::stdout().is_terminal()
    }

    /// Writes lines that stay.
    fn note(&self, write: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }
}

impl Caller for RunningBatch<'_> {
    fn beside(&self, capture: &Listed) -> Vec<PathBuf> {
        self.args.each.truth.iter().map(|truth| with_name(truth, &capture.name)).collect()
    }

    fn load(&self, capture: &Listed) -> Result<(Loaded, Request)> {
        let (loaded, mut request) = self.args.each.load(&capture.path)?;
        for file in [&mut request.truth, &mut request.volume_file].into_iter().flatten() {
            *file = with_name(file, &capture.name);
        }
        Ok((loaded, request))
    }

    fn progress(&self, capture: &Listed, of: usize, progress: &Progress) {
        let Some(bar) = &self.bar else { return };
        let mut begun = self.begun.lock().unwrap_or_else(PoisonError::into_inner);
        let next = begun.len() + 1;
        let (number, phase) = begun.entry(capture.name.clone()).or_insert((next, Phase::default()));
        bar.set_message(format!("{number} of {of}: {}  {}", capture.name, phase.state(progress)));
    }

    fn hint(&self, error: &Error) -> String {
        advice::text(&error.hint)
    }

    fn may_continue(&self) -> ControlFlow<()> {
        interrupt::asked()
    }
}

/// The path with the name in place of `{}`. Paths without it stay as they are: they may be no text.
fn with_name(path: &Path, name: &str) -> PathBuf {
    let part = |part: Component<'_>| match part.as_os_str().to_string_lossy() {
        text if text.contains("{}") => text.replace("{}", name).into(),
        _ => part.as_os_str().to_owned(),
    };
    path.components().map(part).collect()
}

/// The captures that the arguments name, in their order. A pattern that matches nothing stays a path: it fails by itself.
///
/// # Errors
/// A list that cannot be read; a wrong pattern.
fn captures(arguments: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = vec![];
    for argument in arguments {
        let is_stdin = argument.as_os_str() == "-";
        // No capture format has this ending.
        if !is_stdin && argument.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("txt")) {
            add(argument, &mut all)?;
            continue;
        }
        let mut text = String::new();
        let read = match is_stdin {
            true => std::io::stdin().read_to_string(&mut text).map(drop),
            false => std::fs::read_to_string(argument).map(|read| text = read),
        };
        read.map_err(|e| {
            Error::input(format!("{}: the list cannot be read: {e}", argument.display()), "check the path")
        })?;
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
        lines.map(Path::new).try_for_each(|line| add(line, &mut all))?;
    }
    match all.is_empty() {
        true => Err(Error::input(
            "the batch has no captures",
            "give captures, a pattern, or a list with one a line",
        )),
        false => Ok(all),
    }
}

fn add(path: &Path, all: &mut Vec<PathBuf>) -> Result<()> {
    let (text, before) = (path.to_string_lossy(), all.len());
    if !path.exists() && text.contains(['*', '?', '[']) {
        let found = glob::glob(&text).map_err(|e| {
            Error::options(
                format!("{text}: the pattern is wrong: {e}"),
                "write it as a shell does: captures/*.npz",
            )
        })?;
        all.extend(found.flatten());
    }
    if path.is_dir() && !is_capture(path) {
        all.extend(captures_in(path)?);
        if all.len() == before {
            return Err(Error::input(
                format!("{}: there is no capture in the folder", path.display()),
                "give a folder of captures, or a pattern: 'scans/*/*.npz'",
            ));
        }
    }
    if all.len() == before {
        all.push(path.into());
    }
    Ok(())
}
