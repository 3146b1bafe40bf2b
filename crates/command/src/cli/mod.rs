//! The command line: one file per verb. The library does the work of a verb.

pub mod advice;
mod batch;
mod beside;
mod compiled;
mod convert;
mod demo;
mod devices;
mod evaluate;
mod help;
mod info;
pub mod interrupt;
mod profile;
pub mod program;
pub mod progress;
mod reconstruct;
mod schedule;
pub mod settings;
pub mod simulate;
pub mod tables;
pub mod terminal;

use std::process::ExitCode;

use beside::ProgramWords;
use clap::{CommandFactory, Parser, Subcommand};
use program::{HostArgs, version};
use thirdbounce::Result;

const EXAMPLES: &str = "\
Examples:
  thirdbounce demo
  thirdbounce info capture.npz
  thirdbounce reconstruct capture.npz --out result
  thirdbounce reconstruct statue.hdf5 --stride 2 --lateral 64 --preset captured --out statue
  thirdbounce batch 'scans/*.npz' --out results
  thirdbounce simulate letter-Z --out z.npz --truth z_truth.npz
  thirdbounce reconstruct z.npz --truth z_truth.npz --lateral 64 --iterations 300 --out z
  thirdbounce profile capture.npz --trace timeline.json
  thirdbounce benchmark z.npz --truth z_truth.npz --lateral 64 --method 'paper;paper:learning-rate=0.3' --out c

Lengths are metres, times are metres of path (seconds times 299792458), unless a unit follows: 32ps, 4mm, 2m.";

/// Sees around corners: reconstructs a hidden scene from light that bounced three times.
///
/// Reads transient histograms captured at a relay wall. Computes albedo, depth and surface normals of the hidden scene,
/// on any Vulkan device or on the host's processors.
#[derive(Parser)]
#[command(name = "thirdbounce", version = version(), after_help = EXAMPLES, subcommand_required = true, disable_help_subcommand = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    host: HostArgs,
}

#[derive(Subcommand)]
enum Verb {
    /// Simulate a scene, reconstruct it, measure the result and write pictures, in less than a minute.
    Demo(demo::DemoArgs),
    /// Show what a capture holds, what looks wrong in it, and what a reconstruction would do and need.
    Info(Box<info::InfoArgs>),
    /// Reconstruct a capture: maps, pictures, points and a report.
    Reconstruct(Box<reconstruct::ReconstructArgs>),
    /// Reconstruct many captures. Skips those that are done; one line of JSON each.
    Batch(Box<batch::BatchArgs>),
    /// Make a capture of a known scene, and its truth.
    Simulate(Box<simulate::SimulateArgs>),
    /// Reconstruct frames as they come, from a folder or the standard input; show them on a page.
    Live(ProgramWords),
    /// Positions of one to three objects with their errors, from few histograms, and their tracks over frames.
    Track(ProgramWords),
    /// Measure an earlier result against truth.
    Evaluate(evaluate::EvaluateArgs),
    /// Compare methods on captures and scenes, at several photon counts: error against run time, as one page. Skips what is
    /// done.
    Benchmark(ProgramWords),
    /// Make a capture of time tags: PicoQuant .ptu, arrays, text.
    Histogram(ProgramWords),
    /// Convert a capture of any known format to npz, y-tal HDF5 or Stanford MATLAB; sum or thin it on request.
    Convert(convert::ConvertArgs),
    /// Show where the time of a reconstruction goes: kernels and their limits on the device, idle time, a timeline.
    Profile(Box<profile::ProfileArgs>),
    /// Print what a reconstruction would run, dispatch by dispatch: sizes, buffers read -> buffers written.
    Schedule(Box<schedule::ScheduleArgs>),
    /// List the devices: those of Vulkan, and the host.
    Devices(devices::DevicesArgs),
    /// Show the options of a verb, of a group of settings, or of a method.
    Help(help::HelpArgs),
}

/// Runs the verb that the command line names.
pub fn main() -> ExitCode {
    program::run(command(), run)
}

fn run(cli: Cli) -> Result<ExitCode> {
    cli.host.begin()?;
    match cli.verb {
        Verb::Batch(args) => return batch::run(&args),
        Verb::Benchmark(words) => return beside::run("benchmark", &words, &cli.host),
        Verb::Live(words) => return beside::run("live", &words, &cli.host),
        Verb::Track(words) => return beside::run("track", &words, &cli.host),
        Verb::Histogram(words) => return beside::run("histogram", &words, &cli.host),
        Verb::Simulate(args) => return simulate::run(&args),
        Verb::Demo(args) => demo::run(&args),
        Verb::Info(args) => return info::run(&args, &cli.host),
        Verb::Reconstruct(args) => reconstruct::run(&args),
        Verb::Evaluate(args) => evaluate::run(&args),
        Verb::Convert(args) => convert::run(&args),
        Verb::Profile(args) => profile::run(&args),
        Verb::Schedule(args) => schedule::run(&args),
        Verb::Devices(args) => devices::run(&args),
        Verb::Help(args) => help::run(&args, command()),
    }?;
    Ok(ExitCode::SUCCESS)
}

/// The command.
pub fn command() -> clap::Command {
    Cli::command().mut_subcommands(settings::completed)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_options_hold_together() {
        super::command().debug_assert();
    }
}
