//! `thirdbounce live SOURCE --capture SCAN`.

use std::fs::File;
use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};

use crate::folder::{FrameFolder, read_frame};
use crate::motion::Moved;
use crate::page::{Figures, LivePage, LiveTotals, Shows};
use crate::run::{self, Following, FrameSource, News};
use thirdbounce::capture::formats::ReadOptions;
use thirdbounce::engine::Reconstruction;
use thirdbounce::export::track::{TrackRow, csv};
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::maps::Maps;
use thirdbounce::options::units::{length, milliseconds};
use thirdbounce::session::{Feed, Frame, Latency, MOVING_FRAMES, SessionOptions};
use thirdbounce::surface::Follow;
use thirdbounce::{Capture, Error, Result, export, job};

use thirdbounce_command::cli::settings::{FILE, METHOD, SettingsArgs};
use thirdbounce_command::cli::terminal::{print, say, say_error};
use thirdbounce_command::cli::{advice, interrupt, program};
use thirdbounce_track::program::tracking::law;

#[derive(clap::Args)]
struct LiveArgs {
    /// Where frames come from: a folder in which captures of any format appear, or - for a stream of frames
    /// (docs/batch-and-live.md) on the standard input
    source: PathBuf,
    /// A capture with the points, bins, pulse and spots of all frames. If it has light, the box ends where its light does, and
    /// model and pulse are estimated, as in reconstruct
    #[arg(long, value_name = "CAPTURE")]
    capture: PathBuf,
    /// Serve a page with the newest maps, the totals and the last error on this port of the loopback, for a browser on this
    /// machine; 0: a free port. With an address before it (0.0.0.0:8080) other machines reach it, too, without a password
    #[arg(long, value_name = "[ADDRESS:]PORT", value_parser = page_address)]
    page: Option<SocketAddr>,
    /// Depths of the first and last colour on the page: 50cm:1.5m [default: those of the reconstructed box]
    #[arg(long, value_name = "NEAR:FAR", requires = "page", value_parser = depths)]
    page_depths: Option<[f64; 2]>,
    /// Time between frames. The page is stale after three without a result, and the time of what moves is that of its frame [default: the
    /// median of the last frames; when a frame arrives]
    #[arg(long, value_name = "TIME", value_parser = milliseconds)]
    interval: Option<f64>,
    /// A capture of the same scan without what is looked for: its light is subtracted from every frame, with a gain of that frame
    #[arg(long, value_name = "FILE", conflicts_with = "moving")]
    empty: Option<PathBuf>,
    /// Subtract the static light of the last N solved frames as an empty room, so that moving objects are left. Nothing is subtracted from
    /// the first five frames [default without N: 31]
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = MOVING)]
    moving: Option<usize>,
    /// What becomes of frames that come while one is solved: newest keeps the newest, every solves all, sum:D adds all up
    /// and multiplies the sum by D before each
    #[arg(long, value_name = "newest|every|sum:D", default_value = "newest")]
    feed: String,
    /// Time for a frame: 200ms, 0.2s, milliseconds as a plain number; as many iterations as fit
    #[arg(long, value_name = "TIME", value_parser = milliseconds)]
    budget: Option<f64>,
    /// Solve every frame from the beginning, not from the frame before
    #[arg(long, conflicts_with = "budget")]
    cold: bool,
    /// Folder for results: a line of JSON in frames.jsonl for every frame, its maps in frames/NAME.npz, and at the end all
    /// files of the last frame; with --empty or --moving track.csv, a row for every object in every frame. All are written as frames are
    /// solved
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Keep the maps of every Nth solved frame; 0: of the last one only
    #[arg(long, value_name = "N", default_value_t = 1, requires = "out")]
    keep: u64,
    /// End after N frames
    #[arg(long, value_name = "N")]
    frames: Option<u64>,
    /// Leave out the frames that are in the folder at the start
    #[arg(long)]
    new_only: bool,
    /// Index or part of the name of the device, vulkan or host [default: a GPU, else the host]
    #[arg(long, value_name = "DEVICE", help_heading = "Device")]
    device: Option<String>,
    /// No line for each frame
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    settings: SettingsArgs<METHOD>,
    #[command(flatten)]
    file: SettingsArgs<FILE>,
}

