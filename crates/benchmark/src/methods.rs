//! Methods of a comparison as text: `solver`, or `solver:key=value,key=value,...`. Keys are the options of
//! `reconstruct` without their dashes. The key `name` sets the method's name in plots.

use clap::Parser;
use thirdbounce::{Error, Result};

use thirdbounce_command::cli::settings::{self, ALL, METHOD, SettingsArgs};

/// A method as it was asked for.
pub struct Spec {
    pub text: String,
    /// Its name in plots and folders: the given one, or its text.
    pub name: String,
    /// Its settings, and those of all methods.
    pub settings: SettingsArgs<ALL>,
    pub trace_every: Option<usize>,
    /// Its curve does not begin with a preview.
    pub no_preview: bool,
    /// Seconds after which it is stopped.
    pub limit: Option<f64>,
    /// It is left out if the capture breaks an assumption of it; else that is an error.
    pub is_optional: bool,
}

#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct SpecArgs {
    #[command(flatten)]
    settings: SettingsArgs<METHOD>,
    #[arg(long)]
    depth_pitch: Option<String>,
    #[arg(long)]
    trace_every: Option<usize>,
    #[arg(long)]
    no_preview: bool,
    #[arg(long, value_parser = settings::number)]
    time_limit: Option<f64>,
}

/// Reads a method. `base` holds the options of all methods; a method's own options come first.
///
/// # Errors
/// An unknown solver, an unknown key or a value out of range, each with the method's text.
pub fn parse(text: &str, base: &SettingsArgs<ALL>) -> Result<Spec> {
    let text = text.trim();
    let hint =
        "write solver:key=value,key=value with the options of `thirdbounce reconstruct --help` as keys";
    let wrong = |what: String| Error::options(format!("method {text:?}: {what}"), hint);
    let (solver, settings) = text.split_once(':').unwrap_or((text, ""));
    thirdbounce::methods::method(solver.trim()).map_err(|e| e.at(format!("method {text:?}")))?;
    let mut arguments = vec![format!("--solver={}", solver.trim())];
    let mut name = None;
    for setting in settings.split(',').map(str::trim).filter(|s| !s.is_empty()) {
        let setting = setting.trim_start_matches('-');
        match setting.split_once('=') {
            Some(("name", given)) => name = Some(given.trim().to_string()),
            Some((key, value)) => arguments.push(format!("--{}={}", key.trim(), value.trim())),
            None => arguments.push(format!("--{setting}")),
        }
    }
    let args = SpecArgs::try_parse_from(arguments).map_err(|e| {
        let said = e.to_string();
        wrong(said.lines().next().unwrap_or("").trim_start_matches("error: ").to_string())
    })?;
    let SpecArgs { settings, depth_pitch, trace_every, no_preview, time_limit } = args;
    if time_limit.is_some_and(|limit| !(limit.is_finite() && limit > 0.0)) {
        return Err(wrong("the time limit is not above 0 s".into()));
    }
    let checked = settings.settings().and_then(|_| {
        let settings = settings.over(&base.with("depth_pitch", depth_pitch));
        settings.settings().map(|_| settings)
    });
    let settings = checked.map_err(|e| e.at(format!("method {text:?}")))?;
    let name = name.filter(|n| !n.is_empty()).unwrap_or_else(|| text.to_string());
    let limit = time_limit;
    Ok(Spec { text: text.to_string(), name, settings, trace_every, no_preview, limit, is_optional: false })
}
