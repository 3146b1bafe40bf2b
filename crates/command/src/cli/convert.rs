//! `thirdbounce convert IN OUT`.

use std::path::PathBuf;

use thirdbounce::{Result, capture, job};

use crate::virtual_wall::{ConfocalScan, VirtualWall};

use super::interrupt;
use super::settings::{FILE, SettingsArgs};
use super::terminal::{print, say};

#[derive(clap::Args)]
pub struct ConvertArgs {
    /// Capture to read: a file of any known format, or the folder of a capture with several files; with --as-confocal the folder of a
    /// result
    #[arg(value_name = "IN")]
    from: PathBuf,
    /// Capture to write: .npz, .hdf5 for y-tal, or .mat for meas and tofgrid as in Stanford's f-k captures
    #[arg(value_name = "OUT")]
    to: PathBuf,
    /// Sum every N neighbouring bins
    #[arg(long, value_name = "N")]
    bin: Option<usize>,
    /// Keep every Nth scan point in x and in y
    #[arg(long, value_name = "N")]
    stride: Option<usize>,
    /// Sum the histograms of every N x N neighbouring scan points
    #[arg(long, value_name = "N", conflicts_with = "stride")]
    sum: Option<usize>,
    /// Render the surface of the result IN, with its reflectance and impulse response, onto a confocal scan of these columns x rows
    /// (128x128), of the wall of the maps or of --wall, for programs that know no other scans. Measured pairs at the same points are
    /// kept
    #[arg(long, value_name = "NXxNY", conflicts_with_all = ["bin", "stride", "sum"])]
    as_confocal: Option<String>,
    #[command(flatten)]
    settings: SettingsArgs<FILE>,
}

/// Writes the surface of a result as a confocal capture.
fn confocal(args: &ConvertArgs, wall: VirtualWall) -> Result<()> {
    job::places::check_file(&args.to)?;
    let ConfocalScan { capture, share, kept, source } = wall.of(&args.from)?;
    interrupt::stop_in_order();
    let notes = capture::write(&capture, &args.to)?;
    notes.iter().for_each(|note| say(&format!("note: {note}")));
    print(&format!(
        "{}\nsurface   explains {:.1} % of the light of {} (squares beyond noise); {kept} of {} pairs are measured\nwrote     {}",
        capture.summary(),
        100.0 * share,
        source.display(),
        capture.pair_count(),
        args.to.display()
    ));
    Ok(())
}

pub fn run(args: &ConvertArgs) -> Result<()> {
    job::check_not_input(&args.to, [args.from.as_path()])?;
    let settings = args.settings.settings()?;
    if let Some(text) = &args.as_confocal {
        return confocal(args, VirtualWall { scan: VirtualWall::scan(text)?, wall: settings.wall });
    }
    let opened = capture::read_given(&args.from, &job::reading(&settings)?)?;
    opened.notes.iter().for_each(|note| say(&format!("note: {note}")));
    let mut capture = opened.capture;
    if let Some(size) = settings.wall {
        capture.set_wall(size)?;
    }
    if let Some(n) = args.stride {
        capture = capture.stride(n)?;
    }
    if let Some(n) = args.sum {
        capture = capture.summed(n)?;
    }
    if let Some(n) = args.bin {
        capture = capture.binned(n)?;
    }
    interrupt::stop_in_order();
    let notes = capture::write(&capture, &args.to)?;
    notes.iter().for_each(|note| say(&format!("note: {note}")));
    print(&format!("{}\nwrote     {}", capture.summary(), args.to.display()));
    Ok(())
}
