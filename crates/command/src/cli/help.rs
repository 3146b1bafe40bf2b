//! `thirdbounce help [TOPIC]`: a verb, a group of settings, or the options of a method.

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
    /// Print the manual page
    #[arg(long, exclusive = true)]
    man: bool,
}

pub fn run(args: &HelpArgs) -> Result<()> {
    let mut command = super::command();
    if let Some(shell) = args.completions {
        clap_complete::generate(shell, &mut command, "thirdbounce", &mut std::io::stdout());
        return Ok(());
    }
    if args.man {
        let rendered = clap_mangen::Man::new(command).render(&mut std::io::stdout());
        return rendered
            .map_err(|e| Error::output(format!("the manual page is not printed: {e}"), "check the output"));
    }
    command.build();
    let Some(name) = &args.topic else {
        print(command.render_long_help().to_string().trim_end());
        return Ok(());
    };
    let found = command.find_subcommand(name).cloned().or_else(|| topic(name));
    let Some(mut found) = found else {
        let verbs: Vec<_> = command.get_subcommands().map(|verb| verb.get_name().to_string()).collect();
        return Err(Error::options(
            format!("there is no help on {name:?}"),
            format!("give one of {}, {}", verbs.join(", "), topics().join(", ")),
        ));
    };
    print(found.render_help().to_string().trim_end());
    Ok(())
}

/// The line below the options of a verb that has more settings than it shows.
pub fn more() -> String {
    format!(
        "More settings, by topic: thirdbounce help {}. Time tags: thirdbounce help histogram.",
        topics().join(", ")
    )
}
