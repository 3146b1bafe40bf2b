//! The settings as options of the command: one for each row of [`Settings`] and of the methods.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args as _, Command, FromArgMatches};
use serde::de::DeserializeOwned;
use thirdbounce::job::{Loaded, Request};
use thirdbounce::methods::{Method, SolverOptions};
use thirdbounce::options::{OptionValue, Range, Row, SceneTraits};
use thirdbounce::settings::Settings;
use thirdbounce::{Error, Result, job};

/// Parses one of the words that stand for values of `T` in files.
pub fn word<T: DeserializeOwned + Clone + Send + Sync + 'static>(
    words: &'static [&'static str],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(words).try_map(|w| serde_json::from_value::<T>(serde_json::Value::String(w)))
}

/// The settings that complete a capture file.
pub const FILE: u8 = 0;
/// The method and its options.
pub const METHOD: u8 = 1;
/// All settings.
pub const ALL: u8 = 2;
/// Those of a capture, and what positions need of the others.
pub const POSITIONS: u8 = 3;

/// Settings of other groups than those of captures that positions need.
const OF_POSITIONS: [&str; 2] = ["model", "volume"];
/// Settings of captures that only held-out pairs decide on.
const OF_PICTURES: [&str; 2] = ["calibrate", "device_at"];

/// The settings that the help of a verb shows; `thirdbounce help TOPIC` shows the others.
const SHOWN: [&str; 14] = [
    "wall",
    "bin_width",
    "stride",
    "gate",
    "pulse",
    "model",
    "preset",
    "deterministic",
    "volume",
    "mask_fraction",
    "device",
    "memory",
    "lateral",
    "iterations",
];

/// The settings that were given, by their keys, as text.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SettingsArgs<const PART: u8>(Vec<(&'static str, String)>);

impl<const PART: u8> SettingsArgs<PART> {
    /// The settings.
    ///
    /// # Errors
    /// An option that only another method has. Ignoring it would mislead.
    pub fn settings(&self) -> Result<Settings> {
        let texts = self.0.iter().map(|(key, text)| (*key, text.as_str()));
        let checked = Settings::from_texts(texts).and_then(|settings| settings.check().map(|()| settings));
        // An error begins with the key that it is about.
        checked.map_err(|e| {
            let flag = rows(ALL).iter().find_map(|(row, _)| {
                let rest = e.what.strip_prefix(row.key).filter(|rest| rest.starts_with(' '))?;
                Some(format!("--{}{rest}", flag_of(row).unwrap_or_else(|| row.name())))
            });
            Error { what: flag.unwrap_or(e.what), ..e }
        })
    }

    /// These settings, and those of `base` that are not among them and that their method has.
    pub fn over<const OTHER: u8>(&self, base: &SettingsArgs<OTHER>) -> SettingsArgs<ALL> {
        let solver = self.solver().or(base.solver()).and_then(Method::named).unwrap_or_default();
        let of_method = Settings { method: solver, ..Settings::default() };
        let fits = |key: &str| key == "solver" || of_method.has(key);
        let others = base.0.iter().filter(|(key, _)| self.0.iter().all(|(own, _)| own != key) && fits(key));
        SettingsArgs(self.0.iter().chain(others).cloned().collect())
    }

    /// These settings with another one, if that is given.
    pub fn with(&self, key: &'static str, text: Option<String>) -> SettingsArgs<PART> {
        let others = self.0.iter().filter(|(own, _)| text.is_none() || *own != key).cloned();
        let all = others.chain(text.clone().map(|text| (key, text)));
        SettingsArgs(all.collect())
    }

    /// The settings without the options of methods: what all methods of a benchmark have.
    ///
    /// # Errors
    /// Those of [`SettingsArgs::settings`].
    pub fn of_all_methods(&self) -> Result<Settings> {
        SettingsArgs::<PART>(self.0.iter().filter(|(key, _)| is_own(key)).cloned().collect()).settings()
    }

    /// The name of the method, if it was given.
    pub fn solver(&self) -> Option<&str> {
        self.0.iter().find(|(key, _)| *key == "solver").map(|(_, name)| name.as_str())
    }
}

/// The row of the choice of a method.
const SOLVER: Row = Row {
    key: "solver",
    group: "Solver",
    lines: &[
        "Method: surface, paper, or a closed form: lct, dlct, fk, phasor, phasor-bp, fbp, bp [default: surface]",
    ],
    range: Range::Text("NAME"),
};

