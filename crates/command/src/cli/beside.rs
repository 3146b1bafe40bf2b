//! Verbs that are programs of their own beside the command: `thirdbounce-benchmark`, `thirdbounce-live`, ... .

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};

use thirdbounce::{Error, Result};

use super::program::HostArgs;

/// Verbs, their packages, whose programs have the same names, and the words with which these begin.
const PROGRAMS: [(&str, &str, &[&str]); 4] = [
    ("benchmark", "thirdbounce-benchmark", &[]),
    ("live", "thirdbounce-live", &[]),
    ("track", "thirdbounce-track", &[]),
    ("histogram", TAGS, &["histogram"]),
];

/// The program of time tags, which has two verbs.
const TAGS: &str = "thirdbounce-tags";

/// All that follows the verb.
#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub struct ProgramWords {
    /// Files and options: `thirdbounce help` with the verb
    #[arg(value_name = "WORD", trailing_var_arg = true, allow_hyphen_values = true)]
    words: Vec<OsString>,
}

/// Runs a verb, with the options of the host.
///
/// # Errors
/// Its program is not installed, or does not run.
pub fn run(verb: &str, args: &ProgramWords, host: &HostArgs) -> Result<ExitCode> {
    let (package, first) = program(verb).expect("the verb is in the table");
    run_with(verb, package, words(first).chain(host.words()).chain(args.words.iter().cloned()))
}

/// Shows the help of a verb, if it is one of these.
///
/// # Errors
/// As [`run`].
pub fn help(verb: &str) -> Option<Result<ExitCode>> {
    let (package, first) = program(verb)?;
    Some(run_with(verb, package, words(first).chain(["--help".into()])))
}

/// Shows what a file of time tags holds.
///
/// # Errors
/// As [`run`].
pub fn about_tags(file: &Path, as_json: bool, host: &HostArgs) -> Result<ExitCode> {
    let json = as_json.then(|| "--json".into());
    let words = words(&["info"]).chain(host.words()).chain(json);
    run_with("histogram", TAGS, words.chain(["--".into(), file.into()]))
}

fn program(verb: &str) -> Option<(&'static str, &'static [&'static str])> {
    PROGRAMS.iter().find(|(known, ..)| *known == verb).map(|(_, package, first)| (*package, *first))
}

fn words(first: &[&str]) -> impl Iterator<Item = OsString> {
    first.iter().map(OsString::from)
}

/// Runs the program in place of this one: signals and exit codes are its own.
fn run_with(verb: &str, package: &str, words: impl Iterator<Item = OsString>) -> Result<ExitCode> {
    let own = std::env::current_exe().and_then(|own| own.canonicalize()).ok();
    let beside = own.as_deref().and_then(Path::parent).map(Path::to_path_buf);
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let file = beside.into_iter().chain(std::env::split_paths(&folders)).map(|folder| folder.join(package));
    let Some(program) = file.into_iter().find(|file| file.is_file()) else {
        return Err(Error::options(
            format!(
                "{verb} is a program of its own, {package}, which is neither beside this one nor in PATH"
            ),
            format!(
                "install it with `make install`, or build it with `cargo build --release --package {package}`"
            ),
        ));
    };
    let why = Command::new(&program).args(words).exec();
    Err(Error::options(
        format!("{}: does not run: {why}", program.display()),
        "install it again with `make install`",
    ))
}
