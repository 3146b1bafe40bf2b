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
        if self.scan.is_some() {
            return Err(refused("tags", "time tags"));
        }
        refuse(path)?;
        settings::load(path, settings, device)
    }

    /// Always `None`: [`NoTags::load`] refuses files of time tags.
    pub fn shown(&self, _: &Path, _: bool) -> Result<Option<String>> {
        Ok(None)
    }
}

/// Refuses files that are time tags by their name.
///
/// # Errors
/// The name ends as those of PicoQuant.
pub fn refuse(path: &Path) -> Result<()> {
    let ending = path.extension().map_or_else(String::new, |ending| ending.to_string_lossy().to_lowercase());
    match ending.as_str() {
        "ptu" | "phu" => Err(refused("tags", "time tags").at(path.display())),
        _ => Ok(()),
    }
}
