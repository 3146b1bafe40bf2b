//! The program `thirdbounce-tags`: `thirdbounce histogram TAGS --scan SCAN --out CAPTURE`, and what `thirdbounce info` shows of tags.

mod from_tags;
mod instrument;
mod make;

use std::path::PathBuf;
use std::process::ExitCode;

use thirdbounce::job;
use thirdbounce::options::units::{length, path};
use thirdbounce::settings::Settings;
use thirdbounce_command::cli::terminal::{json, print, say};
use thirdbounce_command::cli::{interrupt, program, tables};

use crate::error::Result;
use crate::{Histograms, Inputs, Readings};
use from_tags::FromTags;
use make::{Histogramming, make};

const EXAMPLES: &str = "\
Examples:
  thirdbounce histogram scan.ptu --scan 64x64 --wall 2m --pixels 1 --out capture.npz --png check.png
  thirdbounce histogram scan.ptu --scan points.csv --pulses-per-point 250000 --bin-width 32ps --out capture.npz
  thirdbounce histogram tags.csv --scan 32x32 --wall 1m --sync-channel 1 --marker-channels 3 --pixels 1 --out capture.npz";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
struct HistogramArgs {
    /// Time tags: PicoQuant .ptu, Photon-HDF5, npz or HDF5 with timestamps and channels, text (channel, time); or histograms of an
    /// instrument: .phu, text, .npy or .npz, a log of a TMF8829 or VL53L8CH, or a MATLAB or HDF5 matrix of points and bins
    tags: PathBuf,
    #[command(flatten)]
    from: FromTags,
    /// Capture to write: .npz, .hdf5 for y-tal, or .mat. With --each-reading a folder
    #[arg(long, value_name = "CAPTURE")]
    out: PathBuf,
    /// Write a capture of every reading of an instrument's own histograms to the folder --out, reading-0000.npz and so on: frames for track
    /// and live. All have the path 0 of their sum
    #[arg(long, conflicts_with_all = ["reading", "png"])]
    each_reading: bool,
    /// Draw the mean histogram, and maps of the scan with the direct peaks and the sums of counts, into this file
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    /// Errors only
    #[arg(long, short)]
    quiet: bool,
    /// Distance of the outermost scan points along the longer side, such as 2m or 80cm
    #[arg(long, value_name = "SIZE", value_parser = length)]
    wall: Option<f64>,
    /// Bin width: a time (32ps) or a path (9.6mm, metres as a plain number) [default: the instrument's ticks, or as many as 8 ps
    /// need]
    #[arg(long, value_name = "WIDTH", value_parser = path)]
    bin_width: Option<f64>,
    /// Mirror the scan: x swaps left and right as seen in the pictures, y swaps up and down, xy does both
    #[arg(long, value_name = "x|y|xy")]
    flip: Option<String>,
    /// Turn the scan by 90, 180 or 270 degrees after --flip, clockwise as seen in the pictures
    #[arg(long, value_name = "DEGREES")]
    rotate: Option<usize>,
}

#[derive(clap::Args)]
struct TagsArgs {
    #[command(subcommand)]
    verb: TagsVerb,
}

#[derive(clap::Subcommand)]
enum TagsVerb {
    /// Make a capture of time tags: PicoQuant .ptu, arrays, text.
    Histogram(Box<HistogramArgs>),
    /// Show what a file of time tags holds, and the command that makes a capture of it.
    Info(AboutTagsArgs),
}

