//! `thirdbounce schedule CAPTURE`.

use thirdbounce::Result;

use crate::inspect;

use super::settings::CaptureArgs;
use super::terminal::print;

#[derive(clap::Args)]
pub struct ScheduleArgs {
    #[command(flatten)]
    capture: CaptureArgs,
}

pub fn run(args: &ScheduleArgs) -> Result<()> {
    let (loaded, request) = args.capture.load()?;
    let parts: Vec<_> = inspect::schedule(&request, &loaded)?.iter().map(|part| part.to_string()).collect();
    print(&parts.join("\n"));
    Ok(())
}
