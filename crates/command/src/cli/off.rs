//! Verbs of features that this build does not have.

use std::ffi::OsString;

use thirdbounce::Error;

#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub struct OffArgs {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _words: Vec<OsString>,
}

/// What a verb says of the feature that it needs.
pub fn refused(feature: &str, what: &str) -> Error {
    Error::options(
        format!("this build has no {what}: its feature {feature} is off"),
        format!(
            "install a package, or build with `cargo build --release --features thirdbounce-command/{feature}`"
        ),
    )
}
