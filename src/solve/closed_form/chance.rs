//! What chance alone makes of a capture's photons: how much of a volume is noise.

use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use rayon::prelude::*;

use crate::capture::Capture;
use crate::transport::Grid;

/// Every photon counts as 1 or as -1, by a toss of a coin.
pub fn tossed(capture: &Capture) -> Capture {
    let mut tossed = capture.clone();
    tossed.histograms.par_chunks_exact_mut(capture.bins).enumerate().for_each(|(pair, counts)| {
        let mut coins = SmallRng::seed_from_u64(pair as u64);
        counts.iter_mut().for_each(|count| *count = toss(*count, &mut coins));
    });
    tossed
}

fn toss(count: f32, coins: &mut SmallRng) -> f32 {
    if count < 1.0 {
        return 0.0;
    }
    let mut rest = count as u64;
    if rest > 256 {
        return count.sqrt() * (coins.next_u64().count_ones() as f32 - 32.0) / 4.0;
    }
    let mut heads = 0;
    while rest > 0 {
        let n = rest.min(64);
        heads += (coins.next_u64() >> (64 - n)).count_ones() as u64;
        rest -= n;
    }
    2.0 * heads as f32 - count
}

/// Noise at every voxel.
pub struct Noise {
    pub scale: Vec<f32>,
    pub limit: f32,
}

pub fn noise(grid: &Grid, volume: &[f32]) -> Noise {
    let [nx, ny, nz] = grid.n;
    let r = std::env::var("TB_R").ok().and_then(|v| v.parse().ok()).unwrap_or(8usize);
    let (rx, ry) = ((nx / r).max(2), (ny / r).max(2));
    let mut square: Vec<f32> = volume.iter().map(|v| v * v).collect();
    let blur = |from: &[f32], n: usize, stride: usize, reach: usize, i: usize| -> f32 {
        let at = i / stride % n;
        let (lo, hi) = (at.saturating_sub(reach), (at + reach).min(n - 1));
        let base = i - at * stride;
        (lo..=hi).map(|k| from[base + k * stride]).sum::<f32>() / (hi - lo + 1) as f32
    };
    square = (0..square.len()).into_par_iter().map(|i| blur(&square, ny, nz, ry, i)).collect();
    square = (0..square.len()).into_par_iter().map(|i| blur(&square, nx, ny * nz, rx, i)).collect();
    let scale: Vec<f32> = square.iter().map(|v| v.sqrt()).collect();
    let mut most: Vec<f32> = volume
        .chunks(nz)
        .zip(scale.chunks(nz))
        .map(|(v, s)| v.iter().zip(s).map(|(v, s)| if *s > 0.0 { v / s } else { 0.0 }).fold(0.0, f32::max))
        .collect();
    most.sort_by(f32::total_cmp);
    let q = std::env::var("TB_Q").ok().and_then(|v| v.parse().ok()).unwrap_or(0.95f64);
    let limit = most[((most.len() - 1) as f64 * q) as usize];
    let of = |q: f64| most[((most.len() - 1) as f64 * q) as usize];
    eprintln!("limits {} {} {} {}", of(0.5), of(0.9), of(0.99), of(1.0));
    let k = std::env::var("TB_K").ok().and_then(|v| v.parse().ok()).unwrap_or(1.0f32);
    Noise { scale, limit: limit * k }
}
