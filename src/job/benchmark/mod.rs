//! Captures × methods × photon counts: a comparison for each capture and photon count, and one page of all. What is done already is
//! skipped.

mod agreement;
mod captures;
pub mod family;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::compare::WHOLE;
use super::record::{Record, check_place};
use super::{Comparison, Loaded, Simulation, Turn, compare, places};
use crate::export::benchmark::{self as pages, Case, Page};
use crate::export::comparison;
use crate::files::staging;
use crate::solve::Progress;
use crate::{Error, Kind, Result};
pub use agreement::{CLOSED_FORMS, Consensus};
pub use captures::{found_in, truth_of};

/// What to run.
#[derive(Debug, Clone, PartialEq)]
pub struct Benchmark {
    /// The scenes, with unlike names.
    pub scenes: Vec<Scene>,
    /// Photons that the strongest bin expects, one capture for each besides the scene's own. They are drawn from captures
    /// whose values are not counts.
    pub photons: Vec<f64>,
    /// Seed of the photons.
    pub seed: u64,
    /// Folder for the page, the captures that are made, and a comparison's folder for each case.
    pub out: PathBuf,
    /// Every option that changes results, as it was given: a case that was made with others is made anew.
    pub options: Vec<String>,
    /// Other files on which results depend, such as maps of other programs.
    pub beside: Vec<PathBuf>,
}

/// A scene of a benchmark.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Its name: that of its file without the ending.
    pub name: String,
    /// Where its capture is from.
    pub source: Source,
}

impl Scene {
    /// Whether there is no truth: closed-form methods stand in for it.
    fn is_agreed(&self) -> bool {
        matches!(self.source, Source::Capture { truth: None, .. })
    }
}

/// Where a capture is from.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// A capture that is there.
    Capture {
        /// The capture's file.
        file: PathBuf,
        /// The truth's file. Without one, methods are judged by what closed-form methods agree on.
        truth: Option<PathBuf>,
    },
    /// A scene of the random family.
    Family {
        /// The file that names it.
        file: PathBuf,
        /// Its seed.
        seed: u64,
    },
    /// A scene to simulate.
    Simulation {
        /// The file that describes it.
        file: PathBuf,
        /// What it describes. The files to write are set by the benchmark.
        what: Box<Simulation>,
    },
}

/// What a benchmark asks of its caller.
pub trait Caller {
    /// Reads a capture, and says what is compared on it, with this truth. Its folder is set afterwards.
    ///
    /// # Errors
    /// The capture cannot be used: the case fails, the benchmark continues.
    fn comparison(&mut self, capture: &Path, truth: &Path) -> Result<(Loaded, Comparison)>;

    /// Hears that a case begins (`None`) and of its progress. May stop the benchmark.
    fn hear(&mut self, case: &str, progress: Option<(&Turn<'_>, &Progress)>) -> ControlFlow<()>;

    /// Hears how a case ended.
    fn tell(&mut self, case: &Case);
}

/// How a benchmark ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Benched {
    /// All cases that were reached.
    pub page: Page,
    /// Whether the caller stopped it.
    pub stopped: bool,
    /// The files of the page.
    pub files: Vec<PathBuf>,
}

/// One capture of a scene.
struct Wanted<'b> {
    scene: &'b Scene,
    photons: Option<f64>,
}

impl Wanted<'_> {
    fn name(&self) -> String {
        self.photons.map_or(self.scene.name.clone(), |p| format!("{}-photons-{p}", self.scene.name))
    }
}

