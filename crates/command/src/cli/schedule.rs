//! `thirdbounce schedule CAPTURE`.

use thirdbounce::Result;
use thirdbounce::engine::When;

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
    let parts = inspect::schedule(&request, &loaded)?;
    let first = parts.iter().filter_map(|part| match part.when {
        When::Iterations(first, _) => Some(first),
        _ => None,
    });
    if let Some(first) = first.min().filter(|first| *first > 1) {
        print(&format!("The start takes the place of iterations 1 to {}, those of a volume.\n", first - 1));
    }
    print(&parts.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"));
    Ok(())
}
