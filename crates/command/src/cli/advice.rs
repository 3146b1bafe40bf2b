//! Advice in the words of the command line: flags for settings, verbs for places to look.

use thirdbounce::advice::{Advice, Look, Remedy, Setting};

/// The advice with flags and verbs in it.
pub fn text(advice: &Advice) -> String {
    let changed = |remedy| match remedy {
        Remedy::Set(setting) => flag(setting),
        Remedy::SmallerJob { .. } => {
            "a smaller --lateral, a larger --depth-pitch, a narrower --gate or a larger --stride".into()
        }
    };
    let found = |look| match look {
        Look::Devices => "`thirdbounce devices`".into(),
        Look::Capture => "`thirdbounce info`".into(),
        Look::Options => "`thirdbounce help reconstruct`".into(),
    };
    let said = advice.say(changed, found);
    match cfg!(feature = "tags")
        || !["`histogram`", "thirdbounce histogram"].iter().any(|verb| said.contains(verb))
    {
        true => said,
        false => format!("{said}\nthis build has no `histogram`: install a package, or run `make build`"),
    }
}

fn flag(setting: Setting) -> String {
    format!("--{}", setting.name().replace('_', "-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Settings of `histogram` alone.
    const OF_TAGS: &[Setting] = &[
        Setting::LineShift,
        Setting::LineTime,
        Setting::Records,
        Setting::SyncAfter,
        Setting::SyncDivider,
        Setting::TagUnit,
        Setting::Zero,
    ];

    #[test]
    fn every_setting_has_its_flag() {
        let command = super::super::command();
        let verbs: Vec<_> = command.get_subcommands().collect();
        let has = |long: &str| {
            let all = verbs.iter().copied().chain([&command]);
            all.flat_map(|verb| verb.get_arguments()).any(|arg| arg.get_long() == Some(long))
        };
        assert!(has("lateral") && !has("lateral-voxels"));
        let missing: Vec<_> =
            Setting::ALL.iter().filter(|s| !has(flag(**s).trim_start_matches("--"))).collect();
        // The verb of a feature that is off has no options.
        let off: &[Setting] = if cfg!(feature = "tags") { &[] } else { OF_TAGS };
        assert!(missing.iter().all(|setting| off.contains(setting)), "{missing:?}");
        let smaller = text(&[thirdbounce::advice::AdvicePart::Change(Remedy::SMALLER_JOB)].into());
        let flags: Vec<_> =
            smaller.split_whitespace().filter_map(|w| w.trim_end_matches(',').strip_prefix("--")).collect();
        assert!(flags.len() == 4 && flags.iter().all(|f| has(f)), "{flags:?}");
    }
}
