//! `thirdbounce live SOURCE --capture SCAN`.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::live::{self, News, Page, Source, Summary};
use thirdbounce::session::{Feed, Frame, Latency, SessionOptions};
use thirdbounce::solve::units::milliseconds;
use thirdbounce::solve::{Follow, Reconstruction};
use thirdbounce::{Error, Result, capture, export, job};

use super::settings::{METHOD, SettingsArgs};
use super::terminal::{print, say, say_error};
use super::{advice, interrupt};

#[derive(clap::Args)]
pub struct Args {
    /// Where frames come from: a folder in which npz captures appear, or - for a stream of frames (docs/batch-and-live.md) on the
    /// standard input
    source: PathBuf,
    /// A capture with the points, bins, pulse and spots of all frames. If it has light, the box ends where its light does, and
    /// model and pulse are estimated, as in reconstruct
    #[arg(long, value_name = "CAPTURE")]
    capture: PathBuf,
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
    settings: SettingsArgs<METHOD>,
}

pub fn run(args: &Args) -> Result<()> {
    let settings = args.settings.settings()?;
    let options =
        SessionOptions { feed: feed(&args.feed)?, follow: follow(args)?, ..SessionOptions::default() };
    if let Some(out) = &args.out {
        job::check_file(&out.join("maps.npz"))?;
    }
    interrupt::stop_in_order();
    let (source, scan) = (source(args)?, capture::read(&args.capture)?);
    let gpu = Gpu::open(&GpuOptions { device: args.device.clone(), ..GpuOptions::default() })?;
    let page = args.page.map(Page::serve).transpose()?;
    if let Some(page) = &page {
        print(&format!("page      http://{}/", page.address()));
    }
    let (session, notes) =
        thirdbounce::session(&gpu, &scan, &settings, options, &mut |_| interrupt::asked())?;
    if !args.quiet {
        notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    let (mut last, mut drift) = (None, Drift::default());
    let done = live::run(session, &source, page.as_ref(), &mut |news| {
        match news {
            News::Solved(frame, latency) => {
                if !args.quiet {
                    print(&line(frame, &latency));
                    if drift.shows(&frame.result) {
                        say(DRIFTED);
                    }
                }
                if args.out.is_some() {
                    last = Some(frame.result.maps.clone());
                }
                if args.frames.is_some_and(|most| latency.frames >= most) {
                    return ControlFlow::Break(());
                }
            }
            News::Wrong(error) => {
                say_error("", &error.what, &advice::text(&error.hint));
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

fn source(args: &Args) -> Result<Source> {
    match &args.source {
        path if path.as_os_str() == "-" => Ok(Source::Stdin),
        path if path.is_dir() => Ok(Source::Folder(path.clone())),
        path => Err(Error::input(
            format!("{} is no folder", path.display()),
            "give a folder of captures, or - and the stream on the standard input: `thirdbounce live - ... < FILE`",
        )),
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
    let reported = &done.latency;
    format!(
        "{} frames of {} solved, {} dropped, {} wrong; latency: median {}, 90 % {}, 99 % {}; {:.1} frames/s",
        reported.frames,
        done.arrived,
        reported.dropped,
        done.wrong,
        ms(reported.median),
        ms(reported.p90),
        ms(reported.p99),
        reported.frames_per_second
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
