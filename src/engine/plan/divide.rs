//! How the work is divided. No dispatch of a pass over pairs has more work than a device may get at once
//! ([`crate::gpu::Limits::work`]), or more turns than a loop may have, and no buffer more values than kernels index.

use super::demand::Demand;
use super::domain::DomainCapacity;
use super::level::Level;
use super::levels::Levels;
use super::tuning::{Accumulation, Tuning};
use crate::advice::advice;
use crate::gpu::{Abilities, Accumulations};
use crate::transport::Model;
use crate::{Error, Result};

/// The most additions to one fp32 sum: more may lose 1e-4 of it, as equal addends round alike (docs/devices.md).
const VOXELS_PER_BIN: usize = 16_384;

/// How the work of a plan is divided: over invocations and over dispatches.
#[derive(Debug, Clone, PartialEq)]
pub struct WorkDivision {
    /// How rendered values are added up; never `Auto`.
    pub accumulation: Accumulation,
    /// Voxels are summed in runs before they are added to a bin: more of them go into one bin than an fp32 sum bears.
    pub runs: bool,
    /// Workgroup and chunk sizes.
    pub tuning: Tuning,
    /// Voxel-pair evaluations of a dispatch at most: see [`crate::gpu::Limits::work`].
    pub work: u64,
    /// The most workgroups of a dispatch along x.
    pub tiles: u32,
}

impl WorkDivision {
    /// All pairs at once on one device, as it adds and as large as it may.
    ///
    /// # Errors
    /// The device does not offer the accumulation, or a kernel would loop longer than drivers allow.
    pub(crate) fn of(
        model: &Model,
        levels: &Levels,
        domain: &DomainCapacity,
        demand: &Demand,
        device: &Abilities,
    ) -> Result<WorkDivision> {
        let accumulation = choose(demand.accumulation, device.accumulations)?;
        let tuning = Tuning::new(model, domain.capacity, accumulation, device)?;
        // Fixed point adds without rounding, and a window already sums in two levels.
        let crowded = |l: &Level| domain.capacity.min(l.grid.storage()) / model.bins > VOXELS_PER_BIN;
        let runs = !accumulation.is_fixed() && tuning.window == 0 && levels.volume.iter().any(crowded);
        let (work, tiles) = (device.limits.work, device.limits.groups[0]);
        Ok(WorkDivision { accumulation, runs, tuning, work, tiles })
    }
}

/// How a device adds that offers these atomics.
fn choose(wanted: Accumulation, offered: Accumulations) -> Result<Accumulation> {
    let lacks = |what: &str| {
        Err(Error::options(
            format!("this device has no {what}"),
            advice!["leave " Accumulation " out, or choose repeatable"],
        ))
    };
    match wanted {
        Accumulation::Float if !offered.float => lacks("fp32 atomics (VK_EXT_shader_atomic_float)"),
        Accumulation::Fixed if !offered.int64 => lacks("64-bit atomics (VK_KHR_shader_atomic_int64)"),
        Accumulation::Auto if offered.float => Ok(Accumulation::Float),
        Accumulation::Auto | Accumulation::Repeatable if offered.int64 => Ok(Accumulation::Fixed),
        Accumulation::Auto | Accumulation::Repeatable => Ok(Accumulation::Owned),
        other => Ok(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_adds_as_it_can() {
        use Accumulation::{Auto, Fixed, Float, Owned, Repeatable};
        let of = |wanted, [float, int64]: [bool; 2]| choose(wanted, Accumulations { float, int64 });
        let auto = [[true, true], [true, false], [false, true], [false, false]].map(|o| of(Auto, o).unwrap());
        assert_eq!(auto, [Float, Float, Fixed, Owned]);
        let repeatable = [[true, true], [true, false]].map(|o| of(Repeatable, o).unwrap());
        assert_eq!(repeatable, [Fixed, Owned]);
        let error = of(Fixed, [true, false]).unwrap_err();
        assert!(error.what.contains("no 64-bit atomics"), "{error}");
        assert!(of(Float, [false, true]).is_err() && of(Owned, [false, false]).is_ok());
    }
}
