//! `thirdbounce convert IN OUT`.

use std::path::PathBuf;

use thirdbounce::{Result, capture};

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
    let capture = capture::read(&args.from)?;
    interrupt::take_care();
    capture::write(&capture, &args.to)?;
    print(&format!("{}\nwrote     {}", capture.summary(), args.to.display()));
    Ok(())
}