/// As text for the command line.
const MOVING: &str = "31";
const _: () = assert!(MOVING_FRAMES == 31);

/// The command line.
pub fn command() -> clap::Command {
    const ABOUT: &str =
        "Reconstruct frames as they come, from a folder or the standard input; show them on a page.";
    program::beside::<LiveArgs>("thirdbounce-live", "thirdbounce live", ABOUT)
}

/// Runs the program.
pub fn main() -> ExitCode {
    program::run_beside(command(), run)
}

fn run(args: &LiveArgs) -> Result<ExitCode> {
    let settings = args.settings.settings()?;
    let (feed, interval) = (feed(&args.feed)?, seconds("interval", args.interval)?);
    let options =
        SessionOptions { feed, follow: follow(args)?, moving: args.moving, ..SessionOptions::default() };
    interrupt::stop_in_order();
    let reading = job::reading(&args.file.settings()?)?;
    let mut opened = read_frame(&args.capture, &reading)?;
    let of_room =
        args.empty.as_ref().map(|file| set_empty(&mut opened.capture, file, &reading)).transpose()?;
    let (source, scan) = (source(args, &opened.capture, reading)?, opened.capture);
    let mut kept = args.out.as_deref().map(|out| RunFiles::open(out, args.keep)).transpose()?;
    let gpu = Gpu::open(&GpuOptions { device: args.device.clone(), ..GpuOptions::default() })?;
    let shows = Shows { depths: args.page_depths, interval };
    let page = args.page.map(|address| LivePage::serve(address, shows)).transpose()?;
    page.iter().for_each(|page| introduce(page.address(), args.quiet));
    let (session, notes) =
        thirdbounce::session_with(&gpu, &scan, &settings, options, &mut |_| interrupt::asked())?;
    if !args.quiet {
        let all = opened.notes.iter().chain(of_room.iter().flatten()).chain(&notes);
        all.for_each(|note| say(&format!("note: {note}")));
    }
    let (mut drift, mut warned, mut unwritten) = (Drift::default(), false, None);
    let mut keep = |record: &mut dyn FnMut(&mut RunFiles) -> Result<()>| match kept.as_mut().map(record) {
        Some(Err(error)) => {
            unwritten = Some(error);
            ControlFlow::Break(())
        }
        _ => interrupt::asked(),
    };
    let following = Following { law: law(&settings), interval };
    let done = run::run(session, &source, page.as_ref(), following, &mut |news| match news {
        News::Solved(name, frame, latency, warning, moved) => {
            // Once for all frames of which it is true.
            if let Some(warning) = warning.filter(|_| !warned) {
                say(&format!("warning: {name}: {warning}"));
            }
            warned = warning.is_some();
            if !args.quiet {
                print(&line(name, frame, &latency, moved));
                if drift.shows(&frame.result) {
                    say(DRIFTED);
                }
            }
            keep(&mut |kept| kept.solved(name, frame, &latency, warning, moved))?;
            match args.frames {
                Some(most) if latency.frames >= most => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        }
        News::Dropped(name) => {
            let status = if matches!(feed, Feed::Sum { .. }) { "summed" } else { "dropped" };
            keep(&mut |kept| kept.line(json!({"frame": name, "status": status})))
        }
        News::Failed(name, error) => {
            let hint = advice::text(&error.hint);
            say_error("", &error.what, &hint);
            let failed = json!({"frame": name, "status": "failed", "error": error.what, "hint": hint});
            keep(&mut |kept| kept.line(failed.clone()))
        }
        News::Others(names) => {
            say(&format!("note: {}", no_frames(names)));
            interrupt::asked()
        }
        News::Idle => interrupt::asked(),
    })?;
    if let Some(error) = unwritten {
        return Err(error);
    }
    if let Some((out, maps)) = kept.as_ref().and_then(|kept| Some((&kept.out, kept.last.as_ref()?))) {
        export::write_maps(out, maps)?;
        print(&format!("wrote     {}", out.display()));
    }
    print(&summary(&done, feed));
    if done.arrived == 0 && source == FrameSource::Stdin && interrupt::asked().is_continue() {
        return Err(Error::input(
            "the stream ended before its first frame",
            "check the program that writes it: docs/batch-and-live.md describes the bytes",
        ));
    }
    Ok(ExitCode::from(u8::from(done.failed > 0)))
}

/// Gives the scan the counts of the empty room. Returns notes.
fn set_empty(scan: &mut Capture, file: &Path, reading: &ReadOptions) -> Result<Vec<String>> {
    let pairs = scan.pair_count();
    let notes = scan.set_empty(&read_frame(file, reading)?.capture).map_err(|e| e.at(file.display()))?;
    if scan.pair_count() < pairs {
        return Err(Error::input(
            format!("{}: holds {} of the {pairs} pairs of --capture", file.display(), scan.pair_count()),
            "measure the empty room with all points of the frames, or leave these points out of both",
        ));
    }
    Ok(notes)
}

/// Says where the page is, and how another machine reaches it.
fn introduce(address: SocketAddr, quiet: bool) {
    print(&format!("page      http://{address}/"));
    let port = address.port();
    match address.ip().is_loopback() {
        true if quiet => {}
        true => say(&format!(
            "note: from another machine: ssh -N -L {port}:localhost:{port} USER@THIS-MACHINE, then open http://localhost:{port}/ there"
        )),
        false => {
            say("warning: whoever reaches this address sees the page: it has no password and no encryption")
        }
    }
}

/// The files of a run.
struct RunFiles {
    out: PathBuf,
    every: u64,
    lines: File,
    /// The table of what moves, from the first frame on of which the room is subtracted.
    table: Option<File>,
    /// Maps of the last solved frame.
    last: Option<Maps>,
}

impl RunFiles {
    /// Adds to the lines of earlier runs.
    fn open(out: &Path, every: u64) -> Result<RunFiles> {
        job::check_file(&out.join("maps.npz"))?;
        let path = out.join("frames.jsonl");
        let opened = std::fs::create_dir_all(out.join("frames"));
        let opened = opened.and_then(|()| File::options().create(true).append(true).open(&path));
        let lines = opened.map_err(|e| unwritten(&path, &e))?;
        Ok(RunFiles { out: out.into(), every, lines, table: None, last: None })
    }

    /// Adds what moves in a frame to the table, which earlier runs may have begun.
    fn add(&mut self, moved: &Moved) -> Result<()> {
        let path = self.out.join("track.csv");
        let failed = |e: std::io::Error| unwritten(&path, &e);
        let text = csv(&moved.rows);
        if self.table.is_none() {
            let mut file = File::options().create(true).append(true).open(&path).map_err(failed)?;
            if file.metadata().map_err(failed)?.len() == 0 {
                file.write_all(text.split_inclusive('\n').next().unwrap_or_default().as_bytes())
                    .map_err(failed)?;
            }
            self.table = Some(file);
        }
        let rows = text.split_once('\n').map_or("", |(_, rows)| rows);
        self.table.as_mut().map_or(Ok(()), |file| file.write_all(rows.as_bytes())).map_err(failed)
    }

    /// Writes the line of a frame, after its maps.
    fn solved(
        &mut self,
        name: &str,
        frame: &Frame,
        latency: &Latency,
        warning: Option<&str>,
        moved: Option<&Moved>,
    ) -> Result<()> {
        let mut file = Value::Null;
        if self.every > 0 && (latency.frames - 1).is_multiple_of(self.every) {
            // A name that comes again, in another stream or run, replaces nothing.
            let again = |i: u32| if i == 1 { format!("{name}.npz") } else { format!("{name}-{i}.npz") };
            let path = (1..).map(|i| self.out.join("frames").join(again(i))).find(|path| !path.exists());
            let path = path.unwrap_or_else(|| self.out.join("frames").join(name));
            export::npz::write_maps(&path, &frame.result.maps)?;
            file = path.strip_prefix(&self.out).unwrap_or(&path).to_string_lossy().into();
        }
        self.last = Some(frame.result.maps.clone());
        moved.map_or(Ok(()), |moved| self.add(moved))?;
        let mut line = json!({"frame": name, "status": "solved", "maps": file});
        let warnings: Vec<&str> =
            warning.into_iter().chain(frame.result.warnings.iter().map(String::as_str)).collect();
        let times = json!({"latency_ms": 1e3 * latency.last.as_secs_f64(), "warnings": warnings});
        let moving = moved.map_or_else(|| json!({}), |moved| {
            let failed = moved.failed.as_ref().map(|error| &error.what);
            json!({"objects": moved.rows.len(), "positions_failed": failed, "positions_ms": moved.took_ms})
        });
        for part in [json!(Figures::of(frame)), times, moving] {
            line.as_object_mut()
                .into_iter()
                .for_each(|line| line.extend(part.as_object().cloned().unwrap_or_default()));
        }
        self.line(line)
    }

    /// Writes a line with the time of day, which a kill does not lose.
    fn line(&mut self, mut line: Value) -> Result<()> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        line["unix_time"] = now.as_secs_f64().into();
        let written = self.lines.write_all(format!("{line}\n").as_bytes());
        written.map_err(|e| unwritten(&self.out.join("frames.jsonl"), &e))
    }
}

