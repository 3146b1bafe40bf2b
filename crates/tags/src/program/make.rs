//! Makes a capture of time tags.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::files::staging::Staging;
use thirdbounce::job::places;
use thirdbounce::{capture, export};

use crate::error::{Error, Result};
use crate::{Asked, Histograms, Readings, Scan};

/// What to make of which file.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogramming {
    /// Time tags, or histograms of the instrument.
    pub tags: PathBuf,
    /// The points of the scan.
    pub scan: Scan,
    /// How tags become histograms.
    pub asked: Asked,
    /// The capture to write: .npz, .hdf5 or .mat; the folder of those of each reading.
    pub out: PathBuf,
    /// A picture of the mean histogram, and of the direct peaks and counts over the scan, and of the wall's depth if it is that of its
    /// own returns.
    pub picture: Option<PathBuf>,
}

/// Writes the capture, and the picture if it is asked for. Returns both with the seconds that it took to make them;
/// `before_writing` is called once everything is computed.
///
/// # Errors
/// Those of [`crate::histogram()`], and a file that cannot be written.
pub fn make(what: &Histogramming, before_writing: &mut dyn FnMut()) -> Result<(Histograms, f64)> {
    let each = what.asked.readings == Readings::Each;
    if each {
        places::check_results(&what.out)?;
    } else {
        places::check_file(&what.out)?;
        capture::formats::check_ending(&what.out)?;
    }
    what.picture.as_deref().map(places::check_file).transpose()?;
    if what.picture.as_ref() == Some(&what.out) {
        return Err(Error::options("capture and picture go to the same file", "give two files"));
    }
    for file in [Some(&what.out), what.picture.as_ref()].into_iter().flatten() {
        places::check_not_input(file, [what.tags.as_path()])?;
    }
    let start = Instant::now();
    let mut made = crate::histogram(&what.tags, &what.scan, &what.asked)?;
    let seconds = start.elapsed().as_secs_f64();
    before_writing();
    if each {
        write_each(&made, &what.out)?;
    } else {
        made.notes.extend(capture::write(&made.capture, &what.out)?);
    }
    if let Some(picture) = &what.picture {
        export::inspection::write_with_direct(picture, &made.capture, made.direct.as_deref(), made.shaped)?;
    }
    Ok((made, seconds))
}

/// Writes the captures of all readings into a folder; none if one cannot be written.
fn write_each(made: &Histograms, out: &Path) -> Result<()> {
    let staging = Staging::new(out)?;
    let mut files = vec![];
    for (number, reading) in made.readings.iter().enumerate() {
        let file = staging.path().join(format!("reading-{number:04}.npz"));
        capture::write(reading, &file)?;
        files.push(file);
    }
    staging.commit(&files).map(drop)
}
