//! `thirdbounce live SOURCE --capture SCAN`.

use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use thirdbounce::capture::{Capture, Turn, auto_gate};
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::live::{self, News, Page, Source, Summary};
use thirdbounce::session::{Feed, Frame, Latency, SessionOptions};
use thirdbounce::solve::Follow;
use thirdbounce::solve::option::OptionValue;
use thirdbounce::{Error, Result, capture, export, job};

use super::histogram::FromTags;
use super::solver::SolverArgs;
use super::terminal::{print, say, say_error};
use super::units::{length, milliseconds, path};
use super::{advice, input, interrupt};

#[derive(clap::Args)]
pub struct Args {
    /// Where frames come from: a folder in which npz captures appear, a pipe or file with a stream of frames
    /// (docs/live.md), - for a stream on the standard input, or, with --scan, a file of time tags that grows: a frame for each
    /// pass of the scan
    #[arg(required_unless_present = "listen")]
    source: Option<PathBuf>,
    /// A capture with the points, bins, pulse and spots of all frames. If it has light, the box ends where its light does, and
    /// quick trials find the model and the pulse, as in reconstruct
    #[arg(long, value_name = "CAPTURE", required_unless_present = "scan", conflicts_with = "scan")]
    capture: Option<PathBuf>,
    /// Distance of the outermost scan points along the longer side, such as 2m or 80cm
    #[arg(long, value_name = "SIZE", value_parser = length, requires = "scan", help_heading = "Time tags")]
    wall: Option<f64>,
    /// Bin width: a time (32ps) or a path (9.6mm, metres as a plain number)
    #[arg(long, value_name = "WIDTH", value_parser = path, requires = "scan", help_heading = "Time tags")]
    bin_width: Option<f64>,
    /// Mirror the scan: x swaps left and right as seen in the pictures, y swaps up and down, xy does both
    #[arg(long, value_name = "x|y|xy", requires = "scan", help_heading = "Time tags")]
    flip: Option<String>,
    /// Turn the scan by 90, 180 or 270 degrees after --flip, clockwise as seen in the pictures
    #[arg(long, value_name = "DEGREES", requires = "scan", help_heading = "Time tags")]
    rotate: Option<u32>,
    /// Use only these paths: 0.8:2.4 or 80cm: [default: those behind the direct light of the first pass]
    #[arg(
        long,
        value_name = "FROM:TO",
        allow_hyphen_values = true,
        requires = "scan",
        help_heading = "Time tags"
    )]
    gate: Option<String>,
    /// How the instrument spreads a path over time: a width (60ps), or an npz file with a pulse
    #[arg(long, value_name = "M|M:TAIL|FILE", requires = "scan", help_heading = "Time tags")]
    pulse: Option<String>,
    #[command(flatten)]
    tags: FromTags,
    /// Take streams from programs that connect to this address, such as 127.0.0.1:7000. Other addresses than those of this
    /// machine let others on the network send frames
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "source")]
    listen: Option<SocketAddr>,
    /// File with the token that programs send before their frames, in its first line; needed where others on the network can
    /// connect (docs/live.md)
    #[arg(long, value_name = "FILE", requires = "listen")]
    token: Option<PathBuf>,
    /// Serve a page with the newest maps on this port, for a browser on this machine; 0: a free port
    #[arg(long, value_name = "PORT")]
    page: Option<u16>,
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
    /// Write the maps of the last frame to this folder at the end
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// End after N frames
    #[arg(long, value_name = "N")]
    frames: Option<u64>,
    /// Index or part of the name of the Vulkan device [default: the best]
    #[arg(long, value_name = "DEVICE", help_heading = "Device")]
    device: Option<String>,
    /// No line for each frame
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    solver: SolverArgs,
}

pub fn run(args: &Args) -> Result<()> {
    args.solver.choice().check()?;
    args.solver.check_fit()?;
    let options =
        SessionOptions { feed: feed(&args.feed)?, follow: follow(args)?, ..SessionOptions::default() };
    if let Some(out) = &args.out {
        job::check_file(&out.join("maps.npz"))?;
    }
    interrupt::stop_in_order();
    let Some((source, scan)) = source(args)? else { return Ok(()) };
    // Frames follow each other by all of their light: fast light is new wherever something moves.
    let resolved = args.solver.choice().with_usual("high_pass", &OptionValue::Number(0.0)).resolve(&scan);
    let gpu = Gpu::open(&GpuOptions { device: args.device.clone(), ..GpuOptions::default() })?;
    let page = args.page.map(Page::serve).transpose()?;
    if let Some(page) = &page {
        print(&format!("page      http://{}/", page.address()));
    }
    let tuned = resolved.tune(&gpu, &scan, None, &mut |_| interrupt::asked())?;
    if !args.quiet {
        tuned.found.notes().iter().for_each(|note| say(note));
    }
    let solver = tuned.solver.clone();
    let mut last = None;
    let done = live::run(&gpu, &tuned.scan, &solver, options, &source, page.as_ref(), &mut |news| {
        match news {
            News::Solved(frame, latency) => {
                if !args.quiet {
                    print(&line(frame, &latency));
                }
                if args.out.is_some() {
                    last = Some(frame.result.maps.clone());
                }
                if args.frames.is_some_and(|most| latency.frames >= most) {
                    return ControlFlow::Break(());
                }
            }
            News::Wrong(error) => {
                say_error("", &error.what, &advice::text(&error.mend));
            }
            News::Idle => {}
        }
        interrupt::asked()
    })?;
    if let (Some(out), Some(maps)) = (&args.out, &last) {
        export::write_maps(out, maps)?;
        print(&format!("wrote     {}", out.display()));
    }
    print(&summary(&done));
    Ok(())
}

