//! The captures of a benchmark: what a folder holds, and what is made of it.

use std::fs;
use std::path::{Path, PathBuf};

use super::super::record::Record;
use super::super::{Simulation, load, simulated};
use super::agreement::agreed;
use super::{Benchmark, Scene, Source, family};
use crate::capture;
use crate::export::npz::write_truth;
use crate::files::staging::Staging;
use crate::settings::Settings;
use crate::simulate::{DEFAULT_RESOLUTION, Dark, photon_noise};
use crate::{Error, Result};

/// The folder of captures that are made.
const MADE: &str = "captures";

/// Endings of captures.
const CAPTURES: [&str; 4] = ["npz", "hdf5", "h5", "mat"];

/// The capture of a case.
pub enum Ready {
    /// Its file, and that of its truth.
    Files { capture: PathBuf, truth: PathBuf },
    /// There is none, and why.
    None(String),
}

/// Captures and files that describe scenes, in a folder: each sorted by name. The truth of `NAME.npz` is `NAME_truth.npz`, `truth_NAME.npz` or `truth/NAME.npz`. A scene is `NAME.scene`.
///
/// # Errors
/// A folder that cannot be read.
pub fn found_in(folder: &Path) -> Result<BenchmarkFolder> {
    let cannot = |e: std::io::Error| {
        Error::input(
            format!("{}: cannot be read: {e}", folder.display()),
            "give a folder with captures or scenes",
        )
    };
    let mut all: Vec<PathBuf> = vec![];
    for entry in fs::read_dir(folder).map_err(cannot)? {
        all.push(entry.map_err(cannot)?.path());
    }
    all.sort();
    let mut found = BenchmarkFolder::default();
    for path in all.into_iter().filter(|p| p.is_file()) {
        let ending = path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
        let name = stem(&path);
        let is_truth = name.starts_with("truth_") || name.ends_with("_truth");
        if ending == "scene" {
            found.scenes.push((name, path));
        } else if CAPTURES.contains(&ending.as_str()) && !is_truth {
            let truth = truth_of(&path);
            found.captures.push((name, path, truth));
        }
    }
    Ok(found)
}

/// What a folder holds for a benchmark.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BenchmarkFolder {
    /// Name, capture, and truth if there is one.
    pub captures: Vec<(String, PathBuf, Option<PathBuf>)>,
    /// Name and file of a scene to simulate.
    pub scenes: Vec<(String, PathBuf)>,
}

/// The truth of `NAME.npz` beside it: `NAME_truth.npz`, `truth_NAME.npz` or `truth/NAME.npz`.
pub fn truth_of(capture: &Path) -> Option<PathBuf> {
    let name = stem(capture);
    let truths = [format!("{name}_truth.npz"), format!("truth_{name}.npz"), format!("truth/{name}.npz")];
    truths.iter().map(|truth| capture.with_file_name(truth)).find(|truth| truth.is_file())
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// The capture of a case: as it is, simulated, or with photons drawn. What is there already stays.
///
/// # Errors
/// A scene that cannot be simulated, a capture that cannot be read, or files that cannot be written.
pub fn ready(what: &Benchmark, scene: &Scene, photons: Option<f64>) -> Result<Ready> {
    let folder = what.out.join(MADE);
    let (exact, truth) = match &scene.source {
        Source::Capture { file, truth: Some(truth) } => (file.clone(), truth.clone()),
        Source::Capture { file, truth: None } => {
            (file.clone(), in_place_of_truth(&folder, &scene.name, file)?)
        }
        Source::Simulation { file, what } => rendered(&folder, &scene.name, file, |capture, truth| {
            let truth = Some((truth.into(), DEFAULT_RESOLUTION));
            simulated::simulate(&Simulation { out: capture.into(), truth, ..(**what).clone() }, &mut || {})
                .map(|_| ())
        })?,
        Source::Family { file, seed } => rendered(&folder, &scene.name, file, |capture, truth| {
            let case = family::Case::of(*seed);
            write_truth(truth, &case.truth()?)?;
            capture::write(&case.capture()?, capture).map(|_| ())
        })?,
    };
    let Some(photons) = photons else { return Ok(Ready::Files { capture: exact, truth }) };
    let name = format!("{}-photons-{photons}", scene.name);
    let capture = folder.join(format!("{name}.npz"));
    let record = Record::of([&*exact], &[format!("photons {photons} seed {}", what.seed)]);
    if record.is_done(&folder.join(&name), &format!("../{name}.npz")) {
        return Ok(Ready::Files { capture, truth });
    }
    let whole = Settings { auto_gate: Some(false), ..Settings::default() };
    let clean = load(&exact, &whole)?.capture;
    if clean.integer_counts {
        return Ok(Ready::None("its values are counts already, so no photons are drawn from them".into()));
    }
    let noisy = photon_noise(&clean, photons, Dark::Counts(0.0), None, what.seed)
        .map_err(|e| e.at(exact.display()))?;
    keep(&folder, &name, &record, &[&capture], |staged| capture::write(&noisy, &staged[0]).map(|_| ()))?;
    Ok(Ready::Files { capture, truth })
}

/// Simulates the scene of a file once: its capture and its truth, to the places that `make` is given.
fn rendered(
    folder: &Path,
    name: &str,
    file: &Path,
    make: impl FnOnce(&Path, &Path) -> Result<()>,
) -> Result<(PathBuf, PathBuf)> {
    let [capture, truth] = ["", "_truth"].map(|part| folder.join(format!("{name}{part}.npz")));
    let record = Record::of([file], &[]);
    if record.is_done(&folder.join(name), &format!("../{name}.npz")) && truth.is_file() {
        return Ok((capture, truth));
    }
    keep(folder, name, &record, &[&truth, &capture], |staged| make(&staged[1], &staged[0]))?;
    Ok((capture, truth))
}

/// What closed-form methods agree on, once.
fn in_place_of_truth(folder: &Path, name: &str, file: &Path) -> Result<PathBuf> {
    let name = format!("{name}_agreed");
    let truth = folder.join(format!("{name}.npz"));
    let record = Record::of([file], &[]);
    if !record.is_done(&folder.join(&name), &format!("../{name}.npz")) {
        let truth_of = |staged: &[PathBuf]| write_truth(&staged[0], &agreed(file)?);
        keep(folder, &name, &record, &[&truth], truth_of)?;
    }
    Ok(truth)
}

/// Makes files beside their places and moves them there, and last the record in the folder `name`.
fn keep(
    folder: &Path,
    name: &str,
    record: &Record,
    files: &[&PathBuf],
    make: impl FnOnce(&[PathBuf]) -> Result<()>,
) -> Result<()> {
    let staging = Staging::new(folder)?;
    let staged: Vec<PathBuf> =
        files.iter().map(|file| staging.path().join(file.file_name().unwrap_or_default())).collect();
    make(&staged)?;
    staging.commit(&staged)?;
    record.write(&folder.join(name))
}
