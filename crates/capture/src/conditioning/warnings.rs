//! Signs that a capture is wrong: its time zero, the scale of its wall, empty histograms.

use rayon::prelude::*;

use crate::data::check::{NEGATIVE_PULSES, UPRIGHT, is_upside_down};
use crate::data::histogram_figures::sum;
use crate::data::rows::{largest_of_three, range_from};
use crate::data::scan::decimals;
use crate::data::{Capture, PairKind};

/// A bin counts as signal above this share of the largest bin of its histogram.
const SIGNAL: f32 = 0.3;
/// Up to this share of all counts may come too early without a warning.
pub(crate) const EARLY: f64 = 0.01;
/// Standard errors by which the least of many means may be too low.
const CHANCE: f64 = 4.0;
/// First light that curves more than this many times as strongly as the light of a point is not due to rounding.
const CURVED: f64 = 1.3;
/// Share of pairs with the histogram of the pair before them that no symmetric scene reaches.
const REPEATED: f64 = 0.25;
/// Totals of this many histograms that differ by less than this share are the same.
const FEW: usize = 9;
const SAME: f64 = 1e-3;

impl Capture {
    /// Sentences that say what looks wrong about this capture; empty if nothing does. Nothing is corrected.
    ///
    /// Two laws are checked. Light cannot arrive before it has travelled straight from the laser point to the sensor
    /// point. And in a confocal scan of a flat wall, the squared distance of the first light, minus the squared
    /// position on the wall, is concave along a line: it is the minimum of functions |p|² − 2x·p of the hidden points
    /// p. If it bends the other way over most of the scan, the wall is larger than its points say; for example, half
    /// its width was given as the whole.
    ///
    /// A scene of flat faces, a wall that was given too large, and a mirrored scan break no law and are not found.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let share = self.early_share();
        if share > EARLY {
            warnings.push(format!(
                "{:.0} % of all counts come before light can travel straight from the laser point to the \
                 sensor point: time zero (t_start) or the wall's scale is wrong, the outer legs were removed \
                 twice, or these counts are direct light that a gate should leave out",
                100.0 * share
            ));
        }
        if let Some(times) = self.curvature().filter(|times| *times > CURVED) {
            let (d, b) = (decimals(3, self.span()), decimals(6, self.span()));
            warnings.push(format!(
                "over the scan the first light curves {times:.1} times as strongly as the light of a point: \
                 the wall is larger than {:.d$} m (is this half its width?), a bin is narrower than {:.b$} m \
                 of path, or time zero is later",
                self.span(),
                self.bin_width
            ));
        }
        // Photon counts are not below zero.
        let upside_down = match self.integer_counts {
            true => 0,
            false => {
                self.of_rows(|h| is_upside_down(range_from([0.0; 2], h))).into_iter().filter(|is| *is).count()
            }
        };
        if 2 * upside_down > self.pair_count() {
            warnings.push(format!(
                "the signal is upside down in {upside_down} of {} histograms, {NEGATIVE_PULSES}: {UPRIGHT}",
                self.pair_count()
            ));
        }
        if self.is_a_line() {
            warnings.push(
                "all points of the scan lie on a line: they determine the position along it and the distance from it alone, and maps show \
                 no picture (scan an area)"
                    .into(),
            );
        }
        let empty = self.of_rows(|h| h.iter().all(|v| *v == 0.0)).into_iter().filter(|dark| *dark).count();
        if 2 * empty > self.pair_count() {
            warnings.push(format!("{empty} of {} histograms hold no count", self.pair_count()));
        }
        warnings
    }

    /// Says that the sensor sees the wall beside the laser in every pair, and what methods for confocal scans make of it.
    pub(super) fn offset_note(&self) -> Option<String> {
        let offset = self.offset()?;
        let first = self.of_rows(first_light).into_iter().flatten().min()?;
        let nearest = (0.5 * (self.edge(first) + self.bin_width)).max(self.bin_width);
        // Path by the middle: 2r; by both points: up to 2r + d²/4r.
        let error = 0.25 * offset.length_squared() / nearest;
        Some(format!(
            "the sensor point is {:.1} mm beside the laser point in every pair, ({:.1}, {:.1}, {:.1}) mm: methods for confocal scans take \
             the point between both, which makes paths wrong by up to {:.2} mm",
            1e3 * offset.length(),
            1e3 * offset.x,
            1e3 * offset.y,
            1e3 * offset.z,
            1e3 * error
        ))
    }

    /// Says that many pairs have exactly the histogram of the pair before them, as they have in a scan that was enlarged.
    pub(super) fn repeated_note(&self) -> Option<String> {
        let copies = |apart: usize| {
            let is_copy = |pair: &usize| {
                let (row, before) = (self.histogram(*pair), pair - apart);
                let is_one =
                    self.laser[*pair] == self.laser[before] && self.sensor[*pair] == self.sensor[before];
                !is_one && row == self.histogram(before) && row.iter().any(|v| *v != 0.0)
            };
            (apart..self.pair_count()).into_par_iter().filter(is_copy).count()
        };
        let most = [1, self.scan[1]].map(copies).into_iter().max().unwrap_or(0);
        (most as f64 > REPEATED * self.pair_count() as f64).then(|| {
            format!(
                "{most} of {} pairs have exactly the histogram of a pair beside them, as of a scan that was enlarged by repeating its \
                 points: give the points as measured, or a stride",
                self.pair_count()
            )
        })
    }

    /// Says that all histograms have the same total, as they have after a division by it.
    pub(super) fn normalised_note(&self) -> Option<String> {
        if self.integer_counts {
            return None;
        }
        let totals = self.of_rows(sum).into_iter();
        let totals: Vec<f64> = totals.filter(|total| *total > 0.0).collect();
        let (least, most) = totals.iter().fold((f64::INFINITY, 0.0f64), |(a, b), t| (a.min(*t), b.max(*t)));
        (totals.len() >= FEW && most - least <= SAME * most).then(|| {
            "all histograms have the same total, as if each was divided by its own: albedo and shading are lost; store the counts"
                .to_string()
        })
    }

    fn span(&self) -> f64 {
        let [x0, x1, y0, y1] = self.wall_extent();
        (x1 - x0).max(y1 - y0)
    }

    /// Dark counts of a bin: the lowest mean of any sixteenth of the bins, and what chance takes off it. 0 for counts that are no
    /// photons.
    fn dark_counts(&self) -> f64 {
        if !self.integer_counts {
            return 0.0;
        }
        let window = (self.bins / 16).max(1);
        let means = self.mean_histogram();
        let least = means.windows(window).map(|w| w.iter().sum::<f64>()).fold(f64::INFINITY, f64::min);
        let least = least / window as f64;
        least + CHANCE * (least / (window * self.pair_count()) as f64).sqrt()
    }

    /// The share of the counts, less dark counts, that come before light can arrive.
    fn early_share(&self) -> f64 {
        let sides = self.laser.iter().zip(&self.sensor);
        self.share_before(&sides.map(|(laser, sensor)| laser.distance(*sensor)).collect::<Vec<_>>())
    }

    /// The share of the counts, less dark counts, that come before these paths of the pairs, metres. NaN: an unknown path.
    pub(crate) fn share_before(&self, paths: &[f64]) -> f64 {
        let (mut early, mut total, mut bins) = (0.0, 0.0, 0);
        let totals = self.of_rows(sum);
        for (pair, histogram) in self.histograms.chunks_exact(self.bins).enumerate() {
            let straight = paths[pair];
            if straight.is_nan() || totals[pair].is_nan() {
                continue;
            }
            // A bin that ends later may hold light.
            let first = ((straight - self.t_start) / self.bin_width).floor().max(0.0);
            let first = (first as usize).saturating_sub(1).min(self.bins);
            early += histogram[..first].iter().map(|v| f64::from(*v)).sum::<f64>();
            total += totals[pair];
            bins += first;
        }
        if total > 0.0 && early > EARLY * total {
            early = (early - self.dark_counts() * bins as f64).max(0.0);
        }
        if total > 0.0 { early / total } else { 0.0 }
    }

    /// The curvature of the first light relative to that of a point: the second difference of its squared distance
    /// along rows and columns, as the median over the scan. At most 1 in a sound capture. `None` if the scan is not a
    /// confocal lattice of at least 8 x 8 points on a flat wall, or has too little signal.
    fn curvature(&self) -> Option<f64> {
        let bends = self.bends(|distance| distance * distance)?;
        Some(bends[bends.len() / 2])
    }

    /// Second differences of a function of the distance of the first light over twice the squared step, in ascending order: 1 for the
    /// square of that of a point. `None` as for [`Capture::curvature`].
    pub(super) fn bends(&self, of: impl Fn(f64) -> f64 + Sync) -> Option<Vec<f64>> {
        let [nx, ny] = self.scan;
        if self.pair_kind() != PairKind::Confocal || !self.is_planar() || nx < 8 || ny < 8 {
            return None;
        }
        let values: Vec<Option<f64>> = self.of_rows(|h| {
            let path = self.t_start + (first_light(h)? as f64 + 0.5) * self.bin_width;
            Some(of(0.5 * path))
        });
        let mut bends = Vec::new();
        for pair in 0..nx * ny {
            let (ix, iy) = (pair / ny, pair % ny);
            let right = (ix + 2 * (nx / 4) < nx).then_some(nx / 4 * ny);
            let up = (iy + 2 * (ny / 4) < ny).then_some(ny / 4);
            for step in right.into_iter().chain(up) {
                let [a, b, c] = [pair, pair + step, pair + 2 * step];
                let (Some(first), Some(middle), Some(last)) = (values[a], values[b], values[c]) else {
                    continue;
                };
                let apart = self.sensor[a].distance_squared(self.sensor[b]);
                bends.push((first - 2.0 * middle + last) / (2.0 * apart));
            }
        }
        bends.sort_unstable_by(f64::total_cmp);
        (2 * bends.len() > nx * ny).then_some(bends)
    }
}

