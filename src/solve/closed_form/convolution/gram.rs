//! The response of the back-projection to a point, as one kernel for all places.
//!
//! Light of a voxel x falls on the same bins as light of a voxel x' as far as their paths agree. The sum of that over all
//! pairs is the Gram operator, G(x, x'). Divided by √(G(x, x) G(x', x')) it depends mostly on x − x'. So one kernel stands
//! for it: that of the two voxels x − x' apart whose middle is that of the volume. All of them lie inside the volume, so
//! the kernel has no cut edges; and it is the same for x − x' and x' − x.

use glam::DVec3;
use rayon::prelude::*;

use super::super::fourier::fast_length;
use crate::capture::Capture;
use crate::transport::{Grid, spread_order};

/// The kernel is that of so many pairs, spread over the wall: it is smooth.
const PAIRS: usize = 128;

/// Some of the pairs, by coordinates, metres.
pub(super) struct SomePairs {
    /// [laser, sensor][x, y, z][pair]
    at: [[Vec<f32>; 3]; 2],
    /// Width of a bin, metres of path.
    bin: f32,
    /// Whether the surface's cosine toward the wall counts, as in the back-projection.
    directed: bool,
}

impl SomePairs {
    /// The pairs that stand for all of a capture.
    pub fn of(capture: &Capture, directed: bool) -> SomePairs {
        let order = spread_order(&[&capture.laser, &capture.sensor]);
        let axis = |points: &[DVec3], axis: usize| -> Vec<f32> {
            order.iter().take(PAIRS).map(|pair| points[*pair][axis] as f32).collect()
        };
        let at = [&capture.laser, &capture.sensor].map(|points| [0, 1, 2].map(|a| axis(points, a)));
        SomePairs { at, bin: capture.bin_width as f32, directed }
    }

    fn count(&self) -> usize {
        self.at[0][0].len()
    }

    /// The path over a place, metres, and the weight of that place, for a pair.
    fn path(&self, pair: usize, place: [f32; 3]) -> [f32; 2] {
        let [laser, sensor] = [0, 1].map(|side| [0, 1, 2].map(|a| place[a] - self.at[side][a][pair]));
        let [a, b] = [laser, sensor].map(|way| (way[0] * way[0] + way[1] * way[1] + way[2] * way[2]).sqrt());
        [a + b, if self.directed { (laser[2] / a.max(1e-6)).max(0.0) } else { 1.0 }]
    }

    /// G(x, x) of a voxel in a place.
    fn of_itself(&self, place: [f32; 3]) -> f32 {
        let sum: f32 = (0..self.count()).map(|pair| self.path(pair, place)[1].powi(2)).sum();
        sum * shared(0.0)
    }

    /// G(x, x') of voxels in two places, over the root of G(x, x) G(x', x').
    fn normalised(&self, one: [f32; 3], other: [f32; 3]) -> f32 {
        let mut sums = [0.0f32; 3];
        for pair in 0..self.count() {
            let ([t, w], [u, v]) = (self.path(pair, one), self.path(pair, other));
            sums[0] += w * v * shared((t - u) / self.bin);
            sums[1] += w * w;
            sums[2] += v * v;
        }
        let both = (sums[1] * sums[2]).sqrt() * shared(0.0);
        if both > 0.0 { sums[0] / both } else { 0.0 }
    }
}

/// What two paths so many bins apart share, on average over the places of bins: both are spread over two bins, as wide
/// as the bins are. A cubic B-spline.
fn shared(apart: f32) -> f32 {
    let inside = |reach: f32| (reach - apart.abs()).max(0.0).powi(3);
    (inside(2.0) - 4.0 * inside(1.0)) / 6.0
}

/// √G(x, x) of every voxel, `[(x * n[1] + y) * n[2] + z]`, over its largest.
pub(super) fn scale(pairs: &SomePairs, grid: &Grid) -> Vec<f32> {
    let [_, ny, nz] = grid.n;
    let of = |i: usize| {
        let at = DVec3::new((i / (ny * nz)) as f64, (i / nz % ny) as f64, (i % nz) as f64);
        pairs.of_itself(grid.position(at).to_array().map(|v| v as f32)).sqrt()
    };
    let mut all: Vec<f32> = (0..grid.voxels()).into_par_iter().map(of).collect();
    let most = all.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    all.iter_mut().for_each(|v| *v /= most);
    all
}

/// Lengths of transforms in which nothing comes back on the other side.
pub(super) fn lengths(grid: &Grid) -> [usize; 3] {
    grid.n.map(|n| fast_length(2 * n - 1))
}