/// Whether a key is that of a setting of all methods.
fn is_own(key: &str) -> bool {
    Settings::ROWS.iter().any(|row| row.key == key)
}

/// The name of a row's group as a topic.
fn topic_of(row: &Row) -> String {
    row.group.to_lowercase().replace(' ', "-")
}

/// The rows of a part of the settings, with their texts.
fn rows(part: u8) -> Vec<(&'static Row, String)> {
    let is_in = |row: &Row| match part {
        FILE => row.group == "Capture file",
        METHOD => !is_own(row.key) || row.group == "Solver",
        POSITIONS => {
            let is_of_capture = row.group.starts_with("Capture") && !OF_PICTURES.contains(&row.key);
            is_of_capture || OF_POSITIONS.contains(&row.key)
        }
        _ => true,
    };
    let solver = [METHOD, ALL].contains(&part).then(|| (&SOLVER, SOLVER.text()));
    solver.into_iter().chain(Settings::all_rows().into_iter().filter(|(row, _)| is_in(row))).collect()
}

/// The flag of an option that is on or off: `name`, or `no-name` if it is on by default.
fn flag_of(row: &Row) -> Option<String> {
    let default = || {
        let all = SolverOptions::NAMES
            .iter()
            .filter_map(|name| SolverOptions::defaults_for(name, &SceneTraits::DEFAULT));
        all.filter_map(|options| options.value(row.key)).next()
    };
    let is_on = || row.key == "auto_gate" || default() == Some(OptionValue::Flag(true));
    (row.range == Range::Flag).then(|| if is_on() { format!("no-{}", row.name()) } else { row.name() })
}

/// The option of a row.
fn argument(row: &'static Row, text: &str) -> Arg {
    let name = flag_of(row).unwrap_or_else(|| row.name());
    let lower = |text: &str| text[..1].to_lowercase() + &text[1..];
    let text = if name.starts_with("no-") { format!("Do not {}", lower(text)) } else { text.into() };
    let arg = Arg::new(row.key).long(name).help(text).help_heading(row.group);
    let valued = |name| arg.clone().value_name(name);
    match row.range {
        Range::Text(name) => valued(name),
        Range::Words(words) => arg.value_name("WORD").value_parser(PossibleValuesParser::new(words)),
        Range::Length => valued("LENGTH"),
        Range::Count(..) | Range::OneOf(_) | Range::Seed => valued("N"),
        Range::Positive | Range::NotNegative | Range::Share | Range::Fraction => valued("X"),
        Range::Flag | Range::Internal => arg.action(ArgAction::SetTrue),
    }
}

