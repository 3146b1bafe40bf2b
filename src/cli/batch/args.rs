//! The arguments of `batch`: those of `reconstruct`, with what is different for many captures.

use std::path::PathBuf;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args as _, Command, FromArgMatches};
use thirdbounce::job::batch::Shard;
use thirdbounce::{Error, Result};

use super::super::reconstruct;

/// Options of `reconstruct` that a batch does not have: a capture that was not finished begins anew.
const NOT_HERE: [&str; 6] = ["checkpoint", "checkpoint_every", "resume", "no_preview", "open", "timings"];

/// Arguments that do not change results.
const NO_DIFFERENCE: [&str; 7] =
    ["capture", "out", "device", "memory", "pipeline_cache", "validation", "quiet"];

/// More solves at once are a slip.
const MOST_JOBS: usize = 256;

pub struct Args {
    /// Captures, patterns and lists.
    pub captures: Vec<PathBuf>,
    /// The devices that were named.
    pub devices: Vec<String>,
    /// Every option that changes results, as it was given.
    pub told: Vec<String>,
    /// An option that a batch does not have.
    unfit: Option<&'static str>,
    own: Own,
    pub each: reconstruct::Args,
}

#[derive(clap::Args)]
struct Own {
    /// Solves at once [default: one on each device]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Reconstruct only part I of N, from 1/N to N/N. The part of a capture depends on its name alone
    #[arg(long, value_name = "I/N")]
    shard: Option<String>,
}

impl Args {
    /// Refuses what no capture makes good.
    pub fn check(&self) -> Result<()> {
        if let Some(option) = self.unfit {
            return Err(Error::options(
                format!("--{} is no option of a batch", option.replace('_', "-")),
                "leave it out, or reconstruct this capture by itself",
            ));
        }
        if let Some(jobs) = self.own.jobs.filter(|jobs| !(1..=MOST_JOBS).contains(jobs)) {
            return Err(Error::options(format!("--jobs is {jobs}"), format!("give 1 to {MOST_JOBS}")));
        }
        self.each.check()
    }

    pub fn jobs(&self) -> usize {
        self.own.jobs.unwrap_or(self.devices.len().max(1))
    }

    pub fn shard(&self) -> Result<Shard> {
        self.own.shard.as_deref().map_or(Ok(Shard::default()), str::parse)
    }
}

impl clap::Args for Args {
    fn augment_args(command: Command) -> Command {
        let command = Own::augment_args(reconstruct::Args::augment_args(command));
        let command = command
            .mut_arg("capture", |arg| {
                arg.value_name("CAPTURE|GLOB|LIST.txt").num_args(1..).action(ArgAction::Append).help(
                    "Captures, or patterns such as 'scans/*.npz', or text files (.txt, or - for stdin) with a capture \
                     or a pattern a line",
                )
            })
            .mut_arg("out", |arg| arg.help("Folder for the results: one folder for each capture, named after it"))
            .mut_arg("truth", |arg| {
                arg.help("Measure the results against these truths; {} stands for the capture's name: truth/{}.npz")
            })
            .mut_arg("quiet", |arg| arg.help("Only errors and the summary on stderr"))
            .mut_arg("device", |arg| {
                arg.action(ArgAction::Append).help(
                    "Index or part of the name of a device; give it again for several, which then work at once \
                     [default: the best kind available]",
                )
            });
        NOT_HERE.into_iter().fold(command, |command, id| command.mut_arg(id, |arg| arg.hide(true)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Args {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Args, clap::Error> {
        let all = reconstruct::Args::augment_args(Command::new("reconstruct"));
        let was_given = |id: &str| matches.value_source(id) == Some(ValueSource::CommandLine);
        let given = || all.get_arguments().filter(|arg| was_given(arg.get_id().as_str()));
        let mut told: Vec<String> = given()
            .filter(|arg| !NO_DIFFERENCE.contains(&arg.get_id().as_str()))
            .map(|arg| written(arg, matches))
            .collect();
        told.sort();
        Ok(Args {
            captures: matches.get_many("capture").into_iter().flatten().cloned().collect(),
            devices: matches.get_many("device").into_iter().flatten().cloned().collect(),
            told,
            unfit: NOT_HERE.into_iter().find(|id| was_given(id)),
            own: Own::from_arg_matches(matches)?,
            each: reconstruct::Args::from_arg_matches(matches)?,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Args::from_arg_matches(matches)?;
        Ok(())
    }
}

/// An option as it was given. A value that names a file is followed by the file's size and time of change.
fn written(arg: &Arg, matches: &ArgMatches) -> String {
    let mut text = arg.get_long().map_or_else(String::new, |long| format!("--{long}"));
    if arg.get_action().takes_values() {
        for value in matches.get_raw(arg.get_id().as_str()).into_iter().flatten() {
            text += &format!(" {}", value.to_string_lossy());
            if let Ok(meta) = std::fs::metadata(value) {
                text += &format!(" ({} bytes, {:?})", meta.len(), meta.modified().ok());
            }
        }
    }
    text
}
