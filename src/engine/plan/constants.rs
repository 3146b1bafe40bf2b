//! Specialization constants that a plan gives its passes.

use std::collections::BTreeMap;

use super::tuning::{Tuning, row_run};
use super::whole::Plan;
use crate::gpu::Constant;
use crate::transport::kernels::constant;
use crate::transport::{Binning, Geometry, Gradient};

impl Plan {
    /// The value that the plan gives a constant, if it gives one.
    pub fn constant(&self, constant: Constant) -> Option<u32> {
        self.constants.get(&constant).copied()
    }

    /// Changes the sizes, and the constants that follow from them. Buffers stay as they are.
    pub fn tune(&mut self, change: impl FnOnce(&mut Tuning)) {
        change(&mut self.division.tuning);
        self.division.runs &= self.division.tuning.window == 0;
        self.constants.extend(self.sizes());
    }

    /// Constants that describe the scene and how the work is cut, for all passes.
    pub(crate) fn shared_constants(&self) -> BTreeMap<Constant, u32> {
        let scene = [
            (constant::GEOMETRY, self.scene.geometry as u32),
            (constant::REFLECTANCE, self.scene.reflectance.number()),
            (constant::CURVED, u32::from(self.scene.curved)),
            (constant::FINE, u32::from(self.scene.fine)),
            (constant::POLISHED, u32::from(self.scene.polished)),
            (constant::TOUCHING, u32::from(self.levels.touching)),
            (constant::SEEN, u32::from(self.scene.pulse > 0 || self.has_spots())),
            (constant::SPOT, u32::from(self.has_spots())),
            (constant::ROWS, u32::from(self.scene.high_pass)),
            (constant::SPLIT, u32::from(self.demand.binning == Binning::Linear)),
            (constant::EXACT, u32::from(self.demand.gradient == Gradient::Exact)),
        ];
        scene.into_iter().chain(self.sizes()).collect()
    }

    /// Constants that say how the work is cut.
    fn sizes(&self) -> Vec<(Constant, u32)> {
        let t = self.division.tuning;
        let product = self.scene.geometry == Geometry::Product;
        vec![
            (constant::RUNS, u32::from(self.division.runs)),
            (constant::LANES, t.lanes),
            (constant::CHUNK, t.chunk),
            (constant::WINDOW, t.window),
            (constant::VOXELS, t.voxels),
            (constant::SLICES, t.slices),
            (constant::FILL, t.fill),
            (constant::FORWARD_FILL, t.forward_fill),
            (constant::FORWARD_OTHERS, if product { t.others_forward } else { 0 }),
            (constant::OTHERS, t.others_backward),
            (constant::SET_CELLS, self.set_cells()),
            (constant::ROW_LANES, t.row_lanes.max(1)),
            (constant::ROW_RUN, row_run(self.scene.bins, t.row_lanes)),
            (constant::PIXEL_LANES, t.pixel_lanes),
            (constant::FORWARD_SETS, self.most_sets()),
        ]
    }
}
