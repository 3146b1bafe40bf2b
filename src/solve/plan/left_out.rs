//! What a scene does not need, and what is saved by leaving it out: exact for memory and for what is counted, and
//! measured for time in docs/leave-out.md.

use super::buffers::surface_bytes;
use super::room::with_rim;
use super::{Level, Plan, SMALL_PIXEL};
use crate::solve::NoiseTerm;
use crate::transport::{Geometry, Gradient, Reflectance};

impl Plan {
    pub(super) fn list_left_out(&self) -> Vec<String> {
        let voxels = self.finest().grid.storage() as u64;
        let mut out = vec![];
        let mut left = |what: String, saves: String| out.push(format!("{what} (saves {saves})"));
        let (pairs, all) = (self.pairs, 2 * self.pairs);
        match self.geometry {
            Geometry::Confocal => left(
                "the second distance of a pair: laser and sensor point are one".into(),
                format!("{pairs} of {all} distances per voxel"),
            ),
            Geometry::Product => left(
                "distances per pair: every scanned point meets every other one".into(),
                format!(
                    "all but 1 / {} of the scanned points' distances, all but 1 / {} of the others'",
                    self.tuning.others_forward, self.tuning.lanes
                ),
            ),
            Geometry::TwoPoints => {}
        }
        if !self.curved {
            let why = match self.reflectance {
                Reflectance::Lambertian => "it is flat",
                _ => "the model does not ask for them",
            };
            let points = (self.scanned + self.others) as u64;
            left(format!("the wall's normals: {why}"), mebibytes(points * 16));
        }
        if !self.touching {
            left("voxels on wall points: there are none".into(), "a question per distance".into());
        }
        if !self.reflectance.has_normals() {
            left("the surfaces' normals: the model has no cosine".into(), mebibytes(voxels * 16));
        }
        if self.noise == NoiseTerm::Off {
            let weights = (self.pairs * self.bins) as u64;
            left("the noise term: its weights, their moments and its kernel".into(), mebibytes(weights * 12));
        }
        if self.pulse == 0 {
            let what = "the instrument's pulse: none is known, paths are taken for sharp";
            // Where a surface's residuals are averaged along time, they take the place.
            let place = if self.blurred { 0 } else { self.pairs * self.bins * 4 };
            left(what.into(), mebibytes(place as u64));
        }
        let unreached = self.all_bins - self.bins;
        if unreached > 0 {
            let bytes = (self.pairs * unreached) as u64 * if self.fixed_point() { 20 } else { 16 };
            left(
                format!("{unreached} of {} gated bins: no voxel's path ends in them", self.all_bins),
                mebibytes(bytes),
            );
        }
        let finest = self.reachable.last().expect("a plan has a level");
        let dark = finest.iter().filter(|r| !**r).count();
        if dark > 0 {
            left(
                format!("{dark} of {} bricks: no gated bin tells of them", finest.len()),
                format!("up to {:.1} % of dense iterations", 100.0 * dark as f64 / finest.len() as f64),
            );
        }
        let early: Vec<&Level> = self.levels.iter().filter(|l| l.pairs < self.pairs).collect();
        if let Some(most) = early.iter().map(|l| l.pairs).max() {
            let of = |l: &&Level| format!("{} on {} lateral voxels", l.pairs, l.grid.n[0]);
            left(
                format!(
                    "pairs of early iterations: of {pairs} they take {}",
                    early.iter().map(of).collect::<Vec<_>>().join(", ")
                ),
                format!("{:.0} % or more of their passes", 100.0 * (1.0 - most as f64 / pairs as f64)),
            );
        }
        if self.vectors && self.surface_iterations == 0 {
            let [x, y, _] = self.maps_grid().n;
            let bytes = surface_bytes((x * y) as u64);
            left("the surface that the volume's maps begin".into(), mebibytes(bytes));
        }
        let factor = self.factor();
        if factor > 1 {
            left(
                format!("voxels as small as the surface's pixels: they are {factor} of them wide"),
                format!("{} of {} of the finest grid's voxels", factor * factor - 1, factor * factor),
            );
        }
        if self.points == 1 && !self.surface.is_empty() {
            let pixel = self.maps_grid().pitch.truncate().max_element();
            let small = pixel <= SMALL_PIXEL * self.bin_width;
            let why = if small { "it is as small as two bins of path" } else { "one was asked for" };
            left(
                format!("three of a surface pixel's four points: {why}"),
                "three of four of its pairs".into(),
            );
        }
        let [slots, touched] = [self.capacity, self.touched_capacity].map(|v| v as u64);
        if self.vectors {
            left(
                "the optimiser's moments: the step comes from a bound".into(),
                mebibytes(voxels * 32 - slots * 24),
            );
        }
        if slots < voxels {
            // Elements, gradient and what a solver has of its own; raw variables, moments and list of neighbours too.
            let normals = if self.reflectance.has_normals() { 16 } else { 0 };
            let [active, either] = if self.vectors { [76, 0] } else { [32, 52] };
            left(
                format!("what inactive voxels would hold: there is room for {slots} of {voxels} at once"),
                mebibytes((voxels - slots) * (active + normals) + (voxels - touched) * either),
            );
        }
        if !self.continuous {
            let what = "random sampling: interpolation, its adjoint, state and masks of the active voxels' neighbours";
            let rim = (with_rim(self.capacity, self.finest().grid.storage()) - self.capacity) as u64;
            let state = if self.vectors { 0 } else { rim * 52 };
            left(what.into(), mebibytes(voxels / 2 + state));
        }
        if self.gradient == Gradient::Published {
            left("the falloff in the gradient".into(), "a product per pair".into());
        }
        if self.levels.len() == 1 {
            left("doubling: the first grid is the last".into(), "its dispatches".into());
        }
        out
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
