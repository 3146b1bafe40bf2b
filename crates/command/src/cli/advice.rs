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
    advice.say(changed, found)
}

/// The flag of a setting.
pub fn flag(setting: Setting) -> String {
    format!("--{}", setting.name().replace('_', "-"))
}
