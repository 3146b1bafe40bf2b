//! `thirdbounce schedule CAPTURE`.

use thirdbounce::{Result, job};

use super::input::{CaptureArgs, DeviceArgs, VolumeArgs, load};
use super::solver::SolverArgs;
use super::terminal::print;

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    capture: CaptureArgs,
    #[command(flatten)]
    solver: SolverArgs,
    #[command(flatten)]
    grid: VolumeArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &Args) -> Result<()> {
    args.grid.volume_only()?;
    let (loaded, request) = load(&args.capture, &args.solver, &args.grid, &args.device)?;
    let parts: Vec<_> = job::schedule(&request, &loaded)?.iter().map(|part| part.to_string()).collect();
    print(&parts.join("\n"));
    Ok(())
}