/// Where frames come from, and a capture of their points and bins; `None` if the user ends it before there is one.
fn source(args: &Args) -> Result<Option<(Source, Capture)>> {
    let Some(capture) = &args.capture else { return growing(args) };
    let source = match (&args.source, args.listen) {
        (_, Some(address)) => {
            Source::Listen { address, token: args.token.as_deref().map(token).transpose()? }
        }
        (Some(path), _) if path.as_os_str() == "-" => Source::Stdin,
        (Some(path), _) if path.is_dir() => Source::Folder(path.clone()),
        (Some(path), _) => Source::Stream(path.clone()),
        (None, None) => unreachable!("one of them is given"),
    };
    Ok(Some((source, capture::read(capture)?)))
}

/// The token in a file.
fn token(file: &Path) -> Result<String> {
    let text = std::fs::read_to_string(file).map_err(|e| {
        Error::options(
            format!("{}: the token cannot be read: {e}", file.display()),
            "give a text file with one line",
        )
    })?;
    Ok(text.lines().next().unwrap_or_default().trim().to_string())
}

/// A file of time tags, and the capture of its first pass.
fn growing(args: &Args) -> Result<Option<(Source, Capture)>> {
    let Some(path) = &args.source else {
        return Err(Error::options(
            "--scan was given, but no file of time tags",
            "give the file, not --listen",
        ));
    };
    let turn = Turn::parse(args.flip.as_deref(), args.rotate)?;
    let gate = args.gate.as_deref().map(input::gate).transpose()?;
    let pulse = args.pulse.as_deref().map(input::pulse).transpose()?;
    let (scan, asked) = (args.tags.scan(args.wall)?, args.tags.asked(args.bin_width, turn)?);
    let mut tags = live::Tags { path: path.clone(), scan, asked, gate };
    let Some(first) = tags.first(&interrupt::asked)? else { return Ok(None) };
    let found = if gate.is_none() { auto_gate(&first) } else { None };
    let mut first = match &found {
        Some(found) => {
            say(&format!("note: automatic gate: {}", found.reason));
            tags.gate = Some(found.gate);
            first.gated(found.gate)?
        }
        None => first,
    };
    if let Some(pulse) = pulse {
        pulse.taps(first.bin_width)?;
        first.pulse = Some(pulse);
    }
    first.check()?;
    Ok(Some((Source::Tags(Box::new(tags)), first)))
}

fn line(frame: &Frame, latency: &Latency) -> String {
    let result = &frame.result;
    format!(
        "frame {:<5} {} {:>3} iterations, {:>6.0} ms from its counts, {:.1} frames/s, {} pixels of surface",
        frame.id.0,
        if result.is_warm { "warm" } else { "cold" },
        result.trace.last().map_or(0, |p| p.iteration),
        1e3 * latency.last.as_secs_f64(),
        latency.frames_per_second,
        result.maps.mask.iter().filter(|m| **m).count()
    )
}

fn summary(done: &Summary) -> String {
    let ms = |time: Duration| format!("{:.0} ms", 1e3 * time.as_secs_f64());
    let told = &done.latency;
    format!(
        "{} frames of {} solved, {} dropped, {} wrong; latency: median {}, 90 % {}, 99 % {}; {:.1} frames/s",
        told.frames,
        done.arrived,
        told.dropped,
        done.wrong,
        ms(told.median),
        ms(told.p90),
        ms(told.p99),
        told.frames_per_second
    )
}

fn feed(text: &str) -> Result<Feed> {
    // Sources do not wait: one at a time would refuse frames.
    let feed = text.parse().ok().filter(|feed| *feed != Feed::One);
    feed.ok_or_else(|| Error::options(format!("--feed is {text:?}"), "give newest, every, or sum:0.9"))
}

fn follow(args: &Args) -> Result<Option<Follow>> {
    let budget = args.budget.map(Duration::try_from_secs_f64).transpose();
    let budget = budget.map_err(|e| {
        Error::options(
            format!("--budget is {} s: {e}", args.budget.unwrap_or(f64::NAN)),
            "give a time such as 200ms, or milliseconds as a plain number",
        )
    })?;
    Ok((!args.cold).then(|| Follow { budget, ..Follow::default() }))
}
