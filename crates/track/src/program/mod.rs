//! The program `thirdbounce-track`: `thirdbounce track FRAME... --out DIR`.

mod calibration;
pub mod tracking;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::builder::PossibleValuesParser;
use thirdbounce::export::track::TrackRow;
use thirdbounce::options::Preset;
use thirdbounce::options::units::milliseconds;
use thirdbounce_command::cli::settings::{POSITIONS, SettingsArgs, number};
use thirdbounce_command::cli::terminal::{print, say};
use thirdbounce_command::cli::{interrupt, program};
use thirdbounce_command::found::{captures_in, is_capture};

use crate::error::{Error, Kind, Result};
use crate::{BlobShape, CalibratedPair, Calibration, Edge, LocateOptions};
use calibration::calibrate;
use tracking::{Tracking, track};

const EXAMPLES: &str = "\
Examples:
  thirdbounce track capture.npz --out position
  thirdbounce track frames --empty empty.npz --frame-time 33ms --out track";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
struct TrackArgs {
    /// Captures of one scan, a frame each, in their order; or a folder of them
    #[arg(required = true, value_name = "FRAME")]
    frames: Vec<PathBuf>,
    /// Folder for the results: track.csv, track.svg, track.html, track.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of objects, 1 to 3; auto: as many as the counts prove and as do not overlap
    #[arg(long, value_name = "N|auto", default_value = "auto",
        value_parser = PossibleValuesParser::new(["1", "2", "3", "auto"]))]
    blobs: String,
    /// Shape of the objects: ball, the centre is behind the light by two thirds of the radius; flat, it is where the light comes from;
    /// upright, they stand on the scanned surface, such as a floor; any, the error includes ball and flat
    #[arg(long, value_name = "SHAPE", default_value = "any", value_parser = PossibleValuesParser::new(["any", "ball", "flat", "upright"]))]
    shape: String,
    /// Upright edge of a wall that stands on the scanned surface and hides a part of the scene: x and y of its foot in metres, and the
    /// direction of the wall from there in degrees, from +x toward +y
    #[arg(long, value_name = "X,Y,DEGREES", allow_hyphen_values = true, value_parser = edge)]
    edge: Option<Edge>,
    /// Calibrate the pairs instead: positions of one object, a line x,y,z in metres for each frame; writes calibration.json
    #[arg(long, value_name = "FILE", conflicts_with_all = ["calibration", "blobs", "shape", "edge"])]
    calibrate: Option<PathBuf>,
    /// A calibration.json: wall points, delays, light and room of the pairs, for the object that it was made with
    #[arg(long, value_name = "FILE", conflicts_with_all = ["shape", "edge"])]
    calibration: Option<PathBuf>,
    /// Time between frames: 33ms, 0.1s, milliseconds as a plain number
    #[arg(long, value_name = "TIME", default_value = "100ms", value_parser = milliseconds)]
    frame_time: f64,
    /// Standard deviation of a coordinate of the objects' acceleration, metres per second squared
    #[arg(long, value_name = "A", default_value_t = 1.0, value_parser = number)]
    acceleration: f64,
    /// Print nothing but errors
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    settings: SettingsArgs<POSITIONS>,
}

/// The command line.
pub fn command() -> clap::Command {
    const ABOUT: &str = "Positions of one to three objects with their errors, from few histograms, and their tracks over frames.";
    program::beside::<TrackArgs>("thirdbounce-track", "thirdbounce track", ABOUT)
}

/// Runs the program.
pub fn main() -> ExitCode {
    program::run_beside(command(), |args| run(args).map(|()| ExitCode::SUCCESS))
}

