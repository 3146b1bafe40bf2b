//! Tells from the albedo which pixels are surface, if no share of the brightest is given.
//!
//! Edges of a reconstruction are blurred by half a pixel or more, so an albedo falls over several pixels from its plateau to
//! the haze around it. Where a surface ends with a sharp edge, as a plate does, the edge is where about half of the
//! plateau is left. Where it bends away, as a sphere does, its rims are dim, and more of the fall belongs to it. So the
//! threshold is a share of the usual brightness, and the smaller the steeper the surface is where its albedo falls.
//! Figures: benches/NOTES.md.

use super::{Maps, percentile};

/// Points to a side of a usual scan: its step is the unit of the blur.
const SCAN: f64 = 32.0;

/// Sigma of the Gaussian before edges are found, and what the Laplacian takes off, in steps of the scan (squared).
const SMOOTH: f64 = 0.1;
const SHARPEN: f64 = 0.03;

/// The threshold for edges that face the wall, as a share of the usual brightness, and what it loses per unit of the
/// cosine between the surface and the wall.
const LEVEL: f64 = 0.58;
const STEEP: f64 = 0.2;

/// Edges are where the albedo, as a share of the usual brightness, is between these. Slopes are told from pixels above the
/// last.
const EDGE: [f64; 2] = [0.3, 0.7];
const LIT: f64 = 0.1;

/// What a pixel needs to count as surface.
pub(super) struct Rule {
    nx: usize,
    ny: usize,
    /// On the sharpened albedo.
    threshold: f64,
}

impl Rule {
    /// The rule for the albedo of `maps`; `None` if nothing is lit.
    pub fn of(maps: &Maps) -> Option<Rule> {
        let mut rule = Rule { nx: maps.nx, ny: maps.ny, threshold: 0.0 };
        let sharp = rule.sharpened(&maps.albedo);
        let brightness = usual_brightness(&sharp)?;
        let shares: Vec<f64> = sharp.iter().map(|v| v / brightness).collect();
        rule.threshold = brightness * (LEVEL - STEEP * (1.0 - rule.facing(maps, &shares)));
        Some(rule)
    }

    /// The pixels of an albedo that count as surface.
    pub fn mask(&self, albedo: &[f32]) -> Vec<bool> {
        let sharp = self.sharpened(albedo);
        sharp.iter().zip(albedo).map(|(s, a)| *s > self.threshold && *a > 0.0).collect()
    }

    /// The albedo, smoothed against noise and sharpened against blur.
    fn sharpened(&self, albedo: &[f32]) -> Vec<f64> {
        let step = self.nx.max(self.ny) as f64 / SCAN;
        let clean: Vec<f64> =
            albedo.iter().map(|a| if a.is_finite() { f64::from(*a) } else { 0.0 }).collect();
        let smooth = smoothed([self.nx, self.ny], &clean, SMOOTH * step);
        let less = SHARPEN * step * step;
        let at = |x: usize, y: usize| smooth[x * self.ny + y];
        let of = |i: usize| {
            let (x, y) = (i / self.ny, i % self.ny);
            let [left, right] = [x.saturating_sub(1), (x + 1).min(self.nx - 1)];
            let [low, high] = [y.saturating_sub(1), (y + 1).min(self.ny - 1)];
            let bend = at(left, y) + at(right, y) + at(x, low) + at(x, high) - 4.0 * at(x, y);
            (at(x, y) - less * bend).max(0.0)
        };
        (0..clean.len()).map(of).collect()
    }

    /// The mean cosine between the surface and the wall where the albedo falls, each pixel weighted by how fast it falls
    /// there; 1 without an edge.
    fn facing(&self, maps: &Maps, shares: &[f64]) -> f64 {
        let pixel = maps.pixel();
        let depth: Vec<f64> = maps.depth.iter().map(|z| f64::from(*z) / pixel).collect();
        let lit: Vec<bool> = depth.iter().zip(shares).map(|(z, s)| *s > LIT && z.is_finite()).collect();
        let everywhere = vec![true; shares.len()];
        let sides = [self.nx, self.ny];
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in (0..shares.len()).filter(|i| lit[*i] && (EDGE[0]..EDGE[1]).contains(&shares[*i])) {
            let [x, y] = slope(sides, shares, &everywhere, i);
            let fall = x.hypot(y);
            let [x, y] = slope(sides, &depth, &lit, i);
            sum += fall / (1.0 + x * x + y * y).sqrt();
            weights += fall;
        }
        if weights > 0.0 { sum / weights } else { 1.0 }
    }
}

/// The slope of values along x and y at a pixel, by the pixels beside it that are `shown`; 0 where there are none.
pub(super) fn slope([nx, ny]: [usize; 2], values: &[f64], shown: &[bool], i: usize) -> [f64; 2] {
    let along = |at: usize, count: usize, stride: usize| {
        let low = at.checked_sub(1).map(|_| i - stride).filter(|j| shown[*j]).unwrap_or(i);
        let high = Some(i + stride).filter(|j| at + 1 < count && shown[*j]).unwrap_or(i);
        let steps = (high - low) / stride;
        if steps == 0 || values[i].is_nan() { 0.0 } else { (values[high] - values[low]) / steps as f64 }
    };
    [along(i / ny, nx, ny), along(i % ny, ny, 1)]
}