/// Compares the methods on every case, and writes `benchmark.json` and `benchmark.html` after each.
///
/// # Errors
/// Before anything is computed: no scene, two of one name, photons out of range, or a folder that cannot be written.
/// What goes wrong with a case is reported, and the benchmark continues, unless there is no other case. Later: a page that cannot
/// be written.
pub fn benchmark(what: &Benchmark, caller: &mut dyn Caller) -> Result<Benched> {
    what.check()?;
    let start = Instant::now();
    let photons: Vec<Option<f64>> =
        std::iter::once(None).chain(what.photons.iter().copied().map(Some)).collect();
    let all = what.scenes.iter().flat_map(|scene| photons.iter().map(move |p| Wanted { scene, photons: *p }));
    // Photons drawn from what is measured would be judged by what was measured.
    let all: Vec<_> = all.filter(|wanted| wanted.photons.is_none() || !wanted.scene.is_agreed()).collect();
    let is_alone = all.len() == 1;
    let mut page = Page { version: env!("CARGO_PKG_VERSION").into(), seconds: 0.0, cases: vec![] };
    let mut files = vec![];
    for wanted in all {
        let name = wanted.name();
        if caller.hear(&name, None).is_break() {
            return Ok(Benched { page, stopped: true, files });
        }
        let case = match what.case(&wanted, caller) {
            Err(e) if e.kind == Kind::Cancelled => return Ok(Benched { page, stopped: true, files }),
            Err(e) if is_alone => return Err(e),
            Err(e) => Case::left_out(&wanted.scene.name, wanted.photons, &name, true, &e),
            Ok(case) => case,
        };
        caller.tell(&case);
        page.cases.push(case);
        page.seconds = start.elapsed().as_secs_f64();
        files = pages::write(&what.out, &page)?;
    }
    Ok(Benched { page, stopped: false, files })
}

impl Benchmark {
    fn check(&self) -> Result<()> {
        if self.scenes.is_empty() {
            return Err(Error::input(
                "the benchmark has no scenes",
                "give a capture, or a folder with captures beside their truths (NAME.npz and NAME_truth.npz) or scenes to \
                 simulate (NAME.scene with the arguments of simulate)",
            ));
        }
        let mut names: Vec<&str> = self.scenes.iter().map(|s| s.name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::input(
                format!("two scenes of the benchmark have the name {:?}", twice[0]),
                "rename one of the files",
            ));
        }
        if let Some(wrong) = self.photons.iter().find(|p| !(p.is_finite() && **p > 0.0)) {
            return Err(Error::options(
                format!("the photons of the strongest bin are {wrong}"),
                "give numbers above 0, for example 1000,100,10",
            ));
        }
        places::check_folder(&self.out)
    }

    /// Makes a case, or takes it from its folder.
    fn case(&self, wanted: &Wanted<'_>, caller: &mut dyn Caller) -> Result<Case> {
        let name = wanted.name();
        let folder = self.out.join(&name);
        let report = folder.join(WHOLE);
        let start = Instant::now();
        let (capture, truth) = match captures::ready(self, wanted.scene, wanted.photons)? {
            captures::Ready::Files { capture, truth } => (capture, truth),
            captures::Ready::None(why) => {
                let why = Error::input(why, "");
                return Ok(Case::left_out(&wanted.scene.name, wanted.photons, &name, false, &why));
            }
        };
        let options = [&self.options[..], &[format!("truth {}", truth.display())]].concat();
        let files = [&capture, &truth].into_iter().chain(&self.beside).map(PathBuf::as_path);
        let record = Record::of(files, &options);
        let was_there = record.is_done(&folder, WHOLE);
        if !was_there {
            check_place(&folder)?;
            let (loaded, mut comparison) = caller.comparison(&capture, &truth)?;
            comparison.out = folder.clone();
            let (methods, _) = comparison.check(&loaded.capture)?;
            // A missing device is an error before anything is written.
            drop(methods[0].request.open()?);
            // It comes last, so a folder without it is made anew.
            staging::remove(&report)?;
            record.write(&folder)?;
            compare(&comparison, &loaded, &mut |turn, progress| caller.hear(&name, Some((turn, progress))))?;
        }
        Ok(Case {
            scene: wanted.scene.name.clone(),
            photons: wanted.photons,
            folder: name,
            was_there,
            failed: false,
            agreed: wanted.scene.is_agreed(),
            why: None,
            hint: None,
            seconds: start.elapsed().as_secs_f64(),
            comparison: Some(comparison::read_json(&report)?),
        })
    }
}
