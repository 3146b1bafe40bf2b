//! `thirdbounce help [TOPIC]`: a verb, a group of settings, or the options of a method.

use clap::Command;
use thirdbounce::{Error, Result};

use super::settings::{topic, topics};
use super::terminal::print;

#[derive(clap::Args)]
pub struct HelpArgs {
    /// A verb, a group of settings (capture-file, capture, solver, volume, result, device), or a method for its options
    topic: Option<String>,
    /// Print completions for a shell
    #[arg(long, value_name = "SHELL", exclusive = true)]
    completions: Option<clap_complete::Shell>,
    /// Print the manual page, of a verb if one is given
    #[arg(long)]
    man: bool,
}

pub fn run(args: &HelpArgs) -> Result<()> {
    let mut command = super::command();
    if let Some(shell) = args.completions {
        let mut script = vec![];
        clap_complete::generate(shell, &mut command, "thirdbounce", &mut script);
        print(&String::from_utf8_lossy(&script));
        return Ok(());
    }
    command.build();
    if args.man {
        return manual(command, args.topic.as_deref());
    }
    let Some(name) = &args.topic else {
        print(command.render_long_help().to_string().trim_end());
        return Ok(());
    };
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

/// Prints the manual page of the command or of a verb: thirdbounce(1), thirdbounce-batch(1).
fn manual(command: Command, verb: Option<&str>) -> Result<()> {
    let page = match verb {
        None => command,
        Some(name) => command.find_subcommand(name).cloned().ok_or_else(|| {
            Error::options(
                format!("there is no manual page of {name:?}"),
                format!("give one of {}", verbs(&command)),
            )
        })?,
    };
    let mut text = vec![];
    let name = verb.map_or_else(|| "thirdbounce".into(), |verb| format!("thirdbounce-{verb}"));
    let rendered = clap_mangen::Man::new(page.name(name).version(super::version())).render(&mut text);
    rendered
        .map_err(|e| Error::output(format!("the manual page is not printed: {e}"), "report this as a bug"))?;
    print(&String::from_utf8_lossy(&text));
    Ok(())
}

/// The line below the options of a verb that has more settings than it shows.
pub fn more() -> String {
    format!(
        "More settings, by topic: thirdbounce help {}. Time tags: thirdbounce help histogram.",
        topics().join(", ")
    )
}
