//! What a scene does not need, and what is saved by leaving it out.

use super::left_out::LeftOut;
use super::tuning::Accumulation;
use super::whole::Plan;
use crate::transport::{Geometry, Gradient, Reflectance};

impl Plan {
    /// What every solver may leave out.
    pub(crate) fn list_left_out(&self, out: &mut LeftOut) {
        self.left_out_of_pairs(out);
        self.left_out_of_model(out);
        self.left_out_of_bins(out);
        self.left_out_of_levels(out);
    }

    fn left_out_of_pairs(&self, out: &mut LeftOut) {
        let (pairs, all) = (self.scene.pairs, 2 * self.scene.pairs);
        match self.scene.geometry {
            Geometry::Confocal => out.add(
                "the second distance of a pair: laser and sensor point are one",
                format!("{pairs} of {all} distances per voxel"),
            ),
            Geometry::Product => out.add("distances per pair: every scanned point meets every other one", {
                // A workgroup shares the other points' distances, or a lane the one to its other point.
                let t = self.division.tuning;
                let owned = self.division.accumulation == Accumulation::Owned;
                let shared = if owned { 1 } else { t.lanes };
                let of = [t.others_forward, shared];
                format!(
                    "all but 1 / {} of the scanned points' distances, all but 1 / {} of the others'",
                    of[0], of[1]
                )
            }),
            Geometry::TwoPoints => {}
        }
        if self.scene.unused > 0 {
            let of = self.scene.pairs_of_capture();
            let share = 100.0 * self.scene.unused as f64 / of as f64;
            out.add(
                format!("{} of {of} pairs: the others hold enough light", self.scene.unused),
                format!("{share:.0} % of all passes over pairs, and of the counts on the device"),
            );
        }
    }

    fn left_out_of_model(&self, out: &mut LeftOut) {
        if !self.scene.curved {
            let why = match self.scene.reflectance {
                Reflectance::Lambertian => "it is flat",
                _ => "the model does not ask for them",
            };
            let points = (self.scene.scanned + self.scene.others) as u64;
            out.add(format!("the wall's normals: {why}"), mebibytes(points * 16));
        }
        if !self.levels.touching {
            out.add("voxels on wall points: there are none", "a question per distance");
        }
        if !self.scene.reflectance.has_normals() {
            let voxels = self.finest().grid.storage() as u64;
            out.add("the surfaces' normals: the model has no cosine", mebibytes(voxels * 16));
        }
        if self.demand.gradient == Gradient::Published {
            out.add("the falloff in the gradient", "a product per pair");
        }
    }

    fn left_out_of_bins(&self, out: &mut LeftOut) {
        if !self.has_spots() {
            let place = 2 * self.scene.pairs * self.scene.bins * 4;
            out.add("the instrument's spots: laser and sensor see points", mebibytes(place as u64));
        }
        if self.scene.pulse == 0 {
            let place = self.scene.pairs * self.scene.bins * 4;
            out.add(
                "the instrument's pulse: none is known, paths are taken for sharp",
                mebibytes(place as u64),
            );
        }
        let unreached = self.scene.all_bins - self.scene.bins;
        if unreached > 0 {
            let bytes = (self.scene.pairs * unreached) as u64 * if self.fixed_point() { 20 } else { 16 };
            out.add(
                format!("{unreached} of {} gated bins: no voxel's path ends in them", self.scene.all_bins),
                mebibytes(bytes),
            );
        }
    }

    fn left_out_of_levels(&self, out: &mut LeftOut) {
        let finest = self.levels.reachable.last().expect("a plan has a level");
        let dark = finest.iter().filter(|r| !**r).count();
        if dark > 0 {
            let share = 100.0 * dark as f64 / finest.len() as f64;
            out.add(
                format!("{dark} of {} bricks: no gated bin tells of them", finest.len()),
                format!("up to {share:.1} % of dense iterations"),
            );
        }
        if self.levels.volume.len() == 1 {
            out.add("doubling: the first grid is the last", "its dispatches");
        }
    }

    /// Adds what inactive voxels would take. `active` and `touched` are bytes of such a voxel.
    pub fn left_out_of_room(&self, out: &mut LeftOut, [active, touched]: [u64; 2]) {
        let voxels = self.finest().grid.storage() as u64;
        let [slots, either] = [self.domain.capacity, self.domain.touched_capacity].map(|v| v as u64);
        if slots < voxels {
            let normals = if self.scene.reflectance.has_normals() { 16 } else { 0 };
            out.add(
                format!("what inactive voxels would hold: there is room for {slots} of {voxels} at once"),
                mebibytes((voxels - slots) * (active + normals) + (voxels - either) * touched),
            );
        }
    }
}

/// Bytes as text in MiB.
pub fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
