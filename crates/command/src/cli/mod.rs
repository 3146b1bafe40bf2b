//! The command line: one file per verb. The library does the work of a verb.

mod advice;
mod batch;
mod benchmark;
mod compiled;
mod convert;
mod demo;
mod devices;
mod evaluate;
mod help;
mod histogram;
mod info;
mod interrupt;
mod live;
mod methods;
mod profile;
mod progress;
mod reconstruct;
mod schedule;
mod settings;
mod simulate;
mod tables;
mod terminal;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use thirdbounce::{Error, Kind, Result};

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
    /// Most memory of the host to hold: a number in MiB, or with K, M or G after it [default: all that is free]
    #[arg(long, value_name = "SIZE", global = true, display_order = 1000, help_heading = "Host")]
    host_memory: Option<String>,
    /// Threads of the host: its kernels where it is the device, readers, writers [default: one per processor]
    #[arg(long, value_name = "N", global = true, display_order = 1001, help_heading = "Host")]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    threads: Option<u16>,
}

/// Most threads of `--threads`.
const MOST_THREADS: i64 = 1024;

/// The version, with the commit if the build names one.
fn version() -> String {
    let commit = option_env!("THIRDBOUNCE_COMMIT").filter(|commit| !commit.is_empty());
    let commit = commit.map_or_else(String::new, |commit| format!(" (commit {commit})"));
    format!("{}{commit}", env!("CARGO_PKG_VERSION"))
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
    Live(Box<live::LiveArgs>),
    /// Measure an earlier result against truth.
    Evaluate(evaluate::EvaluateArgs),
    /// Compare methods on captures and scenes, at several photon counts: error against run time, as one page. Skips what is
    /// done.
    Benchmark(Box<benchmark::BenchmarkArgs>),
    /// Make a capture of time tags: PicoQuant .ptu, arrays, text.
    Histogram(Box<histogram::HistogramArgs>),
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
    std::panic::set_hook(Box::new(|panic| {
        if thirdbounce::capture::formats::hdf5::is_guarded() {
            return;
        }
        let message = thirdbounce::panic_message(panic.payload()).unwrap_or("no message");
        let place = panic.location().map_or(String::new(), |l| format!(" at {}:{}", l.file(), l.line()));
        terminal::say(&format!("error: internal error: {message}{place}"));
        terminal::say(&format!(
            "  this is a bug in thirdbounce {}: please report it with the command you ran",
            env!("CARGO_PKG_VERSION")
        ));
    }));
    match std::panic::catch_unwind(run) {
        Ok(Ok(code)) => code,
        Ok(Err(e)) if e.kind == Kind::Cancelled => {
            terminal::say(&format!("{}, no result was written", e.what.replace(" by the caller", "")));
            ExitCode::from(130)
        }
        Ok(Err(e)) => {
            terminal::say_error("", &e.what, &advice::text(&e.hint));
            ExitCode::from(1)
        }
        Err(_) => ExitCode::from(101),
    }
}

fn run() -> Result<ExitCode> {
    let cli = match command().try_get_matches().and_then(|m| Cli::from_arg_matches(&m)) {
        Ok(cli) => cli,
        // It shows values as they were given.
        Err(e) if e.use_stderr() => {
            e.to_string().trim_end().lines().for_each(terminal::say);
            return Ok(ExitCode::from(2));
        }
        // Prints help or version, and ends with 0.
        Err(e) => e.exit(),
    };
    interrupt::listen()?;
    set_threads(cli.threads)?;
    thirdbounce::host::set_limit(cli.host_memory.as_deref().map(thirdbounce::job::memory_bytes).transpose()?);
    match cli.verb {
        Verb::Batch(args) => return batch::run(&args),
        Verb::Benchmark(args) => return benchmark::run(&args),
        Verb::Live(args) => return live::run(&args),
        Verb::Simulate(args) => return simulate::run(&args),
        Verb::Demo(args) => demo::run(&args),
        Verb::Info(args) => return info::run(&args),
        Verb::Reconstruct(args) => reconstruct::run(&args),
        Verb::Evaluate(args) => evaluate::run(&args),
        Verb::Histogram(args) => histogram::run(&args),
        Verb::Convert(args) => convert::run(&args),
        Verb::Profile(args) => profile::run(&args),
        Verb::Schedule(args) => schedule::run(&args),
        Verb::Devices(args) => devices::run(&args),
        Verb::Help(args) => help::run(&args),
    }?;
    Ok(ExitCode::SUCCESS)
}

/// Starts the threads that all parallel work of the process shares; `None`: at first use, one per processor.
fn set_threads(threads: Option<u16>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global().map_err(|e| {
        Error::options(format!("{threads} threads cannot be started: {e}"), "give fewer with --threads")
    })
}

/// The command. It accepts negative numbers, because later checks explain better which values are allowed.
pub fn command() -> clap::Command {
    Cli::command().mut_subcommands(|verb| {
        let has_settings = verb.get_arguments().any(|arg| arg.get_id() == "model");
        let verb = verb.mut_args(|arg| {
            let takes = arg.get_action().takes_values() && !arg.is_positional();
            let is_of_tags = has_settings && arg.get_help_heading() == Some("Time tags");
            let arg = if is_of_tags { arg.hide(true) } else { arg };
            if takes { arg.allow_negative_numbers(true) } else { arg }
        });
        if !has_settings {
            return verb;
        }
        let before = verb.get_after_help().map_or(String::new(), |text| format!("{text}\n\n"));
        verb.after_help(format!("{before}{}", help::more()))
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_options_hold_together() {
        super::command().debug_assert();
    }
}
