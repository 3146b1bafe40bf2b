//! Compares a device's results with the float64 reference, by the cases of [`verify`](thirdbounce_verify) that are for devices.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use thirdbounce::Result;
use thirdbounce::gpu::Gpu;
use thirdbounce::job::plain;
use thirdbounce_verify::cases;

/// A kernel that was compared with its reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checked {
    /// The case: the solver, and what is particular.
    pub solver: String,
    /// How rendered values were added up.
    pub accumulation: String,
    /// The kernel.
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

/// Runs all cases for devices. Of a kernel's results in a case, the worst counts.
///
/// # Errors
/// The device fails. A kernel that differs is not an error here: see [`Checked::passed`].
pub fn check(gpu: &Gpu) -> Result<Vec<Checked>> {
    let mut worst: BTreeMap<(&str, String, &str), [f64; 2]> = BTreeMap::new();
    for case in cases().iter().filter(|case| case.checks_devices) {
        for accumulation in case.accumulations(&gpu.abilities()) {
            for c in case.run(gpu, accumulation)? {
                let of = worst.entry((case.name, plain(&accumulation), c.module)).or_default();
                *of = if c.error / c.allowed > of[0] / of[1] || of[1] == 0.0 {
                    [c.error, c.allowed]
                } else {
                    *of
                };
            }
        }
    }
    let checked = |((solver, accumulation, pass), [error, allowed]): ((&str, String, &str), [f64; 2])| {
        Checked { solver: solver.into(), accumulation, pass: pass.into(), error, allowed }
    };
    Ok(worst.into_iter().map(checked).collect())
}
