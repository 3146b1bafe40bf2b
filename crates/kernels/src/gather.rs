//! Gradients at samples, gathered over pairs from their residuals.

use rayon::prelude::*;

use super::light::{
    COSINE, Ends, LAMBERTIAN, LANES, LightArm, LightNumbers, Loop, PLAIN, PairView, SampleBlock, WallLight,
    convert, place,
};
use super::shared::BACKWARD_CONTINUE;
use super::{Call, Real};

/// Sums over pairs at the samples of a block, component by component.
pub struct GradientSums<A> {
    /// By albedo; without cosines only.
    pub albedo: [A; LANES],
    /// By albedo times normal.
    pub vector: [[A; LANES]; 3],
    /// By depth.
    pub depth: [A; LANES],
}

/// Gathers over the pairs of a dispatch, a task for each block of samples. Writes what `shown` makes of a lane's sums, by cosines
/// and block, to `gradient`, or adds it there where the dispatch continues. `exact`: values include the falloff.
pub fn gather<F: Real, A: Real>(
    call: &Call<'_>,
    exact: bool,
    [points, normals]: [&[[F; 4]]; 2],
    [wall, residual]: [&[F]; 2],
    gradient: &mut [[F; 4]],
    shown: impl Fn(u32, &SampleBlock<A>, &GradientSums<A>, usize) -> [A; 4] + Sync,
) {
    let light = WallLight::<F, A>::of(call, wall.as_chunks().0);
    let blocks = SampleBlock::<A>::all(points, normals);
    let goes_on = call.push.flags & BACKWARD_CONTINUE != 0;
    blocks.par_iter().zip(gradient.par_chunks_mut(LANES)).for_each(|(block, out)| {
        let mut sums = GradientSums {
            albedo: [A::zero(); LANES],
            vector: [[A::zero(); LANES]; 3],
            depth: [A::zero(); LANES],
        };
        light.run(OverPairs { call, exact, light: &light, block, residual, sums: &mut sums });
        for (j, out) in out.iter_mut().enumerate() {
            let before = if goes_on { *out } else { [F::zero(); 4] };
            let sum = shown(light.cosines, block, &sums, j);
            *out = std::array::from_fn(|k| before[k] + convert(sum[k]));
        }
    });
}

/// Adds all pairs of a dispatch to the sums of a block.
struct OverPairs<'r, 'w, F, A> {
    call: &'r Call<'r>,
    exact: bool,
    light: &'r WallLight<'w, F, A>,
    block: &'r SampleBlock<A>,
    residual: &'r [F],
    sums: &'r mut GradientSums<A>,
}

impl<F: Real, A: Real> Loop for OverPairs<'_, '_, F, A> {
    #[inline(always)]
    fn run<const COSINES: u32, const TWO: bool>(self) {
        let OverPairs { call, exact, light, block: b, residual, sums } = self;
        let mut arms = [[[A::zero(); LANES]; 4]; 2];
        let (mut cells, mut shares) = ([0u32; LANES], [A::zero(); LANES]);
        let mut around = [[A::zero(); 2]; LANES];
        let stride = call.stride();
        for pair in call.push.first..call.push.last {
            let ends = light.ends(pair as usize);
            let term = Term { exact, numbers: &light.numbers, ends: &ends, block: b };
            for j in 0..LANES {
                let first = LightArm::new(b, j, ends.points[0], &light.numbers);
                let second = if TWO { LightArm::new(b, j, ends.points[1], &light.numbers) } else { first };
                (cells[j], shares[j]) = place(first.distance + second.distance, &light.numbers);
                first.keep(&mut arms[0], j);
                if TWO {
                    second.keep(&mut arms[1], j);
                }
            }
            let row = &residual[pair as usize * stride..][..stride + 2];
            for j in 0..LANES {
                let [low, high] = row[cells[j] as usize..][..2] else { unreachable!("two cells") };
                around[j] = [convert(low), convert(high)];
            }
            for j in 0..LANES {
                let [low, high] = around[j];
                let rise = high - low;
                let first = LightArm::kept(&arms[0], j, &light.numbers);
                let second = if TWO { LightArm::kept(&arms[1], j, &light.numbers) } else { first };
                let seen = PairView::<A, COSINES, TWO>::by([first, second], b, j, &ends);
                term.add(&seen, j, [low + shares[j] * rise, rise], sums);
            }
        }
    }
}

/// A pair's part of the sums of a block.
struct Term<'t, A> {
    exact: bool,
    numbers: &'t LightNumbers<A>,
    ends: &'t Ends<A>,
    block: &'t SampleBlock<A>,
}

impl<A: Real> Term<'_, A> {
    /// Adds the pair as lane `j` sees it, with the residual `r` at its path and its `rise` per bin: the product rule over the
    /// factors of the pair's value.
    #[inline(always)]
    fn add<const COSINES: u32, const TWO: bool>(
        &self,
        seen: &PairView<A, COSINES, TWO>,
        j: usize,
        [r, rise]: [A; 2],
        sums: &mut GradientSums<A>,
    ) {
        let zero = A::zero();
        let [first, second] = seen.arms;
        let falloff = if self.exact { seen.falloff } else { A::one() };
        let (cosines, lit) = (seen.cosines(), r * falloff);
        let shown = if cosines > zero { lit } else { zero };
        if COSINES == PLAIN {
            sums.albedo[j] = sums.albedo[j] + lit;
        }
        // By the normal; and by depth through the directions of the arms, without the falloff.
        let turned = |arm: &LightArm<A>, cosine: A, normal: A| (cosine * arm.toward.z - normal) * arm.inverse;
        let normal_z = self.block.normal[2][j];
        let [a, c] = seen.surface;
        let mut turns = zero;
        if COSINES == COSINE {
            turns = turned(&first, a, normal_z);
            for (k, toward) in [first.toward.x, first.toward.y, first.toward.z].into_iter().enumerate() {
                sums.vector[k][j] = sums.vector[k][j] + shown * toward;
            }
        }
        if COSINES == LAMBERTIAN {
            let walls = seen.wall[0] * seen.wall[1];
            let at_surface = turned(&first, a, normal_z) * c + a * turned(&second, c, normal_z);
            let at_wall = |k: usize| turned(&seen.arms[k], seen.wall[k], -self.ends.normals[k].z);
            turns = walls * at_surface + (at_wall(0) * seen.wall[1] + seen.wall[0] * at_wall(1)) * (a * c);
            let toward = [first.toward, second.toward].map(|t| [t.x, t.y, t.z]);
            for (k, sums) in sums.vector.iter_mut().enumerate() {
                let slope = c * toward[0][k] + a * toward[1][k] - a * c * self.block.normal[k][j];
                sums[j] = sums[j] + shown * walls * slope;
            }
        }
        let steep = first.toward.z + second.toward.z;
        let power = if self.numbers.retro { A::one() } else { A::one() + A::one() };
        let falls = power * (first.toward.z * first.inverse + second.toward.z * second.inverse);
        let longer = -steep * self.numbers.bins_per_metre;
        let by_value = falls * cosines + if cosines > zero { turns } else { zero };
        sums.depth[j] = sums.depth[j] + (lit * by_value + rise * falloff * cosines * longer);
    }
}