#[derive(clap::Args)]
struct AboutTagsArgs {
    /// Time tags
    tags: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The command line.
pub fn command() -> clap::Command {
    program::beside::<TagsArgs>(
        "thirdbounce-tags",
        "thirdbounce",
        "Captures of time tags, and what time tags hold.",
    )
}

/// Runs the program.
pub fn main() -> ExitCode {
    program::run_beside(command(), |args: &TagsArgs| {
        match &args.verb {
            TagsVerb::Histogram(args) => histogram(args)?,
            TagsVerb::Info(args) => {
                let found = instrument::instrument(&args.tags, Inputs::default())?;
                print(&if args.json { json(&found)? } else { instrument::about(&found) });
            }
        }
        Ok(ExitCode::SUCCESS)
    })
}

fn histogram(args: &HistogramArgs) -> Result<()> {
    let mut turn = Settings { rotate: args.rotate, ..Settings::default() };
    args.flip.iter().try_for_each(|text| turn.set("flip", text))?;
    let turn = job::turn(&turn)?;
    let mut asked = args.from.asked(args.bin_width, turn)?;
    if args.each_reading {
        asked.readings = Readings::Each;
    }
    let what = Histogramming {
        tags: args.tags.clone(),
        scan: args.from.scan(args.wall)?,
        asked,
        out: args.out.clone(),
        picture: args.png.clone(),
    };
    let (made, seconds) = make(&what, &mut interrupt::stop_in_order)?;
    if !args.quiet {
        made.notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    print(&text(&made, seconds));
    if args.each_reading {
        print(&format!("wrote     {}: {} captures", args.out.display(), made.readings.len()));
        return Ok(());
    }
    let files = std::iter::once(&args.out).chain(&args.png).map(|f| f.display().to_string());
    print(&format!("wrote     {}", files.collect::<Vec<_>>().join("\n          ")));
    Ok(())
}

/// What the file holds, and what became of it.
fn text(made: &Histograms, seconds: f64) -> String {
    let mut out = format!("tags      {}\n", made.instrument);
    if let Some(survey) = &made.survey {
        let records = survey.passed.records;
        out += &format!("records   {records}, read twice in {}\n", tables::seconds(seconds));
        let pulses = survey.pulses;
        match survey.period {
            Some(period) => {
                out += &format!("pulses    {pulses} of the laser, {:.4} MHz\n", 1e-6 / period);
            }
            None => out += &format!("pulses    {pulses} of the laser\n"),
        }
        for channel in &survey.channels {
            out += &format!("channel   {}: {} photons\n", channel.channel, channel.photons);
        }
    }
    if let Some([least, most]) = made.pulses {
        out += &match least == most {
            true => format!("points    {least} laser pulses each\n"),
            false => format!("points    {least} to {most} laser pulses\n"),
        };
    }
    if let Some(direct) = &made.direct {
        let (low, high) =
            direct.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        out += &format!("direct    {low:.4} to {high:.4} m of path after the laser pulse: path 0\n");
    }
    if made.left_out > 0 {
        out += &format!("left out  {} photons: between points, or too late for some\n", made.left_out);
    }
    out + &made.capture.summary().to_string()
}

#[cfg(test)]
mod tests {
    use thirdbounce::advice::{AdvicePart, Remedy, Setting};
    use thirdbounce_command::cli::{self, advice};

    #[test]
    fn the_options_hold_together() {
        super::command().debug_assert();
    }

    #[test]
    fn every_setting_has_its_flag() {
        let commands = [cli::command(), super::command()];
        let verbs: Vec<_> = commands.iter().flat_map(|all| all.get_subcommands().chain([all])).collect();
        let has = |long: &str| {
            verbs.iter().flat_map(|verb| verb.get_arguments()).any(|arg| arg.get_long() == Some(long))
        };
        assert!(has("lateral") && !has("lateral-voxels"));
        let flag = |setting: &&Setting| advice::flag(**setting);
        let missing: Vec<_> =
            Setting::ALL.iter().filter(|s| !has(flag(s).trim_start_matches("--"))).collect();
        assert!(missing.is_empty(), "{missing:?}");
        let smaller = advice::text(&[AdvicePart::Change(Remedy::SMALLER_JOB)].into());
        let flags: Vec<_> =
            smaller.split_whitespace().filter_map(|w| w.trim_end_matches(',').strip_prefix("--")).collect();
        assert!(flags.len() == 4 && flags.iter().all(|f| has(f)), "{flags:?}");
    }
}
