//! Values in files of JSON.

use std::path::Path;

use serde::Serialize;
use thirdbounce::files::atomic;
use thirdbounce::{Error, Result};

/// Writes a value as JSON, whole or not at all.
///
/// # Errors
/// A file that cannot be written.
pub fn write_json(file: &Path, value: &impl Serialize, indented: bool) -> Result<()> {
    let packed = if indented { serde_json::to_string_pretty(value) } else { serde_json::to_string(value) };
    let mut text = packed.map_err(|e| {
        Error::output(format!("{}: cannot be packed as JSON: {e}", file.display()), "report this as a bug")
    })?;
    text.push('\n');
    atomic::write(file, text.as_bytes())
}