/// The first bin with signal, in a histogram that is smoothed over three bins.
pub(super) fn first_light(histogram: &[f32]) -> Option<usize> {
    let at = |b: usize| histogram.get(b).copied().unwrap_or(0.0);
    let smooth = |b: usize| at(b.wrapping_sub(1)) + at(b) + at(b + 1);
    let most = largest_of_three(histogram);
    let is_lit = |sum: f32| most > 0.0 && sum >= SIGNAL * most;
    let (last, inner) = (histogram.len().saturating_sub(1), histogram.windows(3));
    let end = |bin: usize| is_lit(smooth(bin)).then_some(bin);
    end(0)
        .or_else(|| Some(inner.map(|w| is_lit(w[0] + w[1] + w[2])).position(|lit| lit)? + 1))
        .or_else(|| end(last))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    /// One laser point and 16 x 16 sensor points of a wall of 1 m: a pulse at this path and dark counts.
    fn photons(path: f64, most: f64, dark: f64) -> Capture {
        let mut random = Pcg64::seed_from_u64(2);
        let points: Vec<DVec3> = (0..256)
            .map(|p| DVec3::new(f64::from(p / 16) / 15.0 - 0.5, f64::from(p % 16) / 15.0 - 0.5, 0.0))
            .collect();
        let mut count = |bin: usize| {
            let mean = dark + most * (-((bin as f64 * 0.01 - path) / 0.03).powi(2)).exp();
            if mean > 0.0 { Poisson::new(mean).unwrap().sample(&mut random) as f32 } else { 0.0 }
        };
        let counts = (0..256 * 200).map(|i| count(i % 200)).collect();
        let made = Capture::new([16; 2], vec![DVec3::ZERO; 256], points, 200, 0.01, counts);
        Capture { integer_counts: true, ..made }
    }

    #[test]
    fn points_on_a_line_are_told() {
        let on_a_line = |capture: &Capture| capture.warnings().iter().any(|w| w.contains("lie on a line"));
        let area = photons(1.2, 1000.0, 1.0);
        let mut line = area.keep(&(0..16).collect::<Vec<_>>(), [16, 1]);
        assert!(!on_a_line(&area) && !on_a_line(&line), "one laser beside a line");
        line.laser.clone_from(&line.sensor);
        assert!(on_a_line(&line));
    }

    #[test]
    fn dark_counts_are_no_early_light() {
        let early =
            |capture: Capture| capture.warnings().iter().any(|w| w.contains("before light can travel"));
        for (most, dark) in [(1000.0, 1.0), (10.0, 0.1), (1.0, 0.5), (1.0, 0.0)] {
            assert!(!early(photons(1.2, most, dark)), "{most} {dark}");
            assert!(early(photons(0.2, most, dark)), "{most} {dark}");
        }
    }
}
