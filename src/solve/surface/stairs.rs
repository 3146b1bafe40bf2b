//! Depths that a surface begins with, where the volume's layers are deep. A column's depth is that of a layer, so a slanted
//! surface begins as stairs. Where layers are as deep as bins or pulse are wide, the data cannot tell stairs from a slope, and
//! the surface would keep them.

use rayon::prelude::*;

use crate::maps::Maps;

/// Layers that are deeper than so many pixels are wide make stairs that a surface does not smooth by itself.
const DEEP: f64 = 3.0;

/// Width of the Gaussian, pixels: at most so many.
const MOST: f64 = 8.0;

/// Depths that differ by so many layers are of other surfaces.
const EDGE: f64 = 1.5;

/// Averages depths over as many pixels as a slope of one needs for a step, where layers of depth `pitch` are deep beside
/// pixels of width `pixel`; both in metres. Brighter pixels weigh more, those beyond an edge almost nothing.
pub fn level(maps: &mut Maps, pitch: f64, pixel: f64) {
    if pitch <= DEEP * pixel {
        return;
    }
    let sigma = (pitch / pixel).min(MOST);
    let reach = (2.0 * sigma).ceil() as i64;
    let narrow = |d: i64| (-0.5 * (d as f64 / sigma).powi(2)).exp();
    let weights: Vec<f64> = (-reach..=reach).map(narrow).collect();
    let (nx, ny) = (maps.nx as i64, maps.ny as i64);
    let depth = |pixel: usize| maps.depth[pixel];
    let levelled = |pixel: usize| {
        let own = depth(pixel);
        if !own.is_finite() {
            return own;
        }
        let (x, y) = (pixel as i64 / ny, pixel as i64 % ny);
        let mut sums = [0.0; 2];
        for i in (x - reach).max(0)..=(x + reach).min(nx - 1) {
            for j in (y - reach).max(0)..=(y + reach).min(ny - 1) {
                let other = (i * ny + j) as usize;
                if !depth(other).is_finite() {
                    continue;
                }
                let step = (f64::from(depth(other) - own) / (EDGE * pitch)).powi(4);
                let near = weights[(i - x + reach) as usize] * weights[(j - y + reach) as usize];
                let weight = f64::from(maps.albedo[other].max(0.0)) * near / (1.0 + step);
                sums[0] += weight;
                sums[1] += weight * f64::from(depth(other));
            }
        }
        if sums[0] > 0.0 { (sums[1] / sums[0]) as f32 } else { own }
    };
    maps.depth = (0..maps.depth.len()).into_par_iter().map(levelled).collect();
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 × 40 pixels of 1 cm at these depths, in layers of `pitch`.
    fn maps(pitch: f64, depth: impl Fn(usize) -> f64) -> Maps {
        let n = 40;
        let layer = |x: usize| ((depth(x) / pitch).round() * pitch) as f32;
        Maps {
            albedo: vec![1.0; n * n],
            depth: (0..n * n).map(|p| layer(p / n)).collect(),
            normal: vec![[0.0, 0.0, -1.0]; n * n],
            mask: vec![true; n * n],
            ..Maps::empty([n, n], [0.0, 0.4, 0.0, 0.4])
        }
    }

    #[test]
    fn a_slope_in_deep_layers_loses_its_stairs() {
        let slope = |x: usize| 0.5 + 0.005 * x as f64;
        let mut stairs = maps(0.05, slope);
        let off = |maps: &Maps| {
            let inner = (10..30).map(|x| (f64::from(maps.depth[x * 40 + 20]) - slope(x)).abs());
            inner.fold(0.0, f64::max)
        };
        let before = off(&stairs);
        level(&mut stairs, 0.05, 0.01);
        assert!(before > 0.02 && off(&stairs) < 0.3 * before, "{before} {}", off(&stairs));
    }

    #[test]
    fn edges_and_thin_layers_stay() {
        let mut edge = maps(0.05, |x| if x < 20 { 0.5 } else { 0.8 });
        level(&mut edge, 0.05, 0.01);
        for (x, depth) in [(0, 0.5), (19, 0.5), (20, 0.8), (39, 0.8)] {
            let found = f64::from(edge.depth[x * 40 + 7]);
            assert!((found - depth).abs() < 0.003, "{x}: {found}");
        }
        let thin = maps(0.03, |x| 0.5 + 0.005 * x as f64);
        let mut same = thin.clone();
        level(&mut same, 0.03, 0.01);
        assert_eq!(same, thin);
        let mut dark = maps(0.05, |_| 0.5);
        dark.depth[3] = f32::NAN;
        dark.albedo.fill(0.0);
        level(&mut dark, 0.05, 0.01);
        assert!(dark.depth[3].is_nan() && dark.depth[4] == 0.5);
    }
}
