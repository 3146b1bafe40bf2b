//! `thirdbounce demo`.

use std::path::PathBuf;

use thirdbounce::Result;

use crate::demo::demo;

use super::progress::Meter;
use super::terminal::{print, say};
use super::{interrupt, tables};

#[derive(clap::Args)]
pub struct DemoArgs {
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
    /// Index or part of the name of the device, vulkan or host [default: a GPU, else the host]
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// No progress, errors only
    #[arg(long, short)]
    quiet: bool,
}

pub fn run(args: &DemoArgs) -> Result<()> {
    interrupt::stop_in_order();
    let mut meter = Meter::new(args.quiet);
    let mut tell = |line: &str| {
        if !args.quiet {
            say(line);
        }
    };
    let demo = demo(&args.out, args.device.clone(), &mut tell, &mut |progress| meter.hear(progress));
    meter.end(demo.is_ok());
    let demo = demo?;
    print(&tables::report(&demo.outcome.report));
    print(&format!(
        "\nEverything took {}, {} of it to simulate the capture.\n\
         Result and truth side by side: {}\n\
         All files, to look at or to start from: {}",
        tables::seconds(demo.seconds),
        tables::seconds(demo.simulate_seconds),
        demo.overview.display(),
        args.out.display()
    ));
    Ok(())
}
