//! A few weighted points for every point or pair, where no lattice covers their spots.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, dvec2};

use super::SpotTaps;
use super::side::{Relay, sides};
use crate::transport::Wall;

/// Seven points for every point, with the moments of a Gaussian up to the fifth: in the middle and on a hexagon.
pub(super) fn around_each(points: &[DVec3], sigma: f64) -> (Vec<DVec2>, Vec<SpotTaps>) {
    let of = |(i, p): (usize, &DVec3)| {
        let middle = p.truncate();
        let corner =
            move |k: usize| middle + DVec2::from_angle(TAU * (k as f64 / 6.0 + even(i, 0))) * 2.0 * sigma;
        std::iter::once(middle).chain((0..6).map(corner))
    };
    let row = |i: u32| (0..7).map(|k| (7 * i + k, if k == 0 { 0.5 } else { 1.0 / 12.0 })).collect();
    let rows = (0..points.len() as u32).map(row).collect();
    (points.iter().enumerate().flat_map(of).collect(), vec![SpotTaps::of(7 * points.len(), rows)])
}

/// For every pair of two points four or eight pairs with the moments of the Gaussians up to the third: the corners of a
/// cross over both points' offsets, turned otherwise for every pair.
pub(super) fn around_pairs(wall: &Wall, sigma: [f64; 2]) -> (Wall, Vec<SpotTaps>) {
    let (scanned, others) = sides(wall);
    let relays = [Relay::of(&scanned), Relay::of(&others)];
    let both = sigma.iter().all(|s| *s > 0.0);
    let each = if both { 8 } else { 4 };
    let mut points = [vec![], vec![]];
    let mut normals = [vec![], vec![]];
    for pair in 0..wall.scanned.len() {
        for k in 0..each {
            let offset = if both { of_cross(pair, k) } else { of_square(pair, k) };
            for (side, own) in [&scanned, &others].into_iter().enumerate() {
                let at = own.points[pair].truncate() + sigma[side] * offset[side];
                let (point, normal) = relays[side].at(at);
                points[side].push(point);
                normals[side].push(normal);
            }
        }
    }
    let row = |i: u32| (0..each as u32).map(|k| (each as u32 * i + k, 1.0 / each as f32)).collect();
    let taps = SpotTaps::of(points[0].len(), (0..wall.scanned.len() as u32).map(row).collect());
    let [scanned, others] = points;
    let normals = wall.normals.as_ref().map(|_| normals.concat());
    (Wall { geometry: wall.geometry, scanned, others, normals }, vec![taps])
}

/// One of four offsets of either point, in standard deviations: of points of which one has a spot.
fn of_square(pair: usize, k: usize) -> [DVec2; 2] {
    [DVec2::from_angle(TAU * (k as f64 / 4.0 + even(pair, 0))) * 2f64.sqrt(); 2]
}

/// One of eight offsets of both points, in standard deviations: plus and minus twice an axis of a turned system in four
/// dimensions.
fn of_cross(pair: usize, k: usize) -> [DVec2; 2] {
    let mut axes: Vec<[f64; 4]> = vec![];
    for axis in 0..=k / 2 {
        let mut v = std::array::from_fn(|d| normal_of(even(pair, 4 * axis + d)));
        for before in &axes {
            let along: f64 = v.iter().zip(before).map(|(a, b)| a * b).sum();
            v.iter_mut().zip(before).for_each(|(a, b)| *a -= along * b);
        }
        let length = v.iter().map(|a| a * a).sum::<f64>().sqrt();
        axes.push(v.map(|a| a / length));
    }
    let [a, b, c, d] = axes[k / 2].map(|v| if k.is_multiple_of(2) { 2.0 * v } else { -2.0 * v });
    [dvec2(a, b), dvec2(c, d)]
}

/// Evenly distributed numbers in [0, 1): multiples of irrational steps, one for each dimension.
fn even(i: usize, dimension: usize) -> f64 {
    (0.5 + (i + 1) as f64 * (2f64 + 3.0 * dimension as f64).sqrt().fract() + 0.618_034 * dimension as f64)
        .fract()
}

/// A number with about a normal distribution, from one in [0, 1).
fn normal_of(uniform: f64) -> f64 {
    let u = uniform.clamp(1e-6, 1.0 - 1e-6);
    (u / (1.0 - u)).ln() / 1.702
}
