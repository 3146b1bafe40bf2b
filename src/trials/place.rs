//! Looks whether the scene is where the usual box is.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::Ask;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::solve::vector::aside;
use crate::solve::{Doing, Progress, VectorOptions, Watch};
use crate::transport::Volume;

/// The box of a scene that is not in the usual one, which is as wide as the scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FoundPlace {
    /// (xmin, xmax, ymin, ymax, zmin, zmax) in metres.
    pub extent: [f64; 6],
    /// The share of the light that comes from beyond the usual box.
    pub beyond: f64,
    /// The shares of other pairs' squares that a wide box and the usual one leave.
    pub left: [f64; 2],
}

impl FoundPlace {
    /// The box.
    pub fn volume(&self) -> Volume {
        let [x0, x1, y0, y1, z0, z1] = self.extent;
        Volume { min: glam::dvec3(x0, y0, z0), max: glam::dvec3(x1, y1, z1) }
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        let [x0, x1, y0, y1, ..] = self.extent;
        let [wide, usual] = self.left.map(|share| 100.0 * share);
        format!(
            "the scene is not in front of the scanned part of the wall: {:.0} % of the light comes from beside it, and a wide \
             box leaves {wide:.2} % of pairs that it has not seen, the usual one {usual:.2} %; the box is ({x0:.3}, {x1:.3}) \
             by ({y0:.3}, {y1:.3}) m (give a volume to choose another)",
            100.0 * self.beyond
        )
    }
}

/// Where the scene is, if the usual box does not hold it.
pub(super) fn find(
    ask: &Ask<'_>,
    options: &VectorOptions,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<FoundPlace>> {
    let grid = ask.discretisation.grid(ask.solver, capture)?;
    let mut told = |p: &Progress| hear(&Progress { doing: Doing::Trial, ..p.clone() });
    let mut watch = Watch { hear: &mut told, maps_every: None, maps_at: &[] };
    let found = aside(gpu, capture, &grid, options, ask.memory, &mut watch)?;
    Ok(found.map(|found| {
        let (min, max) = (found.volume.min, found.volume.max);
        let extent = [min.x, max.x, min.y, max.y, min.z, max.z];
        FoundPlace { extent, beyond: found.beyond, left: found.left }
    }))
}
