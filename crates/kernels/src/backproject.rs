use rayon::prelude::*;

use super::light::{SampleBlock, Ends, LANES, WallLight, Loop, PairView, PLAIN, convert, place};
use super::shared::*;
use super::{Call, Cells, Real};

/// Back-projects filtered histograms into every voxel that is not too near, with the cosine of a surface that faces the
/// wall and no falloff. Spots count as points. A block of voxels is one task.
pub fn backproject<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: _1 any, _2 any, projected f; wall f, residual f);
    let projected = &mut projected[..call.grid::<F>().storage()];
    with_arithmetic!(call, F, voxels(call, [wall, residual], projected));
}

fn voxels<F: Real, A: Real>(call: &Call<'_>, [wall, residual]: [&[F]; 2], projected: &mut [F]) {
    let (grid, light) = (call.grid::<A>(), WallLight::<F, A>::of(call, wall.as_chunks().0));
    let goes_on = call.push.flags & BACKWARD_CONTINUE != 0;
    projected.par_chunks_mut(LANES).enumerate().for_each(|(i, out)| {
        let inside = |j: usize| grid.may_be_active(grid.voxel(i * LANES + j));
        let mut sums = [A::zero(); LANES];
        if (0..out.len()).any(inside) {
            let points: [[A; 4]; LANES] = std::array::from_fn(|j| {
                let c = grid.voxel(i * LANES + j).map(|c| A::of(c as f64));
                grid.position(super::V3 { x: c[0], y: c[1], z: c[2] }).with(A::one())
            });
            let block = SampleBlock::all(&points, &[]).remove(0);
            light.run(Project { call, light: &light, block: &block, residual, sums: &mut sums });
        }
        for (j, (out, sum)) in out.iter_mut().zip(&sums).enumerate() {
            let before = if goes_on { *out } else { F::zero() };
            *out = before + if inside(j) { convert(*sum) } else { F::zero() };
        }
    });
}

/// Adds the residuals of all pairs of a dispatch to the sums of a block.
struct Project<'r, 'w, F, A> {
    call: &'r Call<'r>,
    light: &'r WallLight<'w, F, A>,
    block: &'r SampleBlock<A>,
    residual: &'r [F],
    sums: &'r mut [A; LANES],
}

impl<F: Real, A: Real> Loop for Project<'_, '_, F, A> {
    #[inline(always)]
    fn run<const COSINES: u32, const TWO: bool>(self) {
        let Project { call, light, block: b, residual, sums } = self;
        let (mut cells, mut shares, mut cosines) = ([0u32; LANES], [A::zero(); LANES], [A::one(); LANES]);
        let stride = call.stride();
        for pair in call.push.first..call.push.last {
            let ends: Ends<A> = light.ends(pair as usize);
            for j in 0..LANES {
                let seen = PairView::<A, PLAIN, TWO>::new(b, j, &ends, &light.numbers);
                (cells[j], shares[j]) = place(seen.metres(), &light.numbers);
                if COSINES != PLAIN {
                    cosines[j] = (-seen.arms[0].toward.z).at_least(A::zero());
                }
            }
            let row = &residual[pair as usize * stride..][..stride + 2];
            for j in 0..LANES {
                let [low, high] = row[cells[j] as usize..][..2] else { unreachable!("two cells") };
                let low: A = convert(low);
                sums[j] = sums[j] + cosines[j] * (low + shares[j] * (convert::<F, A>(high) - low));
            }
        }
    }
}
