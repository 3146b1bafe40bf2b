//! The whole way from a capture to maps, as the command goes it.

use std::borrow::Cow;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use crate::capture::Capture;
use crate::estimation::{Choice, Estimates, Resolved};
use crate::gpu::Gpu;
use crate::maps::Maps;
use crate::session::{Session, SessionOptions};
use crate::solve::option::OptionValue;
use crate::solve::{
    Bins, Discretisation, Problem, Progress, Ready, Reconstruction, SolverOptions, TracePoint, VolumeMap,
    Watch, conclude,
};
use crate::transport::Volume;
use crate::{Error, Result};

type Hear = Arc<Mutex<dyn FnMut(&Progress) -> ControlFlow<()> + Send>>;

/// How to reconstruct. What nobody sets follows from the capture, as it does for the command: the published parameters for
/// its kind of counts, the box, the bins; and by quick solves of a part of it, how surfaces reflect and the length of the
/// instrument's pulse.
#[derive(Clone, Default)]
pub struct Options {
    choice: Choice,
    how: Discretisation,
    memory: Option<u64>,
    mask_fraction: Option<f64>,
    with_volume: bool,
    hear: Option<Hear>,
}

impl Options {
    /// A method by its name on the command line: `surface` (the default), `paper`, `lct` and so on.
    #[must_use]
    pub fn method(mut self, name: &str) -> Options {
        self.choice.solver = Some(name.into());
        self
    }

    /// How surfaces reflect: `cosine`, `lambertian`, `retroreflective` or `isotropic`. `auto`: estimated by short fits.
    #[must_use]
    pub fn model(mut self, name: &str) -> Options {
        self.choice.model = Some(name.into());
        self
    }

    /// An option of the method by its name, `lateral` or `iterations` for example: those of `thirdbounce reconstruct`, with
    /// underscores.
    #[must_use]
    pub fn set(mut self, name: &'static str, value: impl Into<OptionValue>) -> Options {
        self.choice.options.retain(|(known, _)| *known != name);
        self.choice.options.push((name, value.into()));
        self
    }

    /// The box to reconstruct, in place of the wall's extent and the depths that the bins allow.
    #[must_use]
    pub fn volume(mut self, volume: Volume) -> Options {
        self.how.volume = Some(volume);
        self
    }

    /// Most device memory to use, in bytes.
    #[must_use]
    pub fn memory(mut self, bytes: u64) -> Options {
        self.memory = Some(bytes);
        self
    }

    /// A pixel is surface above this share of the brightest albedo. Without it, the method defines the mask.
    #[must_use]
    pub fn mask_fraction(mut self, share: f64) -> Options {
        self.mask_fraction = Some(share);
        self
    }

    /// Reads the volume back, too.
    #[must_use]
    pub fn with_volume(mut self) -> Options {
        self.with_volume = true;
        self
    }

    /// Calls `hear` with the progress of trials and solve, from the thread that reconstructs. `Break` cancels.
    #[must_use]
    pub fn watch(mut self, hear: impl FnMut(&Progress) -> ControlFlow<()> + Send + 'static) -> Options {
        self.hear = Some(Arc::new(Mutex::new(hear)));
        self
    }

    /// A session for frames of the scan of `frame`: the device is planned, compiled and allocated for once. If `frame` has
    /// counts, quick solves of them find what [`reconstruct`] finds.
    ///
    /// # Errors
    /// Options, scan, memory or device do not allow the solve.
    pub fn session(&self, gpu: &Gpu, frame: &Capture, options: SessionOptions) -> Result<Session> {
        frame.check_scan()?;
        if !frame.histograms.is_empty() {
            frame.check_counts(&frame.histograms)?;
        }
        Maps::check_mask_fraction(options.mask_fraction)?;
        let memory = options.memory.or(self.memory);
        let how = Discretisation { bins: options.sum.map_or(self.how.bins, Bins::Sum), ..self.how };
        let (_, solver, scan) = self.settled(gpu, frame, how, memory)?;
        let Ready { grid, sum, .. } = how.ready(&solver, Cow::Borrowed(&scan))?;
        let options = SessionOptions {
            sum: Some(sum),
            memory,
            mask_fraction: options.mask_fraction.or(self.mask_fraction),
            with_volume: options.with_volume || self.with_volume,
            ..options
        };
        Session::new(gpu, &scan, Some(grid), &solver, options)
    }

    fn tell(&self, progress: &Progress) -> ControlFlow<()> {
        let Some(hear) = &self.hear else { return ControlFlow::Continue(()) };
        hear.lock().unwrap_or_else(PoisonError::into_inner)(progress)
    }

