//! Which solver with which options: the one place that tells solvers apart.

use serde::Serialize;

use super::plain;
use crate::capture::Capture;
use crate::gpu::{Abilities, Gpu};
use crate::solve::{
    Accumulation, Beside, PaperOptions, Part, Plan, Reconstruction, Sizes, VectorOptions, paper, vector,
};
use crate::transport::{Grid, Reflectance};
use crate::{Error, Result};

/// What every solver's options have, whichever these are.
macro_rules! of_either {
    ($options:expr, $o:ident => $value:expr) => {
        match $options {
            SolverOptions::Paper($o) => $value,
            SolverOptions::Vector($o) => $value,
        }
    };
}

/// A solver's options. A new solver is one more variant, and one more arm wherever they are told apart below.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum SolverOptions {
    Paper(PaperOptions),
    Vector(VectorOptions),
}

impl From<PaperOptions> for SolverOptions {
    fn from(options: PaperOptions) -> SolverOptions {
        SolverOptions::Paper(options)
    }
}

impl From<VectorOptions> for SolverOptions {
    fn from(options: VectorOptions) -> SolverOptions {
        SolverOptions::Vector(options)
    }
}

impl SolverOptions {
    /// The solvers of this version, by their names on the command line.
    pub const NAMES: &[&str] = &["paper", "vector"];

    /// The solver that wins the comparison of error against run time (docs/error-vs-time.md).
    pub const DEFAULT: &str = "vector";

    pub fn name(&self) -> &'static str {
        match self {
            SolverOptions::Paper(_) => "paper",
            SolverOptions::Vector(_) => "vector",
        }
    }

    /// # Errors
    /// The first option that makes no sense, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        of_either!(self, o => o.check())
    }

    /// Lateral voxels of the final grid.
    pub fn lateral(&self) -> usize {
        of_either!(self, o => o.lateral)
    }

    /// The same options for another lateral resolution.
    pub fn with_lateral(&self, lateral: usize) -> SolverOptions {
        let mut other = self.clone();
        of_either!(&mut other, o => o.lateral = lateral);
        other
    }

    /// Sizes that are asked for.
    pub fn sizes(&self) -> Sizes {
        of_either!(self, o => o.sizes)
    }

    /// The same options with other sizes.
    pub fn with_sizes(&self, sizes: Sizes) -> SolverOptions {
        let mut other = self.clone();
        of_either!(&mut other, o => o.sizes = sizes);
        other
    }

    /// How surfaces reflect.
    pub fn reflectance(&self) -> Reflectance {
        of_either!(self, o => o.reflectance)
    }

    /// How contributions are to be added up.
    pub fn accumulation(&self) -> Accumulation {
        of_either!(self, o => o.accumulation)
    }

    /// The most iterations of the volume.
    pub fn iterations(&self) -> usize {
        of_either!(self, o => o.iterations)
    }

    /// The most iterations, the surface's among them.
    pub fn all_iterations(&self) -> usize {
        match self {
            SolverOptions::Paper(o) => o.iterations,
            SolverOptions::Vector(o) => o.iterations + o.surface_iterations,
        }
    }

    /// Nothing nearer than this is reconstructed, metres.
    pub fn min_depth(&self) -> f64 {
        of_either!(self, o => o.min_depth)
    }

    /// What a solve would need of a device.
    ///
    /// # Errors
    /// A capture that the solver does not take; a grid beyond the device's limits.
    pub fn plan(
        &self,
        capture: &Capture,
        grid: Grid,
        abilities: &Abilities,
        with_volume: bool,
    ) -> Result<Plan> {
        let model = match self {
            SolverOptions::Paper(o) => paper::model(capture, &grid, o),
            SolverOptions::Vector(o) => vector::model(capture, &grid, o),
        };
        let resolution = capture.resolution();
        of_either!(self, o => Plan::new(&model, grid, resolution, o, abilities, with_volume))
    }

    /// The schedules of a whole solve by such a plan.
    pub fn outline(&self, plan: &Plan) -> Vec<Part> {
        match self {
            SolverOptions::Paper(o) => paper::outline(plan, o),
            SolverOptions::Vector(o) => vector::outline(plan, o),
        }
    }

    /// Runs the solver.
    ///
    /// # Errors
    /// See [`paper::reconstruct`].
    pub fn solve<'b, 'w: 'b>(
        &self,
        gpu: &Gpu,
        capture: &Capture,
        grid: Grid,
        memory: Option<u64>,
        with_volume: bool,
        beside: impl Into<Beside<'b, 'w>>,
    ) -> Result<Reconstruction> {
        match self {
            SolverOptions::Paper(o) => paper::reconstruct(gpu, capture, grid, o, memory, with_volume, beside),
            SolverOptions::Vector(o) => {
                vector::reconstruct(gpu, capture, grid, o, memory, with_volume, beside)
            }
        }
    }
}

/// Whether a solver of DESIGN's list can be had.
///
/// # Errors
/// One that is not in this version, or not known at all.
pub fn check_solver(name: &str) -> Result<()> {
    choice("solver", name, SolverOptions::NAMES, &["fbp", "bp", "lct", "dlct", "fk", "phasor"])
}

/// The light-transport model of that name.
///
/// # Errors
/// One that is not known.
pub fn reflectance(name: &str) -> Result<Reflectance> {
    const ALL: [Reflectance; 4] =
        [Reflectance::Cosine, Reflectance::Lambertian, Reflectance::Retroreflective, Reflectance::Isotropic];
    let names = ALL.map(|r| plain(&r));
    choice("model", name, &names.each_ref().map(String::as_str), &[])?;
    Ok(ALL[names.iter().position(|n| n == name).expect("choice knows it")])
}

fn choice(option: &str, name: &str, here: &[&str], later: &[&str]) -> Result<()> {
    if here.contains(&name) {
        return Ok(());
    }
    let what = if later.contains(&name) { "is not in this version" } else { "is not known" };
    Err(Error::options(
        format!("--{option} {name} {what}"),
        format!("use --{option} {}, or leave it out", here.join(" or ")),
    ))
}
