//! Averages over the surroundings of pixels, by an edge-stopping Gaussian. All columns of a layer are handled as a dense map, a
//! run of columns at once: a column without a pixel has no value, and a depth over which no bond is left.

use rayon::prelude::*;

use super::Real;
use super::pixels::{PixelField, stops};

/// Columns along y that are averaged together.
pub const RUN: usize = 16;

/// Depth beside the maps, metres, as of a column without a pixel (FAR in solve/surface/schedule.rs).
const FAR: f64 = 1e6;

/// Values of all columns, with a rim that makes tests of range unnecessary: [layer and x][y].
struct Rimmed<F> {
    values: Vec<F>,
    rim: usize,
    n: [usize; 2],
}

impl<F: Real> Rimmed<F> {
    /// `of` every column of `layers` layers of n columns, and `beside` the maps.
    fn new(n: [usize; 2], layers: usize, rim: usize, beside: F, of: impl Fn(usize) -> F + Sync) -> Rimmed<F> {
        let mut made = Rimmed { values: vec![], rim, n };
        let width = made.width();
        made.values = vec![beside; layers * (n[0] + 2 * rim) * width];
        made.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
            let (layer, x) = (row / (n[0] + 2 * rim), (row % (n[0] + 2 * rim)).wrapping_sub(rim));
            if x < n[0] {
                let from = (layer * n[0] + x) * n[1];
                values[rim..rim + n[1]].iter_mut().enumerate().for_each(|(y, value)| *value = of(from + y));
            }
        });
        made
    }

    /// Values of a row: those of all runs, and the rim on both sides.
    fn width(&self) -> usize {
        self.n[1].next_multiple_of(RUN) + 2 * self.rim
    }

    /// The run of columns that begins `rim` before (layer, x + dx - rim, y + dy).
    #[inline(always)]
    fn run(&self, [layer, x, y]: [usize; 3], [dx, dy]: [usize; 2]) -> &[F] {
        let row = layer * (self.n[0] + 2 * self.rim) + x + dx;
        &self.values[row * self.width() + y + dy..][..RUN]
    }
}

/// Surroundings of pixels that a Gaussian covers.
pub struct Surroundings<F> {
    n: [usize; 2],
    layers: usize,
    reach: usize,
    /// Of the Gaussian, [x][y] from - reach.
    weights: Vec<F>,
    depths: Rimmed<F>,
    edge: F,
}

impl<F: Real> Surroundings<F> {
    /// Those within two `sigma` pixels. `depths`: of all columns, for the bonds.
    pub fn new(field: &PixelField<'_, F>, sigma: f64, depths: impl Fn(usize) -> F + Sync) -> Surroundings<F> {
        // The margin keeps rounding of sigma from adding a pixel.
        let reach = (2.0 * sigma - 1e-3).ceil() as usize;
        let narrow = 0.5 / (sigma * sigma);
        let off = |i: usize| (i as f64 - reach as f64).powi(2);
        let weight =
            |i: usize| F::of((-narrow * (off(i / (2 * reach + 1)) + off(i % (2 * reach + 1)))).exp());
        let n = [field.grid.n[0], field.grid.n[1]];
        let last = field.pixels.iter().max().map_or(0, |column| *column as usize);
        let layers = last / field.of_layer() + 1;
        Surroundings {
            n,
            layers,
            reach,
            weights: (0..(2 * reach + 1).pow(2)).map(weight).collect(),
            depths: Rimmed::new(n, layers, reach, F::of(FAR), depths),
            edge: field.edge(),
        }
    }

    /// Sums of weights around every column.
    pub fn weights(&self) -> Vec<F> {
        self.sums(None).into_iter().map(|[sum, _]| sum).collect()
    }

    /// Sums of weights times two values of every column, which are zero where it has no pixel.
    pub fn averages(&self, values: impl Fn(usize) -> [F; 2] + Sync) -> Vec<[F; 2]> {
        let rimmed =
            |k: usize| Rimmed::new(self.n, self.layers, self.reach, F::zero(), |column| values(column)[k]);
        self.sums(Some(&[rimmed(0), rimmed(1)]))
    }

    fn sums(&self, values: Option<&[Rimmed<F>; 2]>) -> Vec<[F; 2]> {
        let [nx, ny] = self.n;
        let mut all = vec![[F::zero(); 2]; self.layers * nx * ny];
        all.par_chunks_mut(ny).enumerate().for_each(|(row, out)| {
            for (i, out) in out.chunks_mut(RUN).enumerate() {
                let at = [row / nx, row % nx, i * RUN];
                let run = ColumnRun { around: self, values, at };
                let [first, second] = pulp::Arch::new().dispatch(run);
                out.iter_mut().zip(first.into_iter().zip(second)).for_each(|(out, (a, b))| *out = [a, b]);
            }
        });
        all
    }
}

/// The sums around a run of columns.
struct ColumnRun<'r, F> {
    around: &'r Surroundings<F>,
    values: Option<&'r [Rimmed<F>; 2]>,
    at: [usize; 3],
}

impl<F: Real> pulp::WithSimd for ColumnRun<'_, F> {
    type Output = [[F; RUN]; 2];

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> [[F; RUN]; 2] {
        let ColumnRun { around, values, at } = self;
        let side = 2 * around.reach + 1;
        let mut sums = [[F::zero(); RUN]; 2];
        let own = around.depths.run(at, [around.reach; 2]);
        for (i, weight) in around.weights.iter().enumerate() {
            let d = [i / side, i % side];
            let depths = around.depths.run(at, d);
            match values {
                None => {
                    for j in 0..RUN {
                        sums[0][j] = sums[0][j] + *weight * stops(depths[j] - own[j], around.edge);
                    }
                }
                Some([first, second]) => {
                    let (first, second) = (first.run(at, d), second.run(at, d));
                    for j in 0..RUN {
                        let bond = *weight * stops(depths[j] - own[j], around.edge);
                        sums[0][j] = sums[0][j] + bond * first[j];
                        sums[1][j] = sums[1][j] + bond * second[j];
                    }
                }
            }
        }
        sums
    }
}
