use rayon::prelude::*;

use super::domain::Slots;
use super::shared::*;
use super::surface::elu;
use super::{BRICK_VOXELS, Call, Cells, SceneGrid, Real, larger, voxel};

/// Voxels of a brick at one position along an axis.
const ACROSS: usize = 64;

/// One axis of the separable Gaussian, zero outside the grid. The first reads the active voxels' albedo: raw, or after ELU
/// with a noise term. The last keeps the maximum. A line of bricks along the axis is one task.
pub fn gaussian<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: taps f, raw v4, mask u, source f, smoothed f, counts u, ranks u, levels u);
    let (grid, axis) = (call.grid::<F>(), call.constant("AXIS", 0) as usize);
    if axis == 0 {
        levels.fill(0);
        counts[COUNT_PEAK_SMOOTH as usize] = 0;
        counts[COUNT_LEAST_SMOOTH as usize] = 0;
    }
    let has_noise = call.paper.noise_base + call.paper.noise_span > 0.0;
    let slots = Slots { mask, ranks, room: call.scene.capacity };
    let value = |index: usize| {
        let albedo = |slot: usize| if has_noise { elu(raw[slot][0]) } else { raw[slot][0] };
        if axis > 0 { source[index] } else { slots.of(index).map_or(F::zero(), albedo) }
    };
    let smooth = Smooth { grid, axis, taps: &taps[1..taps[0].wide() as usize + 2] };
    let lines = smooth.lines(smoothed).into_par_iter();
    let peaks = lines.map_init(
        || smooth.scratch(),
        |dense, mut line| {
            pulp::Arch::new().dispatch(
                #[inline(always)]
                || smooth.line(&mut line, dense, value),
            )
        },
    );
    let peak = peaks.reduce(F::zero, F::at_least);
    if axis == 2 {
        counts[COUNT_PEAK_SMOOTH as usize] = larger(counts[COUNT_PEAK_SMOOTH as usize], peak);
    }
}

struct Smooth<'t, F> {
    grid: SceneGrid<F>,
    axis: usize,
    /// Weights at 0, 1, 2, ... voxels to either side.
    taps: &'t [F],
}

impl<F: Real> Smooth<'_, F> {
    /// The bricks of each line along the axis, in order, with their numbers.
    fn lines<'o>(&self, out: &'o mut [F]) -> Vec<Vec<(usize, &'o mut [F])>> {
        let [nx, ny, nz] = self.grid.bricks;
        let mut lines: Vec<Vec<_>> = vec![];
        lines.resize_with([ny * nz, nx * nz, nx * ny][self.axis], Vec::new);
        for (brick, out) in out[..self.grid.storage()].chunks_mut(BRICK_VOXELS).enumerate() {
            let [x, y, z] = [brick % nx, brick / nx % ny, brick / (nx * ny)];
            lines[[z * ny + y, z * nx + x, y * nx + x][self.axis]].push((brick, out));
        }
        lines
    }

    /// The values of a line, `[position along the axis][place across]`, with zeros for the reach of the taps at both ends.
    fn scratch(&self) -> Vec<[F; ACROSS]> {
        vec![[F::zero(); ACROSS]; self.grid.bricks[self.axis] * 8 + 2 * (self.taps.len() - 1)]
    }

    /// Smooths a line. Returns the largest value.
    #[inline(always)]
    fn line(&self, line: &mut [(usize, &mut [F])], dense: &mut [[F; ACROSS]], value: impl Fn(usize) -> F) -> F {
        let (reach, places) = (self.taps.len() - 1, self.places());
        for (k, (brick, _)) in line.iter().enumerate() {
            for (i, [along, across]) in places.iter().enumerate() {
                dense[reach + 8 * k + along][*across] = value(brick * BRICK_VOXELS + i);
            }
        }
        let mut largest = F::zero();
        for (k, (brick, out)) in line.iter_mut().enumerate() {
            let mut sums = [[F::zero(); ACROSS]; 8];
            for (along, sums) in sums.iter_mut().enumerate() {
                for (t, from) in dense[8 * k + along..][..2 * reach + 1].iter().enumerate() {
                    let tap = self.taps[t.abs_diff(reach)];
                    sums.iter_mut().zip(from).for_each(|(sum, v)| *sum = *sum + tap * *v);
                }
            }
            for (i, [along, across]) in places.iter().enumerate() {
                let is_inside = self.grid.contains(self.grid.voxel(*brick * BRICK_VOXELS + i));
                out[i] = if is_inside { sums[*along][*across] } else { F::zero() };
                largest = largest.at_least(out[i]);
            }
        }
        largest
    }

    /// Position of each voxel of a brick along the axis, and its place across.
    fn places(&self) -> [[usize; 2]; BRICK_VOXELS] {
        let mut next = [0; 8];
        std::array::from_fn(|i| {
            let along = voxel([1; 3], i)[self.axis];
            next[along] += 1;
            [along, next[along] - 1]
        })
    }
}