fn unwritten(path: &Path, e: &std::io::Error) -> Error {
    Error::output(
        format!("{}: cannot be written: {e}", path.display()),
        "give another --out, or make room on its disk",
    )
}

/// A port of the loopback, or an address and a port.
fn page_address(text: &str) -> std::result::Result<SocketAddr, String> {
    let port = text.parse().map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    let local = || {
        text.strip_prefix("localhost:")
            .and_then(|port| Some((IpAddr::from([127, 0, 0, 1]), port.parse().ok()?)))
    };
    port.ok()
        .or_else(|| text.parse().ok())
        .or_else(|| local().map(SocketAddr::from))
        .ok_or_else(|| "give a port, or an IP address and a port: 8080, 0.0.0.0:8080, [::1]:8080".into())
}

/// Two lengths, the smaller one first.
fn depths(text: &str) -> std::result::Result<[f64; 2], String> {
    let ends = text.split_once(':').and_then(|(near, far)| Some([length(near).ok()?, length(far).ok()?]));
    ends.filter(|[near, far]| 0.0 <= *near && near < far && far.is_finite())
        .ok_or_else(|| "give the nearest and the farthest depth: 0.5:1.5, 50cm:1.5m".into())
}

fn source(args: &LiveArgs, scan: &Capture, reading: ReadOptions) -> Result<FrameSource> {
    if args.source.as_os_str() != "-" {
        let folder = FrameFolder::new(&args.source, scan, reading, args.new_only)?;
        return Ok(FrameSource::Folder(Box::new(folder)));
    }
    if args.new_only {
        return Err(Error::options("--new-only with a stream, which has no files", "leave --new-only out"));
    }
    Ok(FrameSource::Stdin)
}

