//! Writes the manual pages of the command and of its verbs, and completions for shells: `shares FOLDER`.

use std::fs;
use std::io;
use std::path::Path;

use clap::Command;
use clap_complete::{Shell, generate};
use clap_mangen::Man;
use thirdbounce_command::cli;

/// Shells, and the places of their completions.
const SHELLS: [(Shell, &str); 3] = [
    (Shell::Bash, "bash-completion/completions/thirdbounce"),
    (Shell::Zsh, "zsh/site-functions/_thirdbounce"),
    (Shell::Fish, "fish/vendor_completions.d/thirdbounce.fish"),
];

fn main() -> io::Result<()> {
    let folder =
        std::env::args_os().nth(1).ok_or_else(|| io::Error::other("give a folder: shares FOLDER"))?;
    write(Path::new(&folder))
}

fn write(folder: &Path) -> io::Result<()> {
    let mut command = cli::command()
        .mut_subcommand("benchmark", |_| thirdbounce_benchmark::command().name("benchmark"))
        .mut_subcommand("live", |_| thirdbounce_live::command().name("live"))
        .mut_subcommand("track", |_| thirdbounce_track::program::command().name("track"))
        .mut_subcommand("histogram", |_| histogram());
    for (shell, place) in SHELLS {
        let mut script = vec![];
        generate(shell, &mut command, "thirdbounce", &mut script);
        put(&folder.join(place), &script)?;
    }
    command.build();
    let all = command.get_subcommands().map(|verb| (format!("thirdbounce-{}", verb.get_name()), verb));
    for (name, part) in all.chain([("thirdbounce".to_string(), &command)]) {
        put(&folder.join(format!("man/man1/{name}.1")), &page(part, name)?)?;
    }
    Ok(())
}

/// The verb of the program of time tags.
fn histogram() -> Command {
    let tags = thirdbounce_tags::program::command();
    tags.find_subcommand("histogram").cloned().expect("the program has this verb")
}

/// The manual page of the command or of a verb.
fn page(part: &Command, name: String) -> io::Result<Vec<u8>> {
    let mut text = vec![];
    Man::new(part.clone().name(name).version(cli::program::version())).render(&mut text)?;
    Ok(text)
}

fn put(file: &Path, bytes: &[u8]) -> io::Result<()> {
    file.parent().map_or(Ok(()), fs::create_dir_all)?;
    fs::write(file, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_has_a_page_and_every_shell_its_completions() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let read = |place: &str| fs::read_to_string(folder.path().join(place)).unwrap();
        assert!(read("man/man1/thirdbounce.1").starts_with(".ie"));
        for verb in cli::command().get_subcommands().map(Command::get_name) {
            let page = read(&format!("man/man1/thirdbounce-{verb}.1"));
            assert!(page.contains(&format!(".TH thirdbounce-{verb} 1")), "{verb}: {page}");
        }
        for (verb, option) in
            [("benchmark", "foreign"), ("live", "moving"), ("track", "blobs"), ("histogram", "snake")]
        {
            assert!(read(&format!("man/man1/thirdbounce-{verb}.1")).contains(option), "{verb}");
        }
        for (shell, place) in SHELLS {
            let script = read(place);
            assert!(script.contains("deterministic") && script.contains("foreign"), "{shell}: {script}");
        }
    }
}
