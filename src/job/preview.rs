//! `preview.png`: a picture of the solve while it runs: the start of the surface, then maps on the way. It is deleted when the result is
//! written.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::places::PREVIEW;
use crate::Result;
use crate::export::png;
use crate::files::atomic::create_dir;
use crate::maps::Maps;

/// The picture of a run.
#[derive(Debug)]
pub struct Preview {
    file: PathBuf,
    /// Its folder, if it was made for the picture.
    folder: Option<PathBuf>,
    begun: Instant,
    /// Seconds until the first picture, if there was one.
    seconds: Cell<Option<f64>>,
}

impl Preview {
    /// A picture for the results in a folder; there is nothing to see yet.
    pub fn new(folder: &Path) -> Preview {
        let made = (!folder.exists()).then(|| folder.to_owned());
        Preview { file: folder.join(PREVIEW), folder: made, begun: Instant::now(), seconds: Cell::new(None) }
    }

    /// Shows maps instead of what was shown before. What goes wrong is left for the solve itself to tell, which then runs without a
    /// picture.
    ///
    /// # Errors
    /// The picture cannot be written.
    pub fn show(&self, maps: &Maps) -> Result<()> {
        if let Some(folder) = self.file.parent() {
            create_dir(folder)?;
        }
        png::write_preview(&self.file, maps)?;
        self.seconds.set(self.seconds.get().or(Some(self.begun.elapsed().as_secs_f64())));
        Ok(())
    }

    /// Seconds until the first picture, if there was one.
    pub fn seconds(&self) -> Option<f64> {
        self.seconds.get()
    }
}

impl Drop for Preview {
    fn drop(&mut self) {
        // A picture or a folder that stays does no harm.
        let _ = fs::remove_file(&self.file);
        let _ = self.folder.take().map(fs::remove_dir);
    }
}
