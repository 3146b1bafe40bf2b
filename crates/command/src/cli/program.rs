//! What all programs of the command line have: options of the host, one message for an error, exit codes.

use std::ffi::OsString;
use std::panic::AssertUnwindSafe;
use std::process::ExitCode;

use clap::{Args, Command, CommandFactory, FromArgMatches, Parser};
use thirdbounce::{Error, Kind, Result};

use super::{advice, interrupt, settings, terminal};

/// Memory and threads of the host.
#[derive(clap::Args)]
pub struct HostArgs {
    /// Most memory of the host to hold: a number in MiB, or with K, M or G after it [default: all that is free]
    #[arg(long, value_name = "SIZE", global = true, display_order = 1000, help_heading = "Host")]
    pub host_memory: Option<String>,
    /// Threads of the host: its kernels where it is the device, readers, writers [default: OMP_NUM_THREADS, else one per processor of the control group]
    #[arg(long, value_name = "N", global = true, display_order = 1001, help_heading = "Host")]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub threads: Option<u16>,
}

/// Most threads of `--threads`.
const MOST_THREADS: i64 = 1024;

impl HostArgs {
    /// These options as words of a command line.
    pub fn words(&self) -> impl Iterator<Item = OsString> {
        let memory = self.host_memory.iter().flat_map(|size| ["--host-memory".into(), size.into()]);
        memory.chain(self.threads.iter().flat_map(|count| ["--threads".into(), count.to_string().into()]))
    }

    /// Listens for Ctrl-C, starts the threads that all parallel work of the process shares (without a number at first use, one
    /// per processor), and limits the memory.
    ///
    /// # Errors
    /// Threads that cannot be started, a memory that is no size.
    pub fn begin(&self) -> Result<()> {
        interrupt::listen()?;
        let of_environment = || std::env::var("OMP_NUM_THREADS").ok()?.split(',').next()?.trim().parse().ok();
        // Schedulers of clusters set it for each of their workers.
        if let Some(threads) = self.threads.or_else(|| of_environment().filter(|threads| *threads > 0)) {
            rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global().map_err(|e| {
                Error::options(
                    format!("{threads} threads cannot be started: {e}"),
                    "give fewer with --threads",
                )
            })?;
        }
        let memory = self.host_memory.as_deref().map(thirdbounce::job::memory_bytes).transpose()?;
        thirdbounce::host::set_limit(memory);
        Ok(())
    }
}

/// What follows the name of a program beside the command.
#[derive(Parser)]
struct Beside<A: Args> {
    #[command(flatten)]
    arguments: A,
    #[command(flatten)]
    host: HostArgs,
}

/// The command line of a program that a verb of the command runs.
pub fn beside<A: Args>(name: &'static str, verb: &'static str, about: &'static str) -> Command {
    let command = Beside::<A>::command().name(name).bin_name(verb).version(version()).about(about);
    settings::completed(command).mut_subcommands(settings::completed)
}

/// Runs such a program.
pub fn run_beside<A: Args>(command: Command, program: impl FnOnce(&A) -> Result<ExitCode>) -> ExitCode {
    run(command, |all: Beside<A>| {
        all.host.begin()?;
        program(&all.arguments)
    })
}

/// The version, with the commit if the build names one.
pub fn version() -> String {
    let commit = option_env!("THIRDBOUNCE_COMMIT").filter(|commit| !commit.is_empty());
    let commit = commit.map_or_else(String::new, |commit| format!(" (commit {commit})"));
    format!("{}{commit}", env!("CARGO_PKG_VERSION"))
}

/// Parses the command line and runs a program. Says what is wrong, and returns the exit code.
pub fn run<A: FromArgMatches>(command: Command, program: impl FnOnce(A) -> Result<ExitCode>) -> ExitCode {
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
    let parsed = || match command.try_get_matches().and_then(|m| A::from_arg_matches(&m)) {
        Ok(arguments) => program(arguments),
        // It shows values as they were given.
        Err(e) if e.use_stderr() => {
            e.to_string().trim_end().lines().for_each(terminal::say);
            Ok(ExitCode::from(2))
        }
        // Prints help or version, and ends with 0.
        Err(e) => e.exit(),
    };
    match std::panic::catch_unwind(AssertUnwindSafe(parsed)) {
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
