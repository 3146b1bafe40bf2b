//! The work of a pass: operations of an evaluation of a voxel against a pair, counted from the kernels' source, and the limit
//! of the device that binds it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::limits::DeviceLimits;
use thirdbounce::engine::{Accumulation, Pass, Plan};
use thirdbounce::gpu::Buffer;
use thirdbounce::surface::passes::SURFACE_GATHER;
use thirdbounce::transport::kernels::buffer;
use thirdbounce::transport::{Binning, Geometry, Gradient, Reflectance};

/// A limit that may bind a kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Limit {
    /// Atomic additions to histograms.
    Additions,
    /// Multiply-adds and inverse square roots.
    Arithmetic,
    /// Bytes of buffers read and written.
    Memory,
    /// The same where they are few enough for a cache.
    #[serde(rename = "cached memory")]
    Cached,
    /// Starts of dispatches.
    Launch,
}

/// Operations of a kernel: bytes per pair and per point of a dispatch, the rest per evaluation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Bytes of a pair in the buffers that a dispatch reads and writes: its histograms and wall points.
    pub bytes_of_pair: f64,
    /// Bytes of an active point, pixel or voxel in these buffers.
    pub bytes_of_point: f64,
    /// Additions to histograms, atomic on Vulkan devices.
    pub additions: f64,
    /// Multiply-adds.
    pub fma: f64,
}

/// Buffers that hold a part for each pair. The others that are large hold one for each point, pixel or voxel of the domain.
const OF_PAIRS: [Buffer; 7] = [
    buffer::WALL,
    buffer::MEASURED,
    buffer::RESIDUAL,
    buffer::HISTOGRAMS,
    buffer::SPREAD,
    buffer::LOSS_PARTIALS,
    buffer::NOISE_STATE,
];

/// Multiply-adds in the time of an inverse square root: 6.7 on an H100 (`benches/results`).
const ROOT: f64 = 7.0;
/// An arm (`arm_to`): difference, squared length, distance. With exact distances also `refine`.
const ARM: f64 = 7.0 + ROOT;
/// Its falloff.
const FALLOFF: f64 = 2.0;
const REFINED: f64 = 28.0;
/// A place and its share; with exact distances.
const PLACE: f64 = 5.0;
const EXACT_PLACE: f64 = 12.0;
/// Product of a value, and its two shares.
const VALUE: f64 = 4.0;
/// Gathers: interpolated residual and gradient by the vector; gradient by the depth.
const SLOPE: f64 = 7.0;
const BY_DEPTH: f64 = 13.0;

impl Work {
    /// The work of a pass of a plan, on the host or on a Vulkan device.
    pub fn of(plan: &Plan, pass: &Pass, is_host: bool) -> Work {
        let size = |buffer: Buffer| plan.buffers.iter().find(|b| b.buffer == buffer).map_or(0, |b| b.bytes);
        let used = || pass.reads(plan).chain(pass.writes(plan));
        let bytes = |of_pairs: bool| -> f64 {
            used().filter(|b| OF_PAIRS.contains(b) == of_pairs).map(|b| size(b) as f64).sum()
        };
        let moved = Work {
            bytes_of_pair: bytes(true) / plan.scene.pairs.max(1) as f64,
            bytes_of_point: bytes(false) / plan.domain.capacity.max(1) as f64,
            ..Work::default()
        };
        if pass.pairs.is_none() {
            return moved;
        }
        let (scene, t) = (&plan.scene, &plan.division.tuning);
        let owned = plan.division.accumulation == Accumulation::Owned;
        let forward = pass.report.starts_with("forward");
        let [lanes, others, gathered] = [t.lanes, t.others_forward, t.others_backward].map(f64::from);
        let arms = match (scene.geometry, forward) {
            (Geometry::Confocal, _) => 1.0,
            (Geometry::TwoPoints, _) => 2.0,
            (Geometry::Product, true) if owned => 2.0,
            (Geometry::Product, true) => 1.0 / others + 1.0 / lanes,
            (Geometry::Product, false) => 1.0 / gathered,
        };
        let cosines = match scene.reflectance {
            Reflectance::Cosine => 5.0,
            Reflectance::Lambertian => 14.0,
            _ => 0.0,
        };
        let cells = if plan.demand.binning == Binning::Linear { 2.0 } else { 1.0 };
        let (arm, place) = if scene.fine { (ARM + REFINED, EXACT_PLACE) } else { (ARM, PLACE) };
        let falloff = if forward || plan.demand.gradient == Gradient::Exact { FALLOFF } else { 0.0 };
        let gathers = if *pass == SURFACE_GATHER { SLOPE + BY_DEPTH } else { SLOPE };
        let fma = arms * (arm + falloff) + place + cosines + if forward { VALUE } else { gathers };
        let adds = forward && (is_host || !owned && t.window == 0);
        Work { additions: if adds { cells } else { 0.0 }, fma, ..moved }
    }

    /// Bytes that a dispatch touches at least.
    pub fn bytes(&self, pairs: f64, points: f64) -> f64 {
        self.bytes_of_pair * pairs + self.bytes_of_point * points
    }

    /// The limit that binds `calls` dispatches that touch these bytes with `evaluations`, both in all, and the least seconds that it
    /// allows.
    pub fn bound(
        &self,
        limits: &DeviceLimits,
        calls: u64,
        bytes: f64,
        evaluations: f64,
    ) -> Option<(Limit, f64)> {
        let each = |count: f64, rate: f64| if count > 0.0 { count * evaluations / rate } else { 0.0 };
        let bytes_per_s = limits.bytes_per_s((bytes / calls.max(1) as f64) as u64);
        let memory = if bytes_per_s > limits.copy_bytes_per_s { Limit::Cached } else { Limit::Memory };
        [
            (Limit::Additions, each(self.additions, limits.scattered_atomic_per_s)),
            (Limit::Arithmetic, each(self.fma, limits.fma_per_s)),
            (memory, bytes / bytes_per_s),
            (Limit::Launch, calls as f64 * limits.dispatch_s),
        ]
        .into_iter()
        .filter(|(_, seconds)| seconds.is_finite() && *seconds > 0.0)
        .max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// The work of every pass of a plan, by kernel.
pub fn works_of(plan: &Plan, is_host: bool) -> BTreeMap<&'static str, Work> {
    plan.passes.iter().map(|pass| (pass.kernel.name(), Work::of(plan, pass, is_host))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slowest_of_all_limits_binds() {
        let limits = DeviceLimits {
            fma_per_s: 100.0,
            scattered_atomic_per_s: 20.0,
            copy_bytes_per_s: 1e3,
            dispatch_s: 0.5,
            ..DeviceLimits::default()
        };
        let work = Work { additions: 2.0, fma: 20.0, ..Work::default() };
        assert_eq!(work.bound(&limits, 1, 10.0, 100.0), Some((Limit::Arithmetic, 20.0)));
        let work = Work { fma: 4.0, ..work };
        assert_eq!(work.bound(&limits, 1, 10.0, 100.0), Some((Limit::Additions, 10.0)));
        assert_eq!(work.bound(&limits, 4, 40.0, 1.0), Some((Limit::Launch, 2.0)));
        assert_eq!(Work::default().bound(&limits, 1, 1048576.0, 0.0), Some((Limit::Memory, 1048.576)));
        assert_eq!(Work::default().bound(&DeviceLimits::default(), 1, 0.0, 0.0), None);
        assert_eq!(Work { bytes_of_pair: 3.0, bytes_of_point: 2.0, ..work }.bytes(10.0, 100.0), 230.0);
    }
}