/// Files that are no frames, the first of them by name.
fn no_frames(names: &[String]) -> String {
    const NAMED: usize = 3;
    let first = names.iter().take(NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
    match names {
        [_] => format!("1 file is no frame: {first}"),
        _ => format!(
            "{} files are no frames: {first}{}",
            names.len(),
            if names.len() > NAMED { ", ..." } else { "" }
        ),
    }
}

/// Number of consecutive frames, and ratio of their residual to that of the first, from which the estimates are stale.
const LASTING: usize = 30;
const RISEN: f64 = 2.0;
const DRIFTED: &str = "note: 30 frames in a row have more than twice the relative residual of the first one. Model, impulse response or \
    high-pass may no longer fit: start again with a new --capture";

/// Compares the residuals of frames with that of the first one.
#[derive(Default)]
struct Drift {
    first: Option<f64>,
    risen: usize,
}

impl Drift {
    /// Whether the residual has risen for long, reported once per rise.
    fn shows(&mut self, frame: &Reconstruction) -> bool {
        frame.trace.last().is_some_and(|point| self.takes(point.data_loss / frame.empty_loss))
    }

    fn takes(&mut self, residual: f64) -> bool {
        let first = *self.first.get_or_insert(residual);
        self.risen = if residual > RISEN * first { self.risen + 1 } else { 0 };
        self.risen == LASTING
    }
}

fn line(name: &str, frame: &Frame, latency: &Latency, moved: Option<&Moved>) -> String {
    let figures = Figures::of(frame);
    let residual = figures.residual.map_or_else(String::new, |r| format!(", residual {r:.3}"));
    let verdict = figures.verdict.map_or_else(String::new, |verdict| format!(", {verdict}"));
    let moving = moved.map_or_else(String::new, |moved| match moved.rows.len() {
        0 => ", nothing moves".into(),
        _ => moved.rows.iter().map(|row| format!(", object {} at {}", row.track, place(row))).collect(),
    });
    format!(
        "{name:<12} {} {:>3} iterations, {:>6.0} ms from its counts, {:.1} frames/s, {} pixels of surface{residual}{verdict}{moving}",
        if figures.warm { "warm" } else { "cold" },
        figures.iterations,
        1e3 * latency.last.as_secs_f64(),
        latency.frames_per_second,
        figures.pixels,
    )
}

/// x, y, z with their standard deviations.
fn place(row: &TrackRow) -> String {
    let sigma = row.deviations();
    let of = |k: usize| format!("{:.3} ± {:.3}", row.at[k], sigma[k]);
    format!("({}, {}, {}) m", of(0), of(1), of(2))
}

/// Every frame that was seen is in one of the numbers.
fn summary(done: &LiveTotals, feed: Feed) -> String {
    let ms = |time: Duration| format!("{:.0} ms", 1e3 * time.as_secs_f64());
    let left = done.arrived.saturating_sub(done.solved + done.replaced + done.failed);
    let replaced = if matches!(feed, Feed::Sum { .. }) { "summed" } else { "dropped" };
    let mut text = format!(
        "{} frames: {} solved, {} {replaced}, {} failed",
        done.arrived + done.skipped,
        done.solved,
        done.replaced,
        done.failed
    );
    for (count, what) in [(left, "not solved at the end"), (done.skipped, "skipped by --new-only")] {
        if count > 0 {
            text += &format!(", {count} {what}");
        }
    }
    let latency = &done.latency;
    text += &format!(
        "; latency: median {}, 90 % {}, 99 % {}; {:.1} frames/s",
        ms(latency.median),
        ms(latency.p90),
        ms(latency.p99),
        latency.frames_per_second
    );
    if !done.others.is_empty() {
        text += &format!("; {}", no_frames(&done.others));
    }
    text
}

fn feed(text: &str) -> Result<Feed> {
    // Sources do not wait: one at a time would refuse frames.
    let feed = text.parse().ok().filter(|feed| *feed != Feed::One);
    feed.ok_or_else(|| Error::options(format!("--feed is {text:?}"), "give newest, every, or sum:0.9"))
}

fn follow(args: &LiveArgs) -> Result<Option<Follow>> {
    let budget = seconds("budget", args.budget)?;
    Ok((!args.cold).then(|| Follow { budget, ..Follow::default() }))
}

/// The time of an option.
fn seconds(option: &str, value: Option<f64>) -> Result<Option<Duration>> {
    value.map(Duration::try_from_secs_f64).transpose().map_err(|e| {
        Error::options(
            format!("--{option} is {} s: {e}", value.unwrap_or(f64::NAN)),
            "give a time such as 200ms, or milliseconds as a plain number",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lasting_rise_of_the_residual_is_reported_once() {
        let mut drift = Drift::default();
        let mut reports =
            |residual: f64, frames: usize| (0..frames).filter(|_| drift.takes(residual)).count();
        assert_eq!(reports(0.1, 40), 0);
        assert_eq!(reports(0.3, LASTING - 1), 0);
        assert_eq!(reports(0.1, 1), 0, "an object that passes");
        assert_eq!(reports(0.3, 3 * LASTING), 1);
        assert_eq!(reports(f64::NAN, LASTING), 0);
    }
}
