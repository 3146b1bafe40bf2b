//! `thirdbounce benchmark ...`: runs the program `thirdbounce-benchmark`.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};

use thirdbounce::{Error, Result};

use super::program::HostArgs;

/// The verb.
pub const NAME: &str = "benchmark";

/// The program, a package of its own: `crates/benchmark`.
const PROGRAM: &str = "thirdbounce-benchmark";

#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub struct BenchmarkWords {
    /// Captures, folders and options: `thirdbounce help benchmark`
    #[arg(value_name = "CAPTURE|DIR", trailing_var_arg = true, allow_hyphen_values = true)]
    words: Vec<OsString>,
}

pub fn run(args: &BenchmarkWords, host: &HostArgs) -> Result<ExitCode> {
    let memory = host.host_memory.iter().flat_map(|size| ["--host-memory".into(), size.into()]);
    let threads = host.threads.iter().flat_map(|count| ["--threads".into(), count.to_string().into()]);
    run_with(memory.chain(threads).chain(args.words.iter().cloned()))
}

/// Runs the program in place of this one: signals and exit codes are its own.
///
/// # Errors
/// It is not installed, or does not run.
pub fn run_with(words: impl IntoIterator<Item = OsString>) -> Result<ExitCode> {
    let own = std::env::current_exe().and_then(|own| own.canonicalize()).ok();
    let beside = own.as_deref().and_then(Path::parent).map(Path::to_path_buf);
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let file = beside.into_iter().chain(std::env::split_paths(&folders)).map(|folder| folder.join(PROGRAM));
    let Some(program) = file.into_iter().find(|file| file.is_file()) else {
        return Err(Error::options(
            format!("the benchmark is not installed: {PROGRAM} is neither beside this program nor in PATH"),
            "install it with `make install`, or build it with `cargo build --release --package thirdbounce-benchmark`",
        ));
    };
    let why = Command::new(&program).args(words).exec();
    Err(Error::options(
        format!("{}: does not run: {why}", program.display()),
        "install it again with `make install`",
    ))
}
