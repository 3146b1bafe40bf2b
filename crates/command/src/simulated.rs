//! Simulates a capture of a known scene, and its truth.

use std::path::PathBuf;
use std::time::Instant;

use thirdbounce::capture::Summary;
use thirdbounce::job::places;
use thirdbounce::{Error, Result, capture, export};
use thirdbounce_simulate::{self as simulator, EmptyRoom, Exposure, RenderOptions, RenderProgress, Scene};

/// What to simulate, and the files to write.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// The scene.
    pub scene: Scene,
    /// Leave the pulse out of the capture.
    pub hide_pulse: bool,
    /// How it is rendered.
    pub render: RenderOptions,
    /// The capture, .npz or .hdf5.
    pub out: PathBuf,
    /// The truth's file, and its pixels per side.
    pub truth: Option<(PathBuf, usize)>,
    /// The file of the empty room, and how it is measured.
    pub empty: Option<(PathBuf, EmptyRoom)>,
    /// Whether the truth is the things alone: the light of the room is to be subtracted.
    pub is_truth_of_things: bool,
    /// The exposure, with photons; `None`: that by which the strongest bin expects them.
    pub exposure: Option<Exposure>,
}

/// The result of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// What the capture holds.
    pub summary: Summary,
    /// Noise of the rendering: RMS error over RMS value.
    pub noise: f64,
    /// Whether the wanted noise was reached.
    pub converged: bool,
    /// Samples of every pair.
    pub samples: usize,
    /// The exposure, with photons.
    pub exposure: Option<Exposure>,
    /// Seconds that it took.
    pub seconds: f64,
    /// Every file that was written.
    pub files: Vec<PathBuf>,
    /// What the capture's format could not hold, as sentences.
    pub notes: Vec<String>,
}

/// Renders the scene. Writes its capture, and its truth if a file for it is given. `hear` is called with the progress, by several
/// threads, `before_writing` once everything is computed.
///
/// # Errors
/// A scene or options out of range, or a file that cannot be written.
pub fn simulate(
    what: &Simulation,
    hear: &(dyn Fn(RenderProgress) + Sync),
    before_writing: &mut dyn FnMut(),
) -> Result<Simulated> {
    let empty_out = what.empty.as_ref().map(|(file, _)| file);
    for out in std::iter::once(&what.out).chain(empty_out) {
        places::check_file(out)?;
        let ending = out.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
        if !matches!(ending.as_str(), "npz" | "hdf5" | "h5") {
            return Err(Error::options(
                format!("{}: no capture format has this ending", out.display()),
                "let the file's name end in .npz, or in .hdf5 for y-tal",
            ));
        }
    }
    if empty_out == Some(&what.out) {
        return Err(Error::options(
            "the capture and that of the empty room go to the same file",
            "give two files",
        ));
    }
    if let Some((file, _)) = &what.truth {
        places::check_file(file)?;
        if file == &what.out {
            return Err(Error::options("capture and truth go to the same file", "give two files"));
        }
    }
    let start = Instant::now();
    let shown = if what.is_truth_of_things { &what.scene.without_room() } else { &what.scene };
    let truth = what.truth.as_ref().map(|(_, n)| simulator::truth(shown, *n)).transpose()?;
    let (mut rendering, mut room) = match &what.empty {
        Some((_, how)) => {
            let (rendering, room) = simulator::simulate_empty(&what.scene, how, &what.render, hear)?;
            (rendering, Some(room))
        }
        None => (simulator::simulate_exposed(&what.scene, what.exposure, &what.render, hear)?, None),
    };
    if what.hide_pulse {
        rendering.capture.pulse = None;
        room.iter_mut().for_each(|room| room.pulse = None);
    }
    rendering.capture.check()?;
    let seconds = start.elapsed().as_secs_f64();
    before_writing();
    let mut files = vec![what.out.clone()];
    let notes = capture::write(&rendering.capture, &what.out)?;
    if let Some((file, room)) = empty_out.zip(room) {
        capture::write(&room, file)?;
        files.push(file.clone());
    }
    if let (Some((file, _)), Some(truth)) = (&what.truth, &truth) {
        export::npz::write_truth(file, truth)?;
        files.push(file.clone());
    }
    Ok(Simulated {
        summary: rendering.capture.summary(),
        noise: rendering.noise,
        converged: rendering.converged,
        samples: rendering.samples,
        exposure: rendering.exposure,
        seconds,
        files,
        notes,
    })
}
