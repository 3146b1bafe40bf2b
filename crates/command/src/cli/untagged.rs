//! Without the feature `tags`: every file is a capture.

use std::path::Path;

use thirdbounce::Result;
use thirdbounce::job::{Loaded, Request};

use super::off::refused;
use super::settings::{self, ALL, DeviceArgs, SettingsArgs};

/// The option that makes captures of time tags, which is refused.
#[derive(clap::Args)]
pub struct NoTags {
    #[arg(long, hide = true)]
    scan: Option<String>,
}

/// In place of that of the feature.
pub type FromTags = NoTags;

impl NoTags {
    /// Reads a capture.
    ///
    /// # Errors
    /// A scan of time tags is given; those of [`settings::load`].
    pub fn load(
        &self,
        path: &Path,
        settings: &SettingsArgs<ALL>,
        device: &DeviceArgs,
    ) -> Result<(Loaded, Request)> {
        match self.scan {
            Some(_) => Err(refused("tags", "time tags")),
            None => settings::load(path, settings, device),
        }
    }

    pub fn shown(&self, _: &Path, _: bool) -> Result<Option<String>> {
        Ok(None)
    }
}

pub fn refuse(_: &Path) -> Result<()> {
    Ok(())
}
