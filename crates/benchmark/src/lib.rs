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

use thirdbounce_command::cli::program;

use arguments::BenchmarkArgs;

/// The command line.
pub fn command() -> clap::Command {
    const ABOUT: &str = "Compare methods on captures and scenes, at several photon counts: error against run time, as one page. \
                         Skips what is done.";
    program::beside::<BenchmarkArgs>("thirdbounce-benchmark", "thirdbounce benchmark", ABOUT)
}

/// Runs the program.
pub fn main() -> ExitCode {
    program::run_beside(command(), arguments::run)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_options_hold_together() {
        super::command().debug_assert();
    }
}
