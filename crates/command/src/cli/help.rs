//! `thirdbounce help [TOPIC]`: a verb, a group of settings, or the options of a method.

use clap::Command;
use thirdbounce::{Error, Result};

use super::beside;
use super::settings::{topic, topics};
use super::terminal::print;

#[derive(clap::Args)]
pub struct HelpArgs {
    /// A verb, a group of settings (capture-file, capture, solver, volume, result, device), a method for its options, or an option
    topic: Option<String>,
}

/// Prints the help of `command`, of its verbs and topics.
pub fn run(args: &HelpArgs, mut command: Command) -> Result<()> {
    command.build();
    let Some(name) = &args.topic else {
        print(command.render_long_help().to_string().trim_end());
        return Ok(());
    };
    if let Some(shown) = beside::help(name) {
        return shown.map(drop);
    }
    let found = command.find_subcommand(name).cloned().or_else(|| topic(name));
    let lines = if found.is_none() { options(&command, name) } else { vec![] };
    if !lines.is_empty() {
        print(&lines.join("\n"));
        return Ok(());
    }
    let Some(mut found) = found else {
        return Err(Error::options(
            format!("there is no help on {name:?}"),
            format!("give one of {}, {}", verbs(&command), topics().join(", ")),
        ));
    };
    print(found.render_help().to_string().trim_end());
    Ok(())
}

/// A line for each option whose name has these words, with the help that has its description.
fn options(command: &Command, name: &str) -> Vec<String> {
    let name = name.trim_start_matches('-').to_lowercase().replace([' ', '_'], "-");
    let topics = topics().into_iter().filter_map(|name| topic(&name));
    let mut all: Vec<(String, String)> = vec![];
    for of in topics.chain(command.get_subcommands().cloned()) {
        for arg in of.get_arguments() {
            let Some(long) = arg.get_long().filter(|long| long.contains(&name)) else { continue };
            if all.iter().all(|(known, _)| known != long) {
                let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                all.push((long.into(), format!("--{long}: {help} (thirdbounce help {})", of.get_name())));
            }
        }
    }
    // The option of this very name alone, if there is one.
    let is_one = all.iter().any(|(long, _)| *long == name);
    all.into_iter().filter(|(long, _)| !is_one || *long == name).map(|(_, line)| line).collect()
}

fn verbs(command: &Command) -> String {
    command.get_subcommands().map(Command::get_name).collect::<Vec<_>>().join(", ")
}