impl<const PART: u8> clap::Args for SettingsArgs<PART> {
    fn augment_args(command: Command) -> Command {
        rows(PART).into_iter().fold(command, |command, (row, text)| {
            let is_shown =
                [FILE, POSITIONS].contains(&PART) || row.key == "solver" || SHOWN.contains(&row.key);
            let arg = argument(row, &text).hide(!is_shown).allow_hyphen_values(row.range != Range::Flag);
            command.arg(if row.key == "accumulation" { arg.conflicts_with("deterministic") } else { arg })
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<const PART: u8> FromArgMatches for SettingsArgs<PART> {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let given = |row: &'static Row| {
            let text = match flag_of(row) {
                Some(name) => matches.get_flag(row.key).then(|| (!name.starts_with("no-")).to_string())?,
                None => matches.get_one::<String>(row.key)?.clone(),
            };
            Some((row.key, text))
        };
        Ok(SettingsArgs(rows(PART).into_iter().filter_map(|(row, _)| given(row)).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The topics of `thirdbounce help`: the groups of settings, and the methods.
pub fn topics() -> Vec<String> {
    let mut groups: Vec<String> = vec![];
    for row in Settings::ROWS {
        let name = topic_of(row);
        if !groups.contains(&name) {
            groups.push(name);
        }
    }
    groups.into_iter().chain(SolverOptions::NAMES.iter().map(ToString::to_string)).collect()
}

/// The help of a topic: a command that has its options only.
pub fn topic(name: &str) -> Option<Command> {
    let command = Command::new(name.to_string())
        .disable_help_flag(true)
        .no_binary_name(true)
        .override_usage(format!("thirdbounce reconstruct CAPTURE --out DIR [OPTIONS]  ({name})"));
    let method = SolverOptions::defaults_for(name, &SceneTraits::DEFAULT);
    let has = |row: &Row| match &method {
        Some(options) => options.value(row.key).is_some(),
        None => topic_of(row) == name,
    };
    let listed: Vec<_> = Settings::all_rows().into_iter().filter(|(row, _)| has(row)).collect();
    let command = command.args(listed.iter().map(|(row, text)| argument(row, text)));
    let command = match name {
        "device" => DeviceArgs::augment_args(command).mut_args(|arg| arg.hide(false)),
        _ => command,
    };
    (!listed.is_empty()).then_some(command)
}

/// A verb whose options take negative numbers, because later checks explain better which values are allowed, with a line on the
/// topics below if it has more settings than it shows.
pub fn completed(verb: Command) -> Command {
    let has_settings = verb.get_arguments().any(|arg| arg.get_id() == "model");
    let verb = verb.mut_args(|arg| {
        let takes = arg.get_action().takes_values() && !arg.is_positional();
        if takes { arg.allow_negative_numbers(true) } else { arg }
    });
    if !has_settings {
        return verb;
    }
    let before = verb.get_after_help().map_or(String::new(), |text| format!("{text}\n\n"));
    let topics = topics().join(", ");
    verb.after_help(format!(
        "{before}More settings, by topic: thirdbounce help {topics}. Time tags: thirdbounce help histogram."
    ))
}

/// The cache of kernels, and the validation layer.
#[derive(clap::Args)]
pub struct DeviceArgs {
    /// Folder in which compiled kernels are kept between runs, or off [default: thirdbounce/kernels in the user's
    /// cache folder]
    #[arg(long, value_name = "FOLDER|off", help_heading = "Device", hide = true)]
    pub pipeline_cache: Option<PathBuf>,
    /// Turn on the Vulkan validation layer
    #[arg(long, help_heading = "Device", hide = true)]
    pub validation: bool,
}

impl DeviceArgs {
    pub fn pipeline_cache(&self) -> Option<PathBuf> {
        match &self.pipeline_cache {
            Some(given) => Some(given.clone()).filter(|folder| folder.as_os_str() != "off"),
            None => job::usual_pipeline_cache(),
        }
    }
}

/// A capture, and the settings of its reconstruction.
#[derive(clap::Args)]
pub struct CaptureArgs {
    /// Capture: a file (npz, HDF5 or MATLAB), or the folder of a capture with several files
    pub capture: PathBuf,
    #[command(flatten)]
    pub settings: SettingsArgs<ALL>,
    #[command(flatten)]
    pub device: DeviceArgs,
}

impl CaptureArgs {
    /// Reads the capture. The request has no truth and no folder of results.
    pub fn load(&self) -> Result<(Loaded, Request)> {
        load(&self.capture, &self.settings, &self.device)
    }
}

/// Reads a capture. The request has no truth and no folder of results. Settings are checked before the capture is read.
pub fn load(path: &Path, given: &SettingsArgs<ALL>, device: &DeviceArgs) -> Result<(Loaded, Request)> {
    let request = request(given, device)?;
    Ok((job::load(path, &request.settings)?, request))
}

/// The request without truth and without a folder of results.
pub fn request(given: &SettingsArgs<ALL>, device: &DeviceArgs) -> Result<Request> {
    Ok(Request {
        pipeline_cache: device.pipeline_cache(),
        validation: device.validation,
        ..Request::new(given.settings()?, "")
    })
}

/// Reads a number of an option of one verb.
pub fn number(text: &str) -> std::result::Result<f64, String> {
    thirdbounce::options::units::number(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_is_in_the_help_of_a_topic() {
        let shown: Vec<_> = topics().iter().filter_map(|name| topic(name)).collect();
        assert_eq!(shown.len(), topics().len());
        for (row, _) in Settings::all_rows() {
            assert!(shown.iter().any(|t| t.get_arguments().any(|a| a.get_id() == row.key)), "{}", row.key);
        }
        for key in SHOWN {
            assert!(Settings::all_rows().iter().any(|(row, _)| row.key == key), "{key}");
        }
    }
}
