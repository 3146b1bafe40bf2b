//! Verbs and options of earlier versions, each with its replacement: the error for an unknown name shows it.

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// (verb, replacement).
const VERBS: &[(&str, &str)] = &[
    ("view", "use `thirdbounce reconstruct CAPTURE --out DIR --open`"),
    ("compare", "use `thirdbounce benchmark CAPTURE --truth FILE --out DIR`"),
];

/// (verb, or "" for all verbs; options without their dashes; replacement).
const OPTIONS: &[(&str, &str, &str)] = &[
    ("", "checkpoint checkpoint-every resume", SNAPSHOTS),
    ("benchmark", "own", "use --set standard"),
    ("", "prior prior-weight conv-iterations", FBP),
    ("", "surface-iterations", "use --iterations, the iterations at the resolution of the maps"),
    ("", "surface-points", "use --points"),
    ("", "surface-sparsity", "use --sparsity"),
    ("", "pixels-per-voxel", "use --lateral; maps of 128 pixels or more begin with a fit of coarser pixels"),
    (
        "",
        "cone step-share volume-model noise-factor roughness bound-every bound-power surface-blur start-above \
         coarse-iterations growth-iterations",
        VOLUME,
    ),
    ("", "all-pairs", "use --pairs with the number of pairs of the capture"),
    ("", "all-bins", "use --bins native"),
    (
        "",
        "stop",
        "use --iterations for the number of iterations and --support fixed for a run without rounds before them",
    ),
    ("", "galvo", "give --scan a file with x, y, z of each point in metres"),
    (
        "",
        "starts",
        "use --pulses-per-point, or marker tags at the begins of points with --pixels and --marker-channels",
    ),
    (
        "live",
        "listen token",
        "pipe the stream into `thirdbounce live -`, or submit frames to a session (docs/rust-c-vulkan.md)",
    ),
    (
        "live",
        "scan wall bin-width flip rotate gate pulse seen-from snake pixels lines rounds pulses-per-point pulses-before \
         channel sync-channel marker-channels zero until pile-up",
        "make a capture of each pass by `thirdbounce histogram`, in the folder that `thirdbounce live` reads",
    ),
];

const FBP: &str = "the solver conv was removed: use --solver fbp, which takes the same pairs and walls";

const VOLUME: &str = "the solver vector was removed: leave the option out, or set --iterations, --support and --sparsity of the \
                      solver surface";

const SNAPSHOTS: &str = "run the solve again, which takes seconds with the default solver; `thirdbounce reconstruct --solver paper \
                         --snapshots I,I,...` keeps the maps of these iterations";

/// The removed name that caused `error`, and its replacement; `None` for any other error. `arguments` are those of the command,
/// without its own name.
pub fn replaced(
    error: &clap::Error,
    arguments: impl IntoIterator<Item = String>,
) -> Option<(String, &'static str)> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let verb = text(ContextKind::InvalidSubcommand)?;
            let (_, instead) = VERBS.iter().find(|(name, _)| *name == verb)?;
            Some((format!("the verb `{verb}` was removed"), instead))
        }
        ErrorKind::UnknownArgument => {
            let option = text(ContextKind::InvalidArg)?.split('=').next()?.strip_prefix("--")?;
            let command = super::command();
            let verb = arguments.into_iter().find(|word| command.find_subcommand(word).is_some());
            let verb = verb.unwrap_or_default();
            let (_, _, instead) = OPTIONS.iter().find(|(of, names, _)| {
                names.split(' ').any(|name| name == option) && (of.is_empty() || *of == verb)
            })?;
            Some((format!("the option --{option} of `{verb}` was removed"), instead))
        }
        ErrorKind::ArgumentConflict => {
            let is_device = text(ContextKind::InvalidArg)?.starts_with("--device ");
            let is_batch = arguments.into_iter().any(|word| word == "batch");
            let what = "several devices of one batch were removed".to_string();
            (is_device && is_batch).then_some((what, "run a batch for each device, with --shard 1/2 and 2/2"))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_removed_name_is_refused_with_its_replacement() {
        let refused = |words: &[&str]| {
            let error = super::super::command()
                .try_get_matches_from(["thirdbounce"].iter().chain(words))
                .expect_err("the name is gone");
            replaced(&error, words.iter().map(ToString::to_string))
        };
        for (verb, instead) in VERBS {
            assert_eq!(refused(&[verb, "x"]).expect(verb).1, *instead);
        }
        for (of, options, instead) in OPTIONS {
            let command = super::super::command();
            let verbs = command.get_subcommands().map(clap::Command::get_name);
            for verb in verbs.filter(|name| of.is_empty() || name == of) {
                for option in options.split(' ') {
                    for written in [format!("--{option}"), format!("--{option}=1")] {
                        assert_eq!(refused(&[verb, &written]).expect(option).1, *instead);
                    }
                }
            }
        }
        assert_eq!(refused(&["views"]), None);
        assert_eq!(refused(&["info", "--nonsense"]), None);
    }

    #[test]
    fn replacements_exist() {
        let command = super::super::command();
        let verbs: Vec<_> = command.get_subcommands().collect();
        let options: Vec<_> = verbs.iter().flat_map(|verb| verb.get_arguments()).collect();
        let all = VERBS.iter().map(|row| row.1).chain(OPTIONS.iter().map(|row| row.2));
        for text in all {
            for word in text.split([' ', '`', ',', ';', '=']) {
                let Some(option) = word.strip_prefix("--") else { continue };
                assert!(options.iter().any(|arg| arg.get_long() == Some(option)), "{text}: {word}");
            }
            for rest in text.split("`thirdbounce ").skip(1) {
                let verb = rest.split([' ', '`']).next().unwrap_or_default();
                assert!(command.find_subcommand(verb).is_some(), "{text}: {verb}");
            }
        }
    }
}