/// Gaussian of `sigma` pixels; pixels beyond the edge are as those at the edge.
pub(super) fn smoothed([nx, ny]: [usize; 2], values: &[f64], sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).ceil() as isize;
    let weights: Vec<f64> =
        (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma.max(1e-9)).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let along = |from: &[f64], count: usize, stride: usize| -> Vec<f64> {
        let of = |i: usize| {
            let at = i / stride % count;
            let mean = (-reach..=reach).zip(&weights).map(|(k, w)| {
                let other = (at as isize + k).clamp(0, count as isize - 1) as usize;
                w * from[i + other * stride - at * stride]
            });
            mean.sum::<f64>() / sum
        };
        (0..from.len()).map(of).collect()
    };
    along(&along(values, ny, 1), nx, ny)
}

/// The median of the pixels above a third of the brightest.
fn usual_brightness(sharp: &[f64]) -> Option<f64> {
    let values: Vec<f32> = sharp.iter().map(|v| *v as f32).collect();
    let white = match percentile(&values, 99.9)? {
        white if white > 0.0 => white,
        _ => values.iter().copied().fold(0.0, f32::max),
    };
    let bright: Vec<f32> = values.into_iter().filter(|v| *v > 0.3 * white && *v > 0.0).collect();
    percentile(&bright, 50.0).map(f64::from)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Maps of 64 x 64 pixels with this albedo at (x, y) in [-1, 1].
    fn maps(albedo: impl Fn(f64, f64) -> f64) -> Maps {
        let n = 64;
        let at = |i: usize| (i as f64 + 0.5) / n as f64 * 2.0 - 1.0;
        Maps {
            albedo: (0..n * n).map(|i| albedo(at(i / n), at(i % n)) as f32).collect(),
            depth: vec![1.0; n * n],
            normal: vec![[0.0, 0.0, -1.0]; n * n],
            ..Maps::empty([n, n], [-1.0, 1.0, -1.0, 1.0])
        }
    }

    /// Share of the pixels within `radius` of the middle that the mask has, and of the others.
    fn found(maps: &mut Maps, radius: f64) -> [f64; 2] {
        maps.set_mask(None);
        let inside: Vec<bool> = (0..64 * 64)
            .map(|i| {
                let [x, y] = maps.centre(i / 64, i % 64);
                x.hypot(y) < radius
            })
            .collect();
        let share = |of: bool| {
            let all = inside.iter().filter(|i| **i == of).count() as f64;
            inside.iter().zip(&maps.mask).filter(|(i, m)| **i == of && **m).count() as f64 / all
        };
        [share(true), share(false)]
    }

    #[test]
    fn a_blurred_plate_ends_in_the_middle_of_its_edge() {
        let edge = |r: f64, wide: f64| 1.0 / (1.0 + ((r - 0.5) / wide).exp());
        for haze in [0.0, 0.08] {
            let [inside, outside] =
                found(&mut maps(|x, y| edge(x.hypot(y), 0.03) * (1.0 - haze) + haze), 0.5);
            assert!(inside > 0.94 && outside < 0.02, "{haze}: {inside} {outside}");
        }
    }

    #[test]
    fn a_dim_part_stays_and_a_bright_spot_does_not_decide() {
        // Half of the plate is dimmer, and four pixels are five times as bright.
        let plate = |x: f64, y: f64| {
            let edge = 1.0 / (1.0 + ((x.hypot(y) - 0.5) / 0.02).exp());
            edge * if x > 0.0 { 1.0 } else { 0.6 }
        };
        let mut plain = maps(plate);
        let mut spotted = maps(|x, y| plate(x, y) * if x.hypot(y) < 0.03 { 5.0 } else { 1.0 });
        let [inside, outside] = found(&mut spotted, 0.5);
        assert!(inside > 0.9 && outside < 0.03, "{inside} {outside}");
        plain.set_mask(None);
        let changed = plain.mask.iter().zip(&spotted.mask).filter(|(a, b)| a != b).count();
        assert!(changed < 20, "{changed} pixels of the mask changed");
    }

    #[test]
    fn a_surface_that_bends_away_keeps_more_of_its_rim() {
        let dome = |x: f64, y: f64| (0.25 - x * x - y * y).max(0.0).sqrt();
        let flat = maps(|x, y| 2.0 * dome(x, y));
        let mut ball = flat.clone();
        for i in 0..64 * 64 {
            let [x, y] = ball.centre(i / 64, i % 64);
            ball.depth[i] = (1.0 - dome(x, y)) as f32;
        }
        let [flat, ball] = [flat, ball].map(|mut maps| {
            maps.set_mask(None);
            maps.mask.iter().filter(|m| **m).count() as f64
        });
        // Within the contour of brightness t lies 1 - t² of the area; .74 is usual: the median above .3. The cosine of the
        // ball is t too, .37 in the mean where shares are .3 to .7.
        let area = |t: f64| PI * 0.25 * (1.0 - t * t) * 32.0 * 32.0;
        assert!((flat / area(0.58 * 0.74) - 1.0).abs() < 0.03, "{flat}");
        assert!((ball / area(0.454 * 0.74) - 1.0).abs() < 0.03, "{ball}");
        assert!(ball > 1.05 * flat);
    }

    #[test]
    fn nothing_lit_is_no_surface() {
        let mut dark = maps(|_, _| 0.0);
        dark.set_mask(None);
        assert!(!dark.mask.contains(&true));
    }
}
