//! `thirdbounce batch LIST|CAPTURE|GLOB.. --out DIR`.

mod args;
mod list;

use std::ops::ControlFlow;
use std::path::{Component, Path, PathBuf};
use std::process::ExitCode;

use serde_json::json;
use thirdbounce::job::batch::{Caller, CaptureEnd, Listed, Status, Tally, named};
use thirdbounce::job::{self, Batch, Loaded, Request};
use thirdbounce::solve::Progress;
use thirdbounce::{Result, gpu};

use super::terminal::{print, say, say_error};
use super::{advice, interrupt};
pub use args::Args;

/// The word that stands for a capture's name in paths.
const NAME: &str = "{}";

/// Exit code after Ctrl-C, as for the other verbs.
const STOPPED: u8 = 130;

pub fn run(args: &Args) -> Result<ExitCode> {
    args.check()?;
    let batch = Batch {
        captures: named(&list::captures(&args.captures)?),
        shard: args.shard()?,
        out: args.each.out.clone(),
        options: args.told.clone(),
        devices: devices(args),
        jobs: args.jobs(),
    };
    interrupt::stop_in_order();
    let tally = job::batch(&batch, args, &mut |told| {
        print(&line(told).to_string());
        if !args.each.quiet {
            told.notes.iter().for_each(|note| say(&format!("note: {}: {note}", told.capture.name)));
        }
        match &told.error {
            Some(e) => say_error(&format!("{}: ", told.capture.name), &e.what, &advice::text(&e.mend)),
            None if !args.each.quiet => say(&sentence(told)),
            None => {}
        }
    })?;
    let mut summary = json!(tally);
    summary["summary"] = true.into();
    print(&summary.to_string());
    say(&text(&tally));
    Ok(match (interrupt::asked().is_break() && tally.stopped, tally.failed) {
        (true, _) => ExitCode::from(STOPPED),
        (false, 0) => ExitCode::SUCCESS,
        (false, _) => ExitCode::from(1),
    })
}

fn devices(args: &Args) -> Vec<gpu::GpuOptions> {
    let of = |device: Option<&String>| gpu::GpuOptions {
        device: device.cloned(),
        pipeline_cache: args.each.device.pipeline_cache(),
        validation: args.each.device.validation,
        ..gpu::GpuOptions::default()
    };
    if args.devices.is_empty() { vec![of(None)] } else { args.devices.iter().map(Some).map(of).collect() }
}

impl Caller for Args {
    fn load(&self, capture: &Listed) -> Result<(Loaded, Request)> {
        let each = &self.each;
        let (loaded, request) = each.load(&capture.path)?;
        let mut request = each.over(request);
        for file in [&mut request.truth, &mut request.volume_file].into_iter().flatten() {
            *file = with_name(file, &capture.name);
        }
        Ok((loaded, request))
    }

    fn may_continue(&self, _: Option<(&Listed, &Progress)>) -> ControlFlow<()> {
        interrupt::asked()
    }
}

/// The path with the name in place of `{}`. Paths without it stay as they are: they may be no text.
fn with_name(path: &Path, name: &str) -> PathBuf {
    let part = |part: Component<'_>| match part.as_os_str().to_string_lossy() {
        text if text.contains(NAME) => text.replace(NAME, name).into(),
        _ => part.as_os_str().to_owned(),
    };
    path.components().map(part).collect()
}

/// What happened to a capture, as one line of JSON.
fn line(told: &CaptureEnd) -> serde_json::Value {
    json!({
        "capture": told.capture.path.to_string_lossy(),
        "name": told.capture.name,
        "status": told.status,
        "seconds": told.seconds,
        "error": told.error.as_ref().map(|e| &e.what),
        "remedy": told.error.as_ref().map(|e| advice::text(&e.mend)),
        "folder": told.folder.as_ref().map(|path| path.to_string_lossy()),
        "figures": told.figures,
    })
}

/// The same as a sentence.
fn sentence(told: &CaptureEnd) -> String {
    let name = &told.capture.name;
    match (told.status, &told.folder) {
        (Status::Skipped, None) => format!("{name} is skipped"),
        (Status::Skipped, _) => format!("{name} is done already"),
        _ => format!("{name} is done after {:.1} s", told.seconds),
    }
}

fn text(tally: &Tally) -> String {
    let Tally { captures, done, skipped, failed, stopped, seconds } = tally;
    let left = captures - done - skipped - failed;
    let left = if *stopped { format!(", {left} left") } else { String::new() };
    format!("{captures} captures: {done} done, {skipped} skipped, {failed} failed{left}, in {seconds:.1} s")
}
