//! Scenes of the random family as files, to train on: captures, truths, and what the learned start sees.

use std::ops::{ControlFlow, Range};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thirdbounce::files::array::Array;
use thirdbounce::files::atomic;
use thirdbounce::learned::{BANDS, DEEP, SIDE};
use thirdbounce::{Error, Kind, Result, Settings, capture, export, job, learned};
use thirdbounce_simulate::EmptyRoom;

use crate::family::{FamilyCase, kind};
use crate::json::write_json;

/// How scenes are rendered and measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GenerationOptions {
    /// Coarsely, as [`FamilyCase::coarse`].
    pub coarse: bool,
    /// The scenes of [`FamilyCase::measured`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub measured: bool,
    /// Exactly and without room, as [`FamilyCase::ideal`].
    pub ideal: bool,
    /// Scan points per side; `None`: as the family has them.
    pub scan: Option<usize>,
    /// Also measure the room without the things, with this share, power and ripple of [`EmptyRoom`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub empty: Option<[f64; 3]>,
}

/// Scenes to make.
#[derive(Debug, Clone, PartialEq)]
pub struct Generation {
    /// How.
    pub options: GenerationOptions,
    /// Which.
    pub seeds: Range<u64>,
    /// Also write what the learned start sees.
    pub inputs: bool,
    /// The folder.
    pub out: PathBuf,
    /// The folder of empty rooms.
    pub empty_out: Option<PathBuf>,
}

/// What became of the seeds.
#[derive(Debug, Default)]
pub struct Generated {
    /// Scenes that were written.
    pub written: usize,
    /// Scenes that had been written before, in the same way.
    pub there: usize,
    /// Seeds without a scene, and why.
    pub failed: Vec<(u64, Error)>,
    /// Whether it was stopped. The same call continues.
    pub stopped: bool,
}

/// The description of a scene. Its file is written last.
#[derive(Debug, Serialize, Deserialize)]
struct Description {
    #[serde(flatten)]
    options: GenerationOptions,
    /// Kind of pairs for the network: 0 confocal, 1 one laser or sensor point, 2 other.
    kind: usize,
    pairs: String,
    reflectance: String,
    /// The part of the wall that the capture covers, xmin, xmax, ymin, ymax; its larger side is the width of the network's box.
    extent: [f64; 4],
    /// Side of the wall and depth of a wall behind the things, metres.
    wall: f64,
    back: Option<f64>,
    words: String,
}

/// Writes all scenes that are not there yet, in parallel. `hear` gets the number of those that are done, and of all, and says whether to
/// go on.
///
/// # Errors
/// A file that cannot be written. A seed whose scene cannot be measured is in the result.
pub fn generate(
    what: &Generation,
    hear: &(dyn Fn(usize, usize) -> ControlFlow<()> + Sync),
) -> Result<Generated> {
    let (done, of) = (AtomicUsize::new(0), (what.seeds.end - what.seeds.start) as usize);
    let stopped = AtomicBool::new(false);
    let one = |seed| {
        if stopped.load(Relaxed) {
            return None;
        }
        let made = scene(what, seed);
        if hear(done.fetch_add(1, Relaxed) + 1, of).is_break() {
            stopped.store(true, Relaxed);
        }
        Some((seed, made))
    };
    let all: Vec<(u64, Result<bool>)> = what.seeds.clone().into_par_iter().filter_map(one).collect();
    let mut made = Generated { stopped: stopped.into_inner(), ..Generated::default() };
    for (seed, one) in all {
        match one {
            Ok(true) => made.written += 1,
            Ok(false) => made.there += 1,
            Err(e) if matches!(e.kind, Kind::Input | Kind::Options) => made.failed.push((seed, e)),
            Err(e) => return Err(e),
        }
    }
    Ok(made)
}

/// Writes the scene of a seed. False: it was there.
fn scene(what: &Generation, seed: u64) -> Result<bool> {
    let file = |name: String| what.out.join(name);
    let [description, capture_file, truth_file, input_file] =
        [format!("s{seed}.json"), format!("c{seed}.npz"), format!("t{seed}.npz"), format!("i{seed}.npy")]
            .map(file);
    let said = std::fs::read(&description).ok().and_then(|b| serde_json::from_slice::<Description>(&b).ok());
    let is_whole = capture_file.exists() && truth_file.exists() && (!what.inputs || input_file.exists());
    if is_whole && said.is_some_and(|said| said.options == what.options) {
        return Ok(false);
    }
    let GenerationOptions { coarse, measured, ideal, scan, empty } = what.options;
    let case = if measured { FamilyCase::measured(seed) } else { FamilyCase::of(seed) };
    let case = scan.map_or(case.clone(), |scan| case.scanned(scan));
    let case = if ideal { case.ideal() } else { case };
    let case = if coarse { case.coarse() } else { case };
    let how = empty.map(|[share, power, ripple]| EmptyRoom { share, power, ripple });
    let truth = case.truth()?;
    let (measured, room) = case.captures(how.as_ref())?;
    measured.check()?;
    if let Some((folder, room)) = what.empty_out.as_ref().zip(room) {
        capture::write(&room, &folder.join(format!("e{seed}.npz")))?;
    }
    export::npz::write_truth(&truth_file, &truth)?;
    capture::write(&measured, &capture_file)?;
    // As a reconstruction sees it: without dead pairs and what else is taken off first.
    let seen = job::load(&capture_file, &Settings::default())?.capture;
    if what.inputs {
        let input = Array::from_f16(&[BANDS, SIDE, SIDE, DEEP], &learned::input(&seen)?);
        atomic::write(&input_file, &input.to_npy())?;
    }
    let s = &case.scene;
    let said = Description {
        options: what.options,
        kind: learned::kind(&seen),
        pairs: kind(s).into(),
        reflectance: s.reflectance.name().into(),
        extent: seen.wall_extent(),
        wall: s.wall,
        back: case.back,
        words: case.words.clone(),
    };
    write_json(&description, &said, false)?;
    Ok(true)
}
