//! `thirdbounce help [TOPIC]`: a verb, a group of settings, or the options of a method.

use std::ffi::OsString;

use clap::Command;
use thirdbounce::{Error, Result};

use super::benchmark;
use super::settings::{topic, topics};
use super::terminal::print;

#[derive(clap::Args)]
pub struct HelpArgs {
    /// A verb, a group of settings (capture-file, capture, solver, volume, result, device), or a method for its options
    topic: Option<String>,
}

/// Prints the help of `command`, of its verbs and topics.
pub fn run(args: &HelpArgs, mut command: Command) -> Result<()> {
    command.build();
    let Some(name) = &args.topic else {
        print(command.render_long_help().to_string().trim_end());
        return Ok(());
    };
    if name == benchmark::NAME {
        return benchmark::run_with([OsString::from("--help")]).map(drop);
    }
    let found = command.find_subcommand(name).cloned().or_else(|| topic(name));
    let Some(mut found) = found else {
        return Err(Error::options(
            format!("there is no help on {name:?}"),
            format!("give one of {}, {}", verbs(&command), topics().join(", ")),
        ));
    };
    print(found.render_help().to_string().trim_end());
    Ok(())
}

fn verbs(command: &Command) -> String {
    command.get_subcommands().map(Command::get_name).collect::<Vec<_>>().join(", ")
}
