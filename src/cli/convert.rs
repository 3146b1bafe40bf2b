//! `thirdbounce convert IN OUT`.

use std::path::PathBuf;

use thirdbounce::{Result, capture};

use super::progress::say;
use super::{interrupt, print};

#[derive(clap::Args)]
pub struct Args {
    /// Capture to read
    #[arg(value_name = "IN")]
    from: PathBuf,
    /// Capture to write: .npz, or .hdf5 for y-tal
    #[arg(value_name = "OUT")]
    to: PathBuf,
}

pub fn run(args: &Args) -> Result<()> {
    let opened = capture::read_with_notes(&args.from)?;
    opened.notes.iter().for_each(|note| say(&format!("note: {note}")));
    interrupt::take_care();
    let notes = capture::write(&opened.capture, &args.to)?;
    notes.iter().for_each(|note| say(&format!("note: {note}")));
    print(&format!("{}\nwrote     {}", opened.capture.summary(), args.to.display()));
    Ok(())
}
