//! The limits of the host's processors, measured on all threads of the pool by loops that do one thing each.

use std::hint::black_box;
use std::time::Instant;

use pulp::{Simd, WithSimd};

/// Runs of a measurement, and the least seconds that a run takes.
const RUNS: usize = 8;
const LONG_ENOUGH: f64 = 0.005;
/// Chains of multiply-adds: latency times units of today's processors is 8 to 10.
const CHAINS: usize = 12;
/// Turns of a chain in a unit of work.
const TURNS: usize = 1 << 12;
/// Sums of loads side by side.
const SUMS: usize = 8;
/// Bytes beyond every cache, of all threads together.
pub const BEYOND: u64 = 256 << 20;
/// Bins of a histogram, and additions to it in a unit of work.
const BINS: usize = 512;
const ADDITIONS: usize = 1 << 12;

/// Multiply-adds per second.
pub fn multiply_adds() -> f64 {
    rate(|| (), |()| pulp::Arch::new().dispatch(MultiplyAdd))
}

/// Additions to histograms per second.
pub fn additions() -> f64 {
    rate(Histogram::new, Histogram::add)
}

/// Bytes per second of loads from a working set of `bytes` bytes of all threads together.
pub fn loads(bytes: u64) -> f64 {
    let numbers = bytes as usize / size_of::<f32>() / rayon::current_num_threads();
    rate(|| vec![1.0f32; numbers.max(1)], |own| pulp::Arch::new().dispatch(Loads(own)))
}

/// Operations per second: the sum of the best of several runs on each thread, while the others run, too. `work` returns the
/// operations of a unit of work.
fn rate<T>(state: impl Fn() -> T + Sync, work: impl Fn(&mut T) -> usize + Sync) -> f64 {
    let of_thread = rayon::broadcast(|_| {
        let mut own = state();
        let mut run = |units: usize| {
            let start = Instant::now();
            let done: usize = (0..units).map(|_| work(&mut own)).sum();
            (done as f64, start.elapsed().as_secs_f64())
        };
        let mut units = 1;
        while run(units).1 < LONG_ENOUGH {
            units *= 2;
        }
        (0..RUNS).map(|_| run(units)).map(|(done, seconds)| done / seconds).fold(0.0, f64::max)
    });
    of_thread.into_iter().sum()
}

/// Multiply-adds in registers.
struct MultiplyAdd;

impl WithSimd for MultiplyAdd {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let (factor, term) = (simd.splat_f32s(black_box(0.5)), simd.splat_f32s(black_box(1.0)));
        let mut chains = [simd.splat_f32s(0.0); CHAINS];
        for _ in 0..TURNS {
            for chain in &mut chains {
                *chain = simd.mul_add_f32s(*chain, factor, term);
            }
        }
        black_box(chains.map(|chain| simd.reduce_sum_f32s(chain)));
        TURNS * CHAINS * size_of::<S::f32s>() / size_of::<f32>()
    }
}

/// Loads of all numbers.
struct Loads<'n>(&'n [f32]);

impl WithSimd for Loads<'_> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let (vectors, _) = S::as_simd_f32s(black_box(self.0));
        let mut sums = [simd.splat_f32s(0.0); SUMS];
        for several in vectors.chunks_exact(SUMS) {
            for (sum, vector) in sums.iter_mut().zip(several) {
                *sum = simd.add_f32s(*sum, *vector);
            }
        }
        black_box(sums.map(|sum| simd.reduce_sum_f32s(sum)));
        vectors.len() / SUMS * SUMS * size_of::<S::f32s>()
    }
}

/// A histogram, and the bins of photons in no order.
struct Histogram {
    bins: [f32; BINS],
    places: Vec<u16>,
}

impl Histogram {
    fn new() -> Histogram {
        // A multiplicative sequence visits the bins in no order.
        let places = (0..ADDITIONS as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 23) as u16).collect();
        Histogram { bins: [0.0; BINS], places }
    }

    fn add(&mut self) -> usize {
        for place in &self.places {
            self.bins[usize::from(*place) % BINS] += 1.0;
        }
        black_box(&self.bins);
        self.places.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_loop_does_the_work_that_it_counts() {
        let all = pulp::Arch::new().dispatch(MultiplyAdd);
        assert!(all.is_multiple_of(TURNS * CHAINS) && all > 0);
        let numbers = vec![1.0f32; 4096];
        assert_eq!(pulp::Arch::new().dispatch(Loads(&numbers)), 4 * 4096);
        let mut histogram = Histogram::new();
        assert_eq!((histogram.add(), histogram.add()), (ADDITIONS, ADDITIONS));
        assert_eq!(histogram.bins.iter().sum::<f32>(), 2.0 * ADDITIONS as f32);
        assert!(histogram.bins.iter().all(|bin| *bin > 0.0), "all bins are reached");
    }

    #[test]
    fn caches_are_not_slower_than_memory() {
        assert!(multiply_adds() > 1e8 && additions() > 1e6);
        let [near, far] = [1 << 16, BEYOND].map(loads);
        assert!(near > 0.5 * far, "{near} and {far} bytes a second");
    }
}
