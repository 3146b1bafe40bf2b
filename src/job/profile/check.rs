//! Compares a device's results with the float64 twins: an iteration of each solver and of the surface, on a small
//! simulated scene, on every accumulation path that the device offers.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::super::words::plain;
use crate::Result;
use crate::capture::{Capture, Pulse};
use crate::gpu::Gpu;
use crate::simulate::{RenderOptions, Scene, simulate};
use crate::solve::{Accumulation, Pass, paper as paper_solver, passes, surface as surface_stage};
use crate::transport::Model;
use crate::transport::twin;

mod buffers;
mod paper;
mod surface;

/// A check: an iteration of a solver, pass by pass.
pub struct Check {
    /// The solver's name in tables.
    pub solver: &'static str,
    /// The passes that it compares with their twins.
    pub holds: &'static [&'static Pass],
    /// Whether it runs with an instrument's pulse, and with its spots, too.
    pub with_instrument: bool,
    run: fn(&Gpu, &Capture, Accumulation) -> Result<Vec<Held>>,
}

/// All checks.
pub static CHECKS: &[Check] = &[
    Check {
        solver: "paper",
        holds: &[
            &paper_solver::passes::SAMPLE,
            &passes::FORWARD,
            &passes::RESIDUAL,
            &paper_solver::passes::BACKWARD,
            &paper_solver::passes::UPDATE,
        ],
        with_instrument: false,
        run: paper::check,
    },
    Check {
        solver: "surface",
        holds: &[
            &surface_stage::passes::SURFACE_BONDS,
            &surface_stage::passes::SURFACE_POINTS,
            &passes::FORWARD,
            &passes::SPOT,
            &passes::PULSE,
            &passes::RESIDUAL,
            &passes::PULSE_BACK,
            &passes::SPOT_BACK,
            &surface_stage::passes::SURFACE_GATHER,
        ],
        with_instrument: true,
        run: surface::check,
    },
];

/// The result of one comparison.
struct Held {
    pass: &'static str,
    error: f64,
}

/// A pass that was compared with its twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checked {
    /// The solver, with ", pulse" or ", spots" after it if there were any.
    pub solver: String,
    /// How rendered values were added up.
    pub accumulation: String,
    /// "sample", "forward" (with the residual), "backward", "update", ...
    pub pass: String,
    /// Largest difference over the largest true value.
    pub error: f64,
    /// The largest error that passes.
    pub allowed: f64,
}

impl Checked {
    /// Whether the error is allowed. NaN is not.
    pub fn passed(&self) -> bool {
        self.error <= self.allowed
    }
}

/// Error of fp32 after some thousand additions. Terms may cancel.
const ALLOWED: f64 = 1e-4;

/// Runs all checks.
///
/// # Errors
/// The device fails. A pass that differs is not an error here: see [`Checked::passed`].
pub fn check(gpu: &Gpu) -> Result<Vec<Checked>> {
    let scene = Scene { scan: 6, bin_width: 0.02, ..Scene::named("letter-Z")? };
    let capture = simulate(&scene, &RenderOptions { noise: 0.2, ..RenderOptions::default() })?.capture;
    // An asymmetric pulse, three and a half bins long.
    let pulse = Pulse::new(vec![1.0, 4.0, 3.0, 2.0, 1.0], 0.014, -0.02);
    let pulsed = capture.clone().with(|c| c.pulse = Some(pulse));
    let spotted = capture.clone().with(|c| (c.laser_spot, c.sensor_spot) = (Some(0.3), Some(0.2)));
    let mut all = vec![];
    use Accumulation::{Cas, Fixed, Fixed32, Float, Owned};
    for accumulation in [Float, Fixed, Fixed32, Cas, Owned] {
        if accumulation == Float && !gpu.accumulations.float {
            continue;
        }
        for check in CHECKS {
            let captures = [(&capture, ""), (&pulsed, ", pulse"), (&spotted, ", spots")];
            for (capture, with) in &captures[..if check.with_instrument { 3 } else { 1 }] {
                let solver = format!("{}{with}", check.solver);
                let held = (check.run)(gpu, capture, accumulation)?;
                all.extend(held.into_iter().map(|h| checked(&solver, accumulation, h)));
            }
        }
    }
    Ok(all)
}

const LATERAL: usize = 12;

fn checked(solver: &str, accumulation: Accumulation, held: Held) -> Checked {
    Checked {
        solver: solver.into(),
        accumulation: plain(&accumulation),
        pass: held.pass.into(),
        error: held.error,
        allowed: ALLOWED,
    }
}

/// Four repeatable numbers in [0, 1).
fn random(i: usize) -> [f32; 4] {
    std::array::from_fn(|k| twin::random3(i as u32, k as u32, 0, 1)[0] as f32)
}

/// Whether fp32 and float64 choose the same bins for all paths by this point: no path lies near the start of a bin
/// (`part` 0) or near its centre (`part` 0.5).
fn is_clear(model: &Model, point: DVec3, part: f64) -> bool {
    let wall = model.rendered_wall();
    (0..wall.pairs()).all(|pair| {
        let position = (wall.path(pair, point) - model.t_start) / model.bin_width - part;
        (position - position.round()).abs() > 1e-4
    })
}

/// The largest difference over the largest true value; NaN if the device gave a NaN.
fn error(got: &[f64], want: &[f64]) -> f64 {
    let largest = want.iter().fold(1e-300f64, |a, b| a.max(b.abs()));
    let worst = got.iter().zip(want).map(|(g, w)| (g - w).abs()).max_by(f64::total_cmp);
    worst.unwrap_or(f64::NAN) / largest
}

/// The largest error of every pass, for a table: ((solver, pass), error).
pub fn worst(all: &[Checked]) -> BTreeMap<(String, String), f64> {
    let mut worst = BTreeMap::new();
    for c in all {
        let error: &mut f64 = worst.entry((c.solver.clone(), c.pass.clone())).or_insert(0.0);
        // A NaN stays.
        *error = if c.error > *error || c.error.is_nan() { c.error } else { *error };
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::GpuOptions;

    #[test]
    fn this_device_computes_as_the_twins_on_every_path() {
        let gpu = Gpu::open(&GpuOptions::default()).expect("a Vulkan device: `make setup` installs lavapipe");
        let all = check(&gpu).unwrap();
        assert_eq!(all.len(), 16 * if gpu.accumulations.float { 5 } else { 4 });
        for c in &all {
            println!("{c:?}");
            assert!(c.passed() && c.error > 0.0, "{c:?}");
        }
        assert_eq!(worst(&all).len(), 16);
    }

    #[test]
    fn what_differs_does_not_pass() {
        let c = |error| checked("paper", Accumulation::Owned, Held { pass: "forward", error });
        assert!(c(1e-6).passed() && !c(1e-3).passed() && !c(f64::NAN).passed());
        assert!(worst(&[c(1e-6), c(f64::NAN), c(1e-5)]).values().all(|e| e.is_nan()));
        assert!(error(&[1.0, f64::NAN], &[1.0, 2.0]).is_nan());
        assert_eq!(error(&[1.0, 3.0], &[1.0, 2.0]), 0.5);
    }
}
