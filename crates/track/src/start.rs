//! Starts of a fit: a matched filter over a coarse grid of the box.

use glam::DVec3;
use rayon::prelude::*;

use crate::blob::Blob;
use crate::constants::{EXTENT, NODES, ROUNDNESS, STARTS};
use crate::information::Blobs;
use crate::sight::Sight;

/// Least distance between starts, steps of the grid.
const APART: f64 = 2.5;
/// Deviation of the filter from its node, in steps of the grid.
const WIDTH: f64 = 0.6;

/// Pairs that a start looks at, at most, evenly over all; with more of them than `CLEAR` few starts are needed.
const PAIRS: usize = 49;
const CLEAR: usize = 64;
const FEW: usize = 3;

/// Residuals and variances, filtered along the path: `[row * bins + bin]`.
struct FilteredPaths {
    /// The pair of each row.
    pairs: Vec<usize>,
    /// Residual in units of its variance, times the filter.
    light: Vec<f64>,
    /// Squares of the filter, over the variance.
    weight: Vec<f64>,
}

/// Blobs that explain most of the residual of a guess, the best first.
pub fn starts(sight: &Sight, guess: &Blobs, [low, high]: [DVec3; 2]) -> Vec<Blob> {
    let size = high - low;
    let step = size.max_element() / NODES;
    let nodes = (size / step).ceil().max(DVec3::ONE).as_usizevec3();
    let pitch = size / nodes.as_dvec3();
    let filtered = filtered(sight, guess, 2.0 * WIDTH * step / sight.width);
    let place = |x: usize, y: usize, z: usize| low + pitch * (DVec3::new(x as f64, y as f64, z as f64) + 0.5);
    let slice = |z: usize| {
        let all = (0..nodes.y).flat_map(|y| (0..nodes.x).map(move |x| (x, y)));
        all.map(|(x, y)| score(sight, &filtered, place(x, y, z))).collect::<Vec<_>>()
    };
    let scores: Vec<[f64; 2]> = (0..nodes.z).into_par_iter().flat_map_iter(slice).collect();
    let mut order: Vec<usize> = (0..scores.len()).filter(|at| scores[*at][0] > 0.0).collect();
    order.sort_by(|a, b| scores[*b][0].total_cmp(&scores[*a][0]));
    let most = if sight.pairs() > CLEAR { FEW } else { STARTS };
    let mut found: Vec<Blob> = vec![];
    for at in order {
        let here = place(at % nodes.x, at / nodes.x % nodes.y, at / nodes.x / nodes.y);
        if found.iter().all(|other| other.at.distance(here) > APART * step) {
            found.push(Blob {
                at: here,
                light: scores[at][1].max(1e-6).ln(),
                extent: (EXTENT[0] * sight.unit).ln(),
                roundness: ROUNDNESS[0],
            });
        }
        if found.len() == most {
            break;
        }
    }
    found
}

/// Filters the residual by a Gaussian of standard deviation `width`, bins, and the impulse response.
fn filtered(sight: &Sight, guess: &Blobs, width: f64) -> FilteredPaths {
    let [response, delay] = sight.response();
    let deviation = (width * width + response * response + 0.1).sqrt();
    let reach = (2.5 * deviation).ceil() as i64;
    // Of the bin whose path is a node's.
    let taps: Vec<(i64, f64)> = (-reach..=reach)
        .map(|at| (at + delay.round() as i64, (-0.5 * (at as f64 / deviation).powi(2)).exp()))
        .collect();
    let all: f64 = taps.iter().map(|t| t.1).sum();
    let bins = sight.bins;
    let pairs: Vec<usize> = (0..sight.pairs()).step_by(sight.pairs().div_ceil(PAIRS)).collect();
    let rows = pairs.par_iter().map(|pair| {
        let pair = *pair;
        let counts = &sight.counts[pair * bins..(pair + 1) * bins];
        let mut rendered = vec![[0.0; 3]; bins];
        let mut spare = vec![];
        for blob in &guess.blobs {
            sight.rays(pair, blob).for_each(|ray| _ = sight.render(&ray, &mut spare, &mut rendered));
        }
        let rest: Vec<f64> =
            counts.iter().zip(&rendered).map(|(count, r)| count - guess.background - r[0]).collect();
        let near = |bin: usize| {
            taps.iter().filter_map(move |(shift, tap)| {
                let at = bin as i64 + shift;
                (0..bins as i64).contains(&at).then_some((at as usize, tap / all))
            })
        };
        let variance: Vec<f64> = (0..bins)
            .map(|bin| {
                let smooth: f64 = near(bin).map(|(at, tap)| tap * counts[at]).sum();
                sight.variance(smooth.max(guess.background))[0]
            })
            .collect();
        let sum = |bin: usize| {
            near(bin).fold([0.0; 2], |[light, weight], (at, tap)| {
                [light + tap * rest[at] / variance[at], weight + tap * tap / variance[at]]
            })
        };
        (0..bins).map(sum).collect::<Vec<_>>()
    });
    let rows: Vec<Vec<[f64; 2]>> = rows.collect();
    FilteredPaths {
        pairs,
        light: rows.iter().flatten().map(|v| v[0]).collect(),
        weight: rows.iter().flatten().map(|v| v[1]).collect(),
    }
}

/// The drop of χ² by the best light of a blob at a node, and that light.
fn score(sight: &Sight, rows: &FilteredPaths, at: DVec3) -> [f64; 2] {
    let (mut light, mut weight) = (0.0, 0.0);
    for (row, pair) in rows.pairs.iter().enumerate() {
        let (mut before, mut in_bin) = (usize::MAX, 0.0);
        for part in 0..sight.parts {
            let at = at * DVec3::new(1.0, 1.0, sight.lift(part));
            let ways = [at.distance(sight.laser[*pair]), at.distance(sight.sensor[*pair])];
            let bin = (ways[0] + ways[1] - sight.start) / sight.width;
            if !(0.0..sight.bins as f64).contains(&bin) {
                continue;
            }
            let passed = sight.passed(*pair, at, EXTENT[0] * sight.unit);
            let fall = (sight.unit * sight.unit / (ways[0] * ways[1]).max(1e-9)).powi(2) * passed;
            let here = row * sight.bins + bin as usize;
            light += fall * rows.light[here];
            // The light of parts in one bin adds up before it is squared.
            in_bin = if here == before { in_bin + fall } else { fall };
            let others = in_bin - fall;
            weight += (in_bin * in_bin - others * others) * rows.weight[here];
            before = here;
        }
    }
    if light > 0.0 && weight > 0.0 { [light * light / weight, light / weight] } else { [0.0; 2] }
}