/// The kernel at offsets along x and y that are wrapped to the transforms' lengths, and along z from 0 on:
/// `[(x * lengths[1] + y) * n[2] + z]`. At an offset of the other sign along z it is that of the opposite offset.
pub(super) fn kernel(pairs: &SomePairs, grid: &Grid) -> Vec<f32> {
    let ([lx, ly, _], nz) = (lengths(grid), grid.n[2]);
    let middle = grid.position(0.5 * DVec3::from(grid.n.map(|n| (n - 1) as f64)));
    let signed = |i: usize, length: usize, n: usize| -> Option<f64> {
        if i < n { Some(i as f64) } else { (length - i < n).then(|| -((length - i) as f64)) }
    };
    let mut all = vec![0.0; lx * ly * nz];
    all.par_chunks_mut(nz).enumerate().for_each(|(i, column)| {
        let (Some(x), Some(y)) = (signed(i / ly, lx, grid.n[0]), signed(i % ly, ly, grid.n[1])) else {
            return;
        };
        for (z, value) in column.iter_mut().enumerate() {
            let half = 0.5 * DVec3::new(x, y, z as f64) * grid.pitch;
            let [one, other] = [middle + half, middle - half].map(|p| p.to_array().map(|v| v as f32));
            *value = pairs.normalised(one, other);
        }
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Volume;
    use glam::dvec3;

    /// SomePairs of laser and sensor points on a wall, and a small volume before it.
    fn scene(confocal: bool) -> (Capture, Grid) {
        let points: Vec<DVec3> = (0..36)
            .map(|i| dvec3(-0.3 + 0.12 * f64::from(i / 6), -0.3 + 0.12 * f64::from(i % 6), 0.01))
            .collect();
        let laser = if confocal { points.clone() } else { vec![dvec3(0.1, -0.2, 0.01); 36] };
        let capture = Capture::new([6, 6], laser, points, 100, 0.02, vec![0.0; 3600]);
        let volume = Volume { min: dvec3(-0.1, -0.1, 0.5), max: dvec3(0.1, 0.1, 0.6) };
        (capture, Grid::new(volume, 3, 0.025).unwrap())
    }

    /// The Gram operator in float64, as the product of a matrix with its transpose: a row for each pair and each of many
    /// places of a bin's edge, with a voxel's light spread over the two bins whose centres bracket its path.
    fn by_definition(capture: &Capture, grid: &Grid) -> Vec<Vec<f64>> {
        const PLACES: usize = 32;
        let [_, ny, nz] = grid.n;
        let mut columns = vec![];
        for i in 0..grid.voxels() {
            let at = grid.position(dvec3((i / (ny * nz)) as f64, (i / nz % ny) as f64, (i % nz) as f64));
            let mut column = std::collections::HashMap::new();
            for (pair, (laser, sensor)) in capture.laser.iter().zip(&capture.sensor).enumerate() {
                let way = at - *laser;
                let path = way.length() + (at - *sensor).length();
                for place in 0..PLACES {
                    let bins = path / capture.bin_width + place as f64 / PLACES as f64;
                    for (bin, share) in [(0, 1.0 - bins.fract()), (1, bins.fract())] {
                        let row = (pair, place, bins as usize + bin);
                        *column.entry(row).or_insert(0.0) += way.z / way.length() * share;
                    }
                }
            }
            columns.push(column);
        }
        let product = |a: &std::collections::HashMap<_, f64>, b: &std::collections::HashMap<_, f64>| -> f64 {
            a.iter().filter_map(|(row, value)| Some(value * b.get(row)?)).sum::<f64>() / PLACES as f64
        };
        columns.iter().map(|a| columns.iter().map(|b| product(a, b)).collect()).collect()
    }

    #[test]
    fn diagonal_and_kernel_are_those_of_the_gram_operator() {
        for confocal in [true, false] {
            let (capture, grid) = scene(confocal);
            let pairs = SomePairs::of(&capture, true);
            let gram = by_definition(&capture, &grid);
            let scale = scale(&pairs, &grid);
            let most = gram.iter().enumerate().map(|(i, row)| row[i]).fold(0.0, f64::max);
            for (i, row) in gram.iter().enumerate() {
                assert!((f64::from(scale[i]) - (row[i] / most).sqrt()).abs() < 5e-4, "{i}");
            }
            let ([_, ny, nz], [lx, ly, _]) = (grid.n, lengths(&grid));
            let kernel = kernel(&pairs, &grid);
            let (mut off, mut count) = (0.0, 0);
            for (i, row) in gram.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    let apart = |i: usize, j: usize, length: usize| (length + i - j) % length;
                    let (a, b) = ([i / (ny * nz), i / nz % ny, i % nz], [j / (ny * nz), j / nz % ny, j % nz]);
                    if a[2] < b[2] {
                        continue;
                    }
                    let at = (apart(a[0], b[0], lx) * ly + apart(a[1], b[1], ly)) * nz + a[2] - b[2];
                    let normalised = value / (row[i] * gram[j][j]).sqrt();
                    // Exact for voxels on both sides of the middle, an approximation for others.
                    let difference = (f64::from(kernel[at]) - normalised).abs();
                    if (0..3).all(|axis| a[axis] + b[axis] == grid.n[axis] - 1) {
                        assert!(difference < 1e-3, "{a:?} {b:?}: {} {normalised}", kernel[at]);
                    }
                    (off, count) = (off + difference, count + 1);
                }
            }
            assert!(off / f64::from(count) < 0.03, "{confocal}: {}", off / f64::from(count));
        }
    }
}
