//! `thirdbounce track FRAME... --out DIR`.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use thirdbounce::export::track::TrackRow;
use thirdbounce::options::Preset;
use thirdbounce::options::units::milliseconds;
use thirdbounce::{Error, Result};
use thirdbounce_track::{BlobShape, LocateOptions};

use crate::found::{captures_in, is_capture};
use crate::track::{Tracking, track};

use super::interrupt;
use super::settings::{POSITIONS, SettingsArgs, number};
use super::terminal::{print, say};

const EXAMPLES: &str = "\
Examples:
  thirdbounce track capture.npz --out position
  thirdbounce track frames --empty empty.npz --frame-time 33ms --out track";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct TrackArgs {
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
    /// Shape of the objects: ball, the centre is behind the light by two thirds of the radius; flat, it is where the light comes from; any,
    /// the error includes both
    #[arg(long, value_name = "SHAPE", default_value = "any", value_parser = PossibleValuesParser::new(["any", "ball", "flat"]))]
    shape: String,
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

pub fn run(args: &TrackArgs) -> Result<()> {
    let mut settings = args.settings.settings()?;
    // Bins behind the light tell the background.
    settings.preset.get_or_insert(Preset::Synthetic);
    let shape = match args.shape.as_str() {
        "ball" => BlobShape::Ball,
        "flat" => BlobShape::Flat,
        _ => BlobShape::Any,
    };
    let volume = settings.volume.map(|volume| [volume.min, volume.max]);
    let what = Tracking {
        frames: frames(&args.frames)?,
        options: LocateOptions { blobs: args.blobs.parse().ok(), shape, volume },
        settings,
        frame_time: args.frame_time,
        acceleration: args.acceleration,
        out: args.out.clone(),
    };
    interrupt::stop_in_order();
    let found = track(&what, &mut |_| match interrupt::asked() {
        std::ops::ControlFlow::Continue(()) => Ok(()),
        std::ops::ControlFlow::Break(()) => {
            Err(Error::new(thirdbounce::Kind::Cancelled, "cancelled by the caller", ""))
        }
    })?;
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

/// A position as a line.
fn line(row: &TrackRow) -> String {
    let sigma = row.deviations();
    let of = |name: &str, value: f64, sigma: f64| format!("{name} {value:.3} ± {sigma:.3}");
    let coordinates: Vec<String> =
        ["x", "y", "z"].iter().enumerate().map(|(k, name)| of(name, row.at[k], sigma[k])).collect();
    format!(
        "{:<10} object {}: {} m, {} m, radius {:.3} m, {:.0} % of the light's evidence",
        row.frame,
        row.track,
        coordinates.join(", "),
        of("distance", row.distance[0], row.distance[1]),
        row.extent[0],
        100.0 * row.share
    )
}
