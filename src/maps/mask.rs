//! Tells from the albedo which pixels are surface, if no share of the brightest is given.
//!
//! Edges of a reconstruction are blurred by about the step of a usual scan, so an albedo falls over several pixels from
//! its plateau to the haze around it. The edge is where it falls fastest. How bright it is there differs from scene to
//! scene: half of the plateau for plates, a tenth of the brightest for spheres, whose rims are dim. So the albedo is
//! sharpened, and the threshold is the one whose contour is steepest in the mean, drawn toward a usual one.
//! Figures: benches/NOTES.md.

use super::{Maps, percentile};

/// Points to a side of a usual scan: its step is the unit of the blur.
const SCAN: f64 = 32.0;

/// Sigma of the Gaussian before edges are found, and what the Laplacian takes off, in steps of the scan (squared).
const SMOOTH: f64 = 0.25;
const SHARPEN: f64 = 0.125;

/// Thresholds that are tried, as shares of the usual brightness, their distance, and the half width of a contour.
const LEAST: f64 = 0.2;
const MOST: f64 = 0.6;
const STEP: f64 = 0.02;
const WIDE: f64 = 0.05;

/// Dim contours are as good as brighter ones that are steeper by this power of their threshold.
const DIMMER: f64 = 0.2;

/// The usual threshold, and its share in the one that is taken.
const USUAL: f64 = 0.43;
const PULL: f64 = 0.7;

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
        let own = rule.steepest(&shares);
        rule.threshold = brightness * (PULL * USUAL + (1.0 - PULL) * own);
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

    /// The threshold whose contour is steepest.
    fn steepest(&self, shares: &[f64]) -> f64 {
        let slope = |i: usize| {
            let (x, y) = (i / self.ny, i % self.ny);
            let rise = |low: usize, high: usize, between: usize| {
                if between == 0 { 0.0 } else { (shares[high] - shares[low]) / between as f64 }
            };
            let [left, right] = [x.saturating_sub(1), (x + 1).min(self.nx - 1)];
            let [low, high] = [y.saturating_sub(1), (y + 1).min(self.ny - 1)];
            let along_x = rise(left * self.ny + y, right * self.ny + y, right - left);
            along_x.hypot(rise(x * self.ny + low, x * self.ny + high, high - low))
        };
        let count = ((MOST - LEAST) / STEP).round() as usize + 1;
        let at = |k: usize| LEAST + k as f64 * STEP;
        let (mut sums, mut pixels) = (vec![0.0; count], vec![0usize; count]);
        for (i, share) in shares.iter().enumerate().filter(|(_, s)| (LEAST - WIDE..=MOST + WIDE).contains(*s))
        {
            let steep = slope(i);
            for k in (0..count).filter(|k| (share - at(*k)).abs() < WIDE) {
                sums[k] += steep;
                pixels[k] += 1;
            }
        }
        let mean = |k: usize| sums[k] / pixels[k].max(1) as f64;
        // A mean over five thresholds, so that single pixels do not decide.
        let around = |k: usize| (0..5).map(|d| mean((k + d).saturating_sub(2).min(count - 1))).sum::<f64>();
        let best = (0..count).max_by(|a, b| {
            let worth = |k: usize| around(k) / at(k).powf(DIMMER);
            worth(*a).total_cmp(&worth(*b))
        });
        best.map_or(USUAL, at)
    }
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
    use super::*;

    /// Maps of 64 x 64 pixels with this albedo at (x, y) in [-1, 1].
    fn maps(albedo: impl Fn(f64, f64) -> f64) -> Maps {
        let n = 64;
        let at = |i: usize| (i as f64 + 0.5) / n as f64 * 2.0 - 1.0;
        Maps {
            nx: n,
            ny: n,
            extent: [-1.0, 1.0, -1.0, 1.0],
            albedo: (0..n * n).map(|i| albedo(at(i / n), at(i % n)) as f32).collect(),
            depth: vec![1.0; n * n],
            normal: vec![[0.0, 0.0, -1.0]; n * n],
            mask: vec![],
            mask_fraction: None,
            confidence: None,
            behind: None,
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
    fn nothing_lit_is_no_surface() {
        let mut dark = maps(|_, _| 0.0);
        dark.set_mask(None);
        assert!(!dark.mask.contains(&true));
    }
}