    /// What quick solves find, the solver that follows, and the capture with the pulse.
    fn settled<'c>(
        &self,
        gpu: &Gpu,
        capture: &'c Capture,
        how: Discretisation,
        memory: Option<u64>,
    ) -> Result<(Estimates, SolverOptions, Cow<'c, Capture>)> {
        let resolved = self.resolved(capture)?;
        // What does not fit is told before any trial.
        how.grid(&resolved.solver, capture)?;
        resolved.settled(gpu, capture, (how, memory), &mut |progress| self.tell(progress))
    }

    fn resolved(&self, capture: &Capture) -> Result<Resolved> {
        self.choice.check()?;
        Maps::check_mask_fraction(self.mask_fraction)?;
        if let Some(name) = self.choice.foreign() {
            return Err(Error::options(
                format!("{} has no option {name}", self.choice.solver_name()),
                "take it from `thirdbounce help reconstruct`, with underscores",
            ));
        }
        let resolved = self.choice.resolve(capture);
        // An option that does not take a value does not give it back.
        let refuses =
            |(name, value): &&(&str, OptionValue)| resolved.solver.get(name).is_some_and(|v| v != *value);
        if let Some((name, value)) = self.choice.options.iter().find(refuses) {
            return Err(Error::options(
                format!("the option {name} cannot be {value:?}"),
                "give a whole number, a number with a point, a bool or a word, as `thirdbounce help reconstruct` lists it",
            ));
        }
        Ok(resolved)
    }
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Options { choice, how, memory, mask_fraction, with_volume, hear } = self;
        let all = (choice, how, memory, mask_fraction, with_volume, hear.is_some());
        f.debug_tuple("Options").field(&all).finish()
    }
}

/// A reconstructed scene.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Solved {
    /// Albedo, depth, normals, mask and confidence by pixel.
    pub maps: Maps,
    /// The volume, if it was asked for.
    pub volume: Option<VolumeMap>,
    /// What quick solves found, as sentences.
    pub notes: Vec<String>,
    /// What looks wrong with the result, as sentences.
    pub warnings: Vec<String>,
    /// A point for each iteration of the solve.
    pub trace: Vec<TracePoint>,
    /// Seconds that trials and solve took.
    pub seconds: f64,
}

/// Reconstructs a capture as `thirdbounce reconstruct` does: finds what nobody chose, solves, and decides which pixels are
/// surface. A capture that [`read`](crate::read) reads is ready for it; [`prepare`](crate::prepare) makes one ready that a
/// program holds.
///
/// # Errors
/// `Kind::Options` and `Kind::Input`: options that make no sense or do not fit the capture. `Kind::Memory`: more than there
/// is. `Kind::Device`: the device fails. `Kind::Cancelled`: [`Options::watch`] said so.
pub fn reconstruct(gpu: &Gpu, capture: &Capture, options: &Options) -> Result<Solved> {
    capture.check()?;
    let (how, memory) = (options.how, options.memory);
    let (found, solver, capture) = options.settled(gpu, capture, how, memory)?;
    let Ready { capture, grid, .. } = how.ready(&solver, capture)?;
    let mut hear = |progress: &Progress| options.tell(progress);
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    let problem = Problem { capture: &capture, grid, memory, with_volume: options.with_volume };
    let mut result = solver.solve(gpu, &problem, &mut watch)?;
    conclude(&capture, options.mask_fraction.or(solver.usual_mask()), &mut result, &mut []);
    result.trace.iter_mut().for_each(|point| point.seconds += found.seconds);
    let (notes, seconds) = (found.notes(), found.seconds + result.solve_seconds);
    let Reconstruction { maps, volume, warnings, trace, .. } = result;
    Ok(Solved { maps, volume, notes, warnings, trace, seconds })
}

/// Reads a capture in any known format and makes it ready to reconstruct, as the command does: see [`prepare`].
///
/// # Errors
/// `Kind::Input`, beginning with the path: a file that is missing, damaged or of no known format. `Kind::Options` if the file
/// lacks a value, such as the size of the wall. `Kind::Memory` if the counts do not fit.
#[cfg(feature = "formats")]
pub fn read(path: impl AsRef<std::path::Path>) -> Result<Capture> {
    let path = path.as_ref().to_owned();
    Ok(crate::job::load(&crate::job::Input { path, ..Default::default() })?.capture)
}

/// Makes a capture ready that a program holds, as the command does with a file: pairs that were not measured are left out,
/// pile-up is taken out, normals of a curved wall are estimated, and direct light is gated away.
///
/// # Errors
/// Those of [`Capture::check`].
#[cfg(feature = "formats")]
pub fn prepare(capture: Capture) -> Result<Capture> {
    Ok(crate::job::take(capture, &crate::job::Input::default())?.capture)
}

/// Writes maps into a folder, which is made if it is missing: npz, EXR, pictures, points and a mesh. Returns the files.
///
/// # Errors
/// `Kind::Output` if a file cannot be written.
#[cfg(feature = "formats")]
pub fn write(folder: impl AsRef<std::path::Path>, maps: &Maps) -> Result<Vec<std::path::PathBuf>> {
    crate::export::write_maps(folder.as_ref(), maps)
}
