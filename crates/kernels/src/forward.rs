use rayon::prelude::*;

use super::arguments::chunks;
use super::light::{SampleBlock, Ends, LANES, WallLight, Loop, LightNumbers, PairView, convert, place};
use super::shared::{COUNT_ACTIVE, PADDING};
use super::{Call, Cells, Real};

/// Renders the samples of a dispatch into the histograms. A pair is one task.
pub fn forward<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, points v4, normals v4, histograms f, wall v4);
    let active = counts[COUNT_ACTIVE as usize];
    let [_, chunk, of_set] = chunks(call, active);
    let at = |chunks: u32| chunks.saturating_mul(chunk).min(active) as usize;
    let slots = at(call.push.first)..at(call.push.first + of_set);
    let normals = normals.get(slots.clone()).unwrap_or_default();
    with_arithmetic!(call, F, render(call, &points[slots], normals, wall, histograms));
}

fn render<F: Real, A: Real>(
    call: &Call<'_>,
    points: &[[F; 4]],
    normals: &[[F; 4]],
    wall: &[[F; 4]],
    histograms: &mut [F],
) {
    let light = WallLight::<F, A>::of(call, wall);
    let blocks = SampleBlock::<A>::all(points, normals);
    let (stride, pairs) = (call.stride(), call.scene.pairs as usize);
    // Sums by place, of its cell and of the next one: one addition for both.
    let scratch = || vec![[A::zero(); 2]; stride + 1];
    histograms[PADDING as usize..].par_chunks_mut(stride).take(pairs).enumerate().for_each_init(scratch, |row, (pair, to)| {
        row.fill([A::zero(); 2]);
        light.run(RenderPair { numbers: &light.numbers, ends: light.ends(pair), blocks: &blocks, row });
        let around = row[PADDING as usize - 1..stride].windows(2);
        to.iter_mut().zip(around).for_each(|(to, sums)| *to = *to + convert(sums[0][1] + sums[1][0]));
    });
}

/// Adds the light of all samples to a pair's row.
struct RenderPair<'r, A> {
    numbers: &'r LightNumbers<A>,
    ends: Ends<A>,
    blocks: &'r [SampleBlock<A>],
    row: &'r mut [[A; 2]],
}

impl<A: Real> Loop for RenderPair<'_, A> {
    #[inline(always)]
    fn run<const COSINES: u32, const TWO: bool>(self) {
        let mut cells = [0u32; LANES];
        let mut values = [[A::zero(); 2]; LANES];
        for b in self.blocks {
            for j in 0..LANES {
                let (value, metres) = PairView::<A, COSINES, TWO>::new(b, j, &self.ends, self.numbers).light(b, j);
                let (cell, share) = place(metres, self.numbers);
                let later = value * share;
                cells[j] = cell;
                values[j] = [value - later, later];
            }
            for (cell, [low, high]) in cells.iter().zip(&values) {
                let sums = &mut self.row[*cell as usize];
                *sums = [sums[0] + *low, sums[1] + *high];
            }
        }
    }
}
