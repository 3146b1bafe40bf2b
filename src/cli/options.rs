//! Makes the solvers' options on the command line from their declarations.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches, value_parser};
use serde::de::DeserializeOwned;
use thirdbounce::job::SolverOptions;
use thirdbounce::solve::Sizes;
use thirdbounce::solve::option::{OptionValue, Range, Row, Suit};

use super::units;

/// Parses one of the words that stand for values of `T` in files.
pub fn word<T: DeserializeOwned + Clone + Send + Sync + 'static>(
    words: &'static [&'static str],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(words).try_map(|w| serde_json::from_value::<T>(serde_json::Value::String(w)))
}

/// The options that were given, by their keys.
#[derive(Debug, Clone, Default)]
pub struct OptionValues(Vec<(&'static str, OptionValue)>);

impl OptionValues {
    pub fn all(&self) -> impl Iterator<Item = &(&'static str, OptionValue)> {
        self.0.iter()
    }
}

/// The name of the option of this key, without dashes before it.
pub fn flag(key: &str) -> String {
    let rows = SolverOptions::all_rows();
    let named = rows.iter().find(|(row, _)| row.key == key);
    named.map_or_else(|| key.replace('_', "-"), |(row, _)| flag_of(row).unwrap_or_else(|| row.name()))
}

/// The flag of an option that is on or off: `name`, or `no-name` if it is on by default.
fn flag_of(row: &Row) -> Option<String> {
    let default = || {
        let all = SolverOptions::NAMES.iter().filter_map(|name| SolverOptions::suited_to(name, &Suit::USUAL));
        all.filter_map(|options| options.get(row.key)).next()
    };
    match row.range {
        Range::Flag if default() == Some(OptionValue::Flag(true)) => Some(format!("no-{}", row.name())),
        Range::Flag => Some(row.name()),
        _ => None,
    }
}

impl clap::Args for OptionValues {
    fn augment_args(command: Command) -> Command {
        SolverOptions::all_rows().into_iter().fold(command, |command, (row, text)| {
            if row.range == Range::Internal {
                return command;
            }
            let name = flag_of(row).unwrap_or_else(|| row.name());
            let text = if name.starts_with("no-") { format!("Do not {}", lower(&text)) } else { text };
            let arg = Arg::new(row.key).long(name).help(text).help_heading(row.group);
            command.arg(match row.range {
                Range::Count(..) | Range::OneOf(_) => arg.value_name("N").value_parser(value_parser!(usize)),
                Range::Seed => arg.value_name("N").value_parser(value_parser!(u32)),
                Range::Positive | Range::NotNegative | Range::Share | Range::Fraction => {
                    arg.value_name("X").value_parser(units::number)
                }
                Range::Length => arg.value_name("LENGTH").value_parser(units::length),
                Range::Words(words) => arg.value_name("WORD").value_parser(PossibleValuesParser::new(words)),
                Range::Sizes => arg.value_name("NAME=N,...").value_parser(value_parser!(Sizes)),
                Range::Flag | Range::Internal => arg.action(ArgAction::SetTrue),
            })
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

/// The text with its first letter in lower case, to continue a sentence.
fn lower(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_lowercase().chain(letters).collect())
}

impl FromArgMatches for OptionValues {
    fn from_arg_matches(matches: &ArgMatches) -> Result<OptionValues, clap::Error> {
        let given = |row: &'static Row| {
            let key = row.key;
            let value = match row.range {
                Range::Count(..) | Range::OneOf(_) => OptionValue::Count(*matches.get_one::<usize>(key)?),
                Range::Seed => OptionValue::Count(*matches.get_one::<u32>(key)? as usize),
                Range::Positive | Range::NotNegative | Range::Length | Range::Share | Range::Fraction => {
                    OptionValue::Number(*matches.get_one::<f64>(key)?)
                }
                Range::Words(words) => worded(key, words, matches.get_one::<String>(key)?),
                Range::Sizes => OptionValue::Word(matches.get_one::<Sizes>(key)?.to_string()),
                Range::Flag if !matches.get_flag(key) => return None,
                Range::Flag => OptionValue::Flag(!flag_of(row)?.starts_with("no-")),
                Range::Internal => return None,
            };
            Some((key, value))
        };
        Ok(OptionValues(SolverOptions::all_rows().into_iter().filter_map(|(row, _)| given(row)).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = OptionValues::from_arg_matches(matches)?;
        Ok(())
    }
}

/// A word as a value. The second word of an option that is on or off means on.
fn worded(key: &str, words: &[&str], word: &str) -> OptionValue {
    let all = SolverOptions::NAMES.iter().filter_map(|name| SolverOptions::suited_to(name, &Suit::USUAL));
    match all.filter_map(|options| options.get(key)).next() {
        Some(OptionValue::Flag(_)) => OptionValue::Flag(words.get(1) == Some(&word)),
        _ => OptionValue::Word(word.into()),
    }
}
