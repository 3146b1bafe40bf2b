//! `preview.png`: what there is to see while a solve runs. It shows the light-cone transform first, or the back-projection where
//! the capture breaks an assumption of the transform; then maps on the way. It goes when the result is there.

use std::borrow::Cow;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::places::PREVIEW;
use crate::closed_form::FbpOptions;
use crate::engine::{Doing, Progress, Solver, TracePoint};
use crate::export::png;
use crate::files::atomic::create_dir;
use crate::gpu::Gpu;
use crate::judge::Job;
use crate::maps::Maps;
use crate::{Error, Kind, Result};

/// Pixels of the transform's maps on a side, at most.
const TRANSFORMED: usize = 128;

/// Pixels of the back-projection's maps on a side, at most. Its voxels are cubes, so time goes with the third power.
const PROJECTED: usize = 48;

/// Pairs of the back-projection, at most: as many as such voxels need.
const PAIRS: usize = 1300;

/// The picture of a run.
#[derive(Debug)]
pub struct Preview {
    file: PathBuf,
    /// Its folder, if it was made for the picture.
    folder: Option<PathBuf>,
    /// Seconds that the first picture took.
    pub seconds: f64,
}

impl Preview {
    /// Shows the first picture, and tells `hear`. What goes wrong is left for the solve itself to tell, which then
    /// runs without a picture.
    ///
    /// # Errors
    /// `hear` cancels.
    pub fn begin(
        folder: &Path,
        job: &Job<'_>,
        gpu: &Gpu,
        hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Option<Preview>> {
        let start = Instant::now();
        let folder_made = (!folder.exists()).then(|| folder.to_owned());
        let mut preview = Preview { file: folder.join(PREVIEW), folder: folder_made, seconds: 0.0 };
        let Ok(maps) = first_maps(job, gpu) else { return Ok(None) };
        if create_dir(folder).and_then(|()| preview.show(&maps)).is_err() {
            return Ok(None);
        }
        preview.seconds = start.elapsed().as_secs_f64();
        let point = TracePoint {
            iteration: 0,
            seconds: preview.seconds,
            gpu_seconds: 0.0,
            lateral: maps.nx,
            pairs: 0,
            active: 0,
            active_ratio: 0.0,
            loss: f64::NAN,
            data_loss: f64::NAN,
        };
        let iterations = job.solver.all_iterations();
        let progress =
            Progress { doing: Doing::Preview, point, iterations, remaining: None, maps: Some(maps) };
        match hear(&progress) {
            ControlFlow::Continue(()) => Ok(Some(preview)),
            ControlFlow::Break(()) => {
                Err(Error::new(Kind::Cancelled, "cancelled by the caller before the solve", "run it again"))
            }
        }
    }

    /// Shows maps instead of what was shown before.
    pub fn show(&self, maps: &Maps) -> Result<()> {
        png::write_preview(&self.file, maps)
    }
}

impl Drop for Preview {
    fn drop(&mut self) {
        // A picture or a folder that stays does no harm.
        let _ = fs::remove_file(&self.file);
        let _ = self.folder.as_ref().map(fs::remove_dir);
    }
}

/// What `reconstruct` shows first.
///
/// # Errors
/// The device fails, or no grid fits.
pub fn first_maps(job: &Job<'_>, gpu: &Gpu) -> Result<Maps> {
    let (capture, common) = (&*job.capture, job.solver.common());
    // The light-cone transform is sharper than a back-projection, and sooner there.
    let transform = job.light_cone(TRANSFORMED);
    if transform.takes(capture).is_ok()
        && let Ok(maps) = job.closed_form(transform.into(), gpu)
    {
        return Ok(maps);
    }
    let projection = FbpOptions::defaults_for(&job.traits()).with(|o| {
        o.lateral = common.lateral.min(PROJECTED);
        o.image.min_depth = common.min_depth;
    });
    let few = (capture.pair_count() > PAIRS).then(|| capture.subset(PAIRS, 0)).transpose()?;
    job.with_capture(few.map_or(Cow::Borrowed(capture), Cow::Owned)).closed_form(projection.into(), gpu)
}
