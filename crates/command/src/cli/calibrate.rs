//! `thirdbounce calibrate CAPTURE --out CAPTURE`.

use std::path::PathBuf;

use thirdbounce::capture::Gate;
use thirdbounce::capture::calibrate::time_zero;
use thirdbounce::settings::gate;
use thirdbounce::{Result, capture, export, job};

use super::interrupt;
use super::settings::{FILE, SettingsArgs};
use super::terminal::{print, say};

#[derive(clap::Args)]
pub struct CalibrateArgs {
    /// Confocal capture of one small bright target, made with the instrument to calibrate
    capture: PathBuf,
    /// Capture to write, with time zero corrected: .npz or .hdf5
    #[arg(long, value_name = "CAPTURE")]
    out: PathBuf,
    /// Capture to correct by the shift that is found [default: the target's capture]
    #[arg(long, value_name = "CAPTURE")]
    apply_to: Option<PathBuf>,
    /// Try shifts of up to this many bins
    #[arg(long, value_name = "BINS", default_value_t = 40)]
    reach: usize,
    /// Draw the residual over the shift into this file
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    /// Use only these paths of the target's capture: 0.8:2.4 or 2.7ns:8ns
    #[arg(long, value_name = "FROM:TO", allow_hyphen_values = true, value_parser = gate)]
    gate: Option<Gate>,
    #[command(flatten)]
    settings: SettingsArgs<FILE>,
}

pub fn run(args: &CalibrateArgs) -> Result<()> {
    let inputs = || std::iter::once(args.capture.as_path()).chain(args.apply_to.as_deref());
    let files = std::iter::once(&args.out).chain(&args.png);
    files.into_iter().try_for_each(|file| job::check_not_input(file, inputs()))?;
    let given = job::reading(&args.settings.settings()?)?;
    let read = |path: &PathBuf| -> Result<capture::Capture> {
        let opened = capture::read_given(path, &given)?;
        opened.notes.iter().for_each(|note| say(&format!("note: {note}")));
        let mut capture = opened.capture;
        if let Some(size) = given.wall {
            capture.set_wall(size)?;
        }
        Ok(capture)
    };
    let target = read(&args.capture)?;
    let gated = match args.gate {
        Some(gate) => target.gated(gate)?,
        None => target.clone(),
    };
    let found = time_zero(&gated, args.reach).map_err(|e| e.at(args.capture.display()))?;
    let mut fixed = args.apply_to.as_ref().map_or(Ok(target), read)?;
    fixed.t_start += found.shift;
    fixed.direct = fixed.direct.map(|path| path + found.shift);
    interrupt::stop_in_order();
    let notes = capture::write(&fixed, &args.out)?;
    notes.iter().for_each(|note| say(&format!("note: {note}")));
    let p = found.target;
    // The answer comes first.
    let mut text = format!(
        "shift     {:.6} m of path, {:.2} bins, standard error {:.2}: t_start is {:.6} m now\n\
         target    ({:.4}, {:.4}, {:.4}) m, paths off by {:.6} m, {} histograms\n\
         wrote     {}\n",
        found.shift,
        found.shift / gated.bin_width,
        found.error / gated.bin_width,
        fixed.t_start,
        p.x,
        p.y,
        p.z,
        found.residual,
        found.used,
        args.out.display()
    );
    if let Some(path) = &args.png {
        export::calibration::write(path, &found)?;
        text += &format!("wrote     {}\n", path.display());
    }
    text += "\nshift (m)   bins   residual (m)\n";
    for [shift, residual] in &found.curve {
        text += &format!("{shift:>9.5} {:>6.0}   {residual:.6}\n", shift / gated.bin_width);
    }
    print(&text);
    Ok(())
}
