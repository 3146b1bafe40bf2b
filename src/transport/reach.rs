//! Which voxels and which bins light can reach. The others are left out before anything is allocated.

use std::ops::Range;

use glam::{DVec3, dvec3};
use rayon::prelude::*;

use super::{Geometry, Grid, Model, Wall};

/// An axis-aligned box, metres.
#[derive(Debug, Clone, Copy)]
struct BoundingBox {
    min: DVec3,
    max: DVec3,
}

impl BoundingBox {
    /// The voxels `low` to `high` of `grid`, with half a voxel around them, as far as samples may lie.
    fn of(grid: &Grid, low: [usize; 3], high: [usize; 3]) -> BoundingBox {
        let at =
            |c: [usize; 3], shift: f64| grid.position(dvec3(c[0] as f64, c[1] as f64, c[2] as f64) + shift);
        BoundingBox { min: at(low, -0.5), max: at(high, 0.5) }
    }

    fn nearest(&self, p: DVec3) -> f64 {
        p.distance(p.clamp(self.min, self.max))
    }

    fn farthest(&self, p: DVec3) -> f64 {
        (p - self.min).abs().max((p - self.max).abs()).length()
    }

    /// Lower and upper bound of the paths of a pair over points of the box, metres.
    fn paths(&self, wall: &Wall, pair: usize) -> [f64; 2] {
        let points = wall.points_of(pair).map(|n| wall.point(n)[0]);
        [points.map(|p| self.nearest(p)).iter().sum(), points.map(|p| self.farthest(p)).iter().sum()]
    }
}

/// Lower and upper bound of the paths of all pairs over points of the box, metres.
fn paths(wall: &Wall, block: BoundingBox) -> [f64; 2] {
    let side = |points: &[DVec3]| {
        let near = points.iter().map(|p| block.nearest(*p)).fold(f64::INFINITY, f64::min);
        let far = points.iter().map(|p| block.farthest(*p)).fold(0.0, f64::max);
        [near, far]
    };
    if wall.geometry == Geometry::Product {
        let ([a, b], [c, d]) = (side(&wall.scanned), side(&wall.others));
        return [a + c, b + d];
    }
    let all = (0..wall.pairs()).map(|pair| block.paths(wall, pair));
    all.fold([f64::INFINITY, 0.0], |[low, high], [a, b]| [low.min(a), high.max(b)])
}

impl Model {
    /// True if a path between these bounds may reach a bin. A contribution is shared by the two bins around it.
    fn reaches(&self, [low, high]: [f64; 2]) -> bool {
        let end = self.t_start + self.bins as f64 * self.bin_width;
        high >= self.t_start - self.bin_width && low <= end + self.bin_width
    }

    /// For every brick of `grid`: true if a pair's path over one of its points may reach a bin.
    pub fn reachable_bricks(&self, grid: &Grid) -> Vec<bool> {
        let (bricks, wall) = (grid.bricks(), self.rendered_wall());
        let one = |i: usize| {
            let brick = [i % bricks[0], i / bricks[0] % bricks[1], i / (bricks[0] * bricks[1])];
            let low = brick.map(|b| 8 * b);
            let high = [0, 1, 2].map(|a| (low[a] + 7).min(grid.n[a] - 1));
            let block = BoundingBox::of(grid, low, high);
            (0..wall.pairs()).any(|pair| self.reaches(block.paths(wall, pair)))
        };
        (0..bricks.iter().product()).into_par_iter().map(one).collect()
    }

    /// True if a sample of `grid` may be within [`Model::nearest`] of a wall point, with a margin for rounding in fp32.
    pub fn touches(&self, grid: &Grid) -> bool {
        let low = [0, 0, self.near_z(grid).min(grid.n[2] - 1)];
        let block = BoundingBox::of(grid, low, grid.n.map(|n| n - 1));
        let wall = self.rendered_wall();
        let far = wall
            .all_points()
            .chain([&block.min, &block.max])
            .fold(0.0f64, |a, p| p.abs().max_element().max(a));
        let least = self.nearest(grid) + 1e-5 * far;
        !wall.all_points().all(|p| block.nearest(*p) > least)
    }

    /// Removes the bins that no path over a voxel of `grid` reaches. They cannot change, so they add a constant to the
    /// loss. Returns the bins that are left.
    pub fn trim(&mut self, grid: &Grid) -> Range<usize> {
        let low = [0, 0, self.near_z(grid).min(grid.n[2] - 1)];
        let [near, far] = paths(self.rendered_wall(), BoundingBox::of(grid, low, grid.n.map(|n| n - 1)));
        let bin = |path: f64| (path - self.t_start) / self.bin_width;
        let first = (bin(near) - 1.0).floor().max(0.0) as usize;
        let last = ((bin(far) + 2.0).ceil().max(0.0) as usize).min(self.bins);
        if first >= last {
            return 0..self.bins;
        }
        let before = self.bins;
        self.measured = self.measured.chunks_exact(before).flat_map(|h| &h[first..last]).copied().collect();
        self.t_start += first as f64 * self.bin_width;
        self.bins = last - first;
        first..last
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::capture::Capture;
    use crate::transport::Reflectance;

    fn model(points: Vec<DVec3>, min_depth: f64) -> Model {
        let n = points.len();
        let capture = Capture::new([n, 1], points.clone(), points, 4, 0.1, vec![1.0; 4 * n]);
        Model { min_depth, ..Model::new(&capture, Reflectance::Cosine, 1.0, false) }
    }

    #[test]
    fn a_grid_touches_a_wall_point_within_a_quarter_of_a_voxel_of_where_samples_stray() {
        let grid = Grid { n: [4, 4, 8], origin: dvec3(0.0, 0.0, 0.0), pitch: DVec3::splat(0.1) };
        let touches = |points: &[DVec3], min_depth| model(points.to_vec(), min_depth).touches(&grid);
        let far = dvec3(5.0, 5.0, 0.0);
        // Points in the grid, also where voxels are too near to the wall to be active.
        assert!(touches(&[far, dvec3(0.1, 0.1, 0.4)], 0.2));
        assert!(!touches(&[far, dvec3(0.1, 0.1, 0.0)], 0.2));
        assert!(touches(&[far, dvec3(0.1, 0.1, 0.0)], 0.0));
        // Voxels begin at 0.2, samples half a voxel nearer, and a quarter of a voxel before those is too near.
        assert!(touches(&[dvec3(0.1, 0.1, 0.126)], 0.2));
        assert!(!touches(&[dvec3(0.1, 0.1, 0.124)], 0.2));
        // Points beside the grid: voxels extend to 0.35.
        assert!(touches(&[dvec3(0.374, 0.1, 0.4)], 0.2) && !touches(&[dvec3(0.376, 0.1, 0.4)], 0.2));
        // A wall point far away, which makes rounding in fp32 coarser.
        assert!(touches(&[dvec3(0.3755, 0.1, 0.4), dvec3(0.0, 1000.0, 0.0)], 0.2));
        assert!(touches(&[dvec3(f64::NAN, 0.0, 0.0)], 0.2), "a point that is no number proves nothing");
    }
}
