//! Compares methods, and builds of the command, on captures and scenes: error against run time, as one page.

#![warn(clippy::too_many_lines)]

mod agreement;
pub mod arguments;
pub mod cases;
pub mod compare;
pub mod foreign;
mod methods;
pub mod pages;
pub mod pinned;
pub mod run;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use thirdbounce_command::cli::program::{self, HostArgs, version};
use thirdbounce_command::cli::settings;

use arguments::BenchmarkArgs;

/// Compare methods on captures and scenes, at several photon counts: error against run time, as one page. Skips what is done.
#[derive(Parser)]
#[command(name = "thirdbounce-benchmark", bin_name = "thirdbounce benchmark", version = version())]
struct Program {
    #[command(flatten)]
    arguments: Box<BenchmarkArgs>,
    #[command(flatten)]
    host: HostArgs,
}

/// The command line.
pub fn command() -> clap::Command {
    settings::completed(Program::command())
}

/// Runs the program.
pub fn main() -> ExitCode {
    program::run(command(), |program: Program| {
        program.host.begin()?;
        arguments::run(&program.arguments)
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_options_hold_together() {
        super::command().debug_assert();
    }
}