fn run(args: &TrackArgs) -> Result<()> {
    let mut settings = args.settings.settings()?;
    // Bins behind the light tell the background.
    settings.preset.get_or_insert(Preset::Synthetic);
    let mut hear = |_| match interrupt::asked() {
        std::ops::ControlFlow::Continue(()) => Ok(()),
        std::ops::ControlFlow::Break(()) => Err(Error::new(Kind::Cancelled, "cancelled by the caller", "")),
    };
    if let Some(positions) = &args.calibrate {
        interrupt::stop_in_order();
        let found = calibrate(&frames(&args.frames)?, positions, &settings, &args.out, &mut hear)?;
        let [error, of_middle] = found.errors;
        if error > USELESS * of_middle {
            say(
                "note: the calibration finds its own positions no better than their middle: check that captures and positions have one order",
            );
        }
        if !args.quiet {
            calibrated(&found.calibration).iter().for_each(|line| print(line));
            print(&format!(
                "error     {error:.3} m a coordinate of its own positions; of always their middle {of_middle:.3} m"
            ));
            print(&format!("wrote     {}", found.file.display()));
        }
        return Ok(());
    }
    let shape = match args.shape.as_str() {
        "ball" => BlobShape::Ball,
        "flat" => BlobShape::Flat,
        "upright" => BlobShape::Upright,
        _ => BlobShape::Any,
    };
    let volume = settings.volume.map(|volume| [volume.min, volume.max]);
    let what = Tracking {
        frames: frames(&args.frames)?,
        options: LocateOptions { blobs: args.blobs.parse().ok(), shape, volume },
        settings,
        calibration: args.calibration.clone(),
        edge: args.edge,
        frame_time: args.frame_time,
        acceleration: args.acceleration,
        out: args.out.clone(),
    };
    interrupt::stop_in_order();
    let found = track(&what, &mut hear)?;
    if args.quiet {
        return Ok(());
    }
    found.notes.iter().for_each(|note| say(&format!("note: {note}")));
    found.rows.iter().for_each(|row| print(&line(row)));
    print(&format!("rate      {:.0} frames a second", found.rate));
    let files: Vec<_> = found.files.iter().map(|file| file.display().to_string()).collect();
    print(&format!("wrote     {}", files.join("\n          ")));
    Ok(())
}

/// The captures of folders in their place.
fn frames(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = vec![];
    for path in given {
        if !path.is_dir() || is_capture(path) {
            all.push(path.clone());
            continue;
        }
        let found = captures_in(path)?;
        if found.is_empty() {
            return Err(Error::input(
                format!("{}: holds no capture", path.display()),
                "give captures, or a folder of captures",
            ));
        }
        all.extend(found);
    }
    Ok(all)
}

/// A calibration is noted that finds positions with more than this share of the error of their middle.
const USELESS: f64 = 0.95;

/// An edge of a text.
fn edge(text: &str) -> std::result::Result<Edge, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, degrees]) if [x, y, degrees].iter().all(|v| v.is_finite()) => {
            Ok(Edge::new([x, y], degrees))
        }
        _ => {
            Err("give x and y of its foot in metres and the direction of the wall in degrees: 0,0,180".into())
        }
    }
}

/// A calibration as lines.
fn calibrated(found: &Calibration) -> Vec<String> {
    let [falloff, cosine] = found.powers;
    let all = format!(
        "paths     ± {:.3} m; light falls as distance^-{falloff:.2}, cosine^{cosine:.2} on each leg",
        found.deviation
    );
    let pair = |(at, pair): (usize, &CalibratedPair)| {
        let [laser, sensor] = pair.points;
        format!(
            "pair {at:<4} laser ({:.2}, {:.2}) m, sensor ({:.2}, {:.2}) m, delay {:.2} m, light {:.3e}",
            laser.x,
            laser.y,
            sensor.x,
            sensor.y,
            pair.delay,
            pair.light.exp()
        )
    };
    std::iter::once(all).chain(found.pairs.iter().enumerate().map(pair)).collect()
}

/// A position as a line.
fn line(row: &TrackRow) -> String {
    let sigma = row.deviations();
    let of = |name: &str, value: f64, sigma: f64| format!("{name} {value:.3} ± {sigma:.3}");
    let coordinates: Vec<String> =
        ["x", "y", "z"].iter().enumerate().map(|(k, name)| of(name, row.at[k], sigma[k])).collect();
    format!(
        "{:<10} object {}: {} m, {} m, {}, {:.0} % of the light's evidence",
        row.frame,
        row.track,
        coordinates.join(", "),
        of("distance", row.distance[0], row.distance[1]),
        if row.extent[0] < 5e-4 { "no size".into() } else { format!("radius {:.3} m", row.extent[0]) },
        100.0 * row.share
    )
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_options_hold_together() {
        super::command().debug_assert();
    }
}
