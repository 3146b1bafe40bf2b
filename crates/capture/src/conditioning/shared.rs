//! Light that all pairs share: the reflection of a cover glass, or light of the instrument, is the same narrow peak in every histogram, while
//! the light of a scene arrives elsewhere for every point of the wall.

use crate::data::Capture;
use crate::data::median::median;

/// Groups of consecutive pairs whose mean histograms are compared, and pairs of one at least.
const GROUPS: usize = 16;
const LEAST_PAIRS: usize = 4;
/// The background of a bin is the median of as many bins on each side: a shared peak is narrower than that.
const AROUND: usize = 24;
/// Standard errors of noise by which every group shows the peak, and by which their mean does.
const SHOWN: [f64; 2] = [2.5, 8.0];
/// Largest scatter of the groups around their mean beyond noise, as a share of it: light of a scene changes along a scan (a flat letter
/// .28, of the family .18; shared peaks .005 to .034).
const SCATTER: f64 = 0.1;

impl Capture {
    /// Counts of each bin that all pairs share, `[bins]`, by narrow peaks that are the same in every part of the scan; `None` without any.
    /// `per_count`: variance of a bin per count.
    #[doc(hidden)]
    pub fn shared_light(&self, per_count: f64) -> Option<Vec<f64>> {
        let (pairs, bins) = (self.pair_count(), self.bins);
        if pairs < GROUPS * LEAST_PAIRS || bins <= 2 * AROUND || self.histograms.len() != pairs * bins {
            return None;
        }
        // By group and bin: what is above the background, and its standard error.
        let groups: Vec<Vec<[f64; 2]>> = (0..GROUPS)
            .map(|group| {
                let [from, to] = [group, group + 1].map(|at| at * pairs / GROUPS);
                let mut mean = vec![0.0; bins];
                for pair in from..to {
                    mean.iter_mut().zip(self.histogram(pair)).for_each(|(sum, v)| *sum += f64::from(*v));
                }
                let count = (to - from) as f64;
                mean.iter_mut().for_each(|sum| *sum /= count);
                let above = |bin: usize| {
                    let ground = median(
                        mean[bin.saturating_sub(AROUND)..(bin + AROUND + 1).min(bins)].iter().copied(),
                    )
                    .unwrap_or(0.0);
                    let least = per_count / count;
                    [mean[bin] - ground, (per_count * ground.max(least) / count).sqrt()]
                };
                (0..bins).map(above).collect()
            })
            .collect();
        let [each, all] = SHOWN;
        let of = |bin: usize| groups.iter().map(move |group| group[bin]);
        let mean = |bin: usize| of(bin).map(|[above, _]| above).sum::<f64>() / GROUPS as f64;
        let error = |bin: usize| of(bin).map(|[_, error]| error * error).sum::<f64>().sqrt() / GROUPS as f64;
        let is_shared = |bin: usize| {
            let middle = mean(bin);
            let scatter = of(bin).map(|[above, _]| (above - middle).powi(2)).sum::<f64>() / GROUPS as f64;
            // The light of the peak has noise of its own.
            let noise = of(bin).map(|[_, error]| error * error).sum::<f64>() / GROUPS as f64
                + per_count * middle.max(0.0) * GROUPS as f64 / pairs as f64;
            middle > all * error(bin)
                && of(bin).all(|[above, error]| above > each * error)
                && scatter < (SCATTER * middle).powi(2) + noise
        };
        let peaks: Vec<usize> = (0..bins).filter(|bin| is_shared(*bin)).collect();
        if peaks.is_empty() {
            return None;
        }
        let mut shared = vec![0.0; bins];
        for peak in peaks {
            shared[peak] = mean(peak);
            // Its flanks, as far as they are seen.
            let mut flank = |next: &mut dyn Iterator<Item = usize>| {
                for bin in next.take_while(|bin| mean(*bin) > 2.0 * error(*bin)) {
                    shared[bin] = mean(bin);
                }
            };
            flank(&mut (peak.saturating_sub(AROUND)..peak).rev());
            flank(&mut (peak + 1..(peak + 1 + AROUND).min(bins)));
        }
        Some(shared)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// 16 x 16 confocal pairs; light of a point whose path changes along the scan, over a background, with a regular scatter like noise.
    fn capture(peak: f64) -> Capture {
        let at = |i: usize| (i as f64 + 0.5) / 16.0 - 0.5;
        let points: Vec<DVec3> = (0..256).map(|p| DVec3::new(at(p / 16), at(p % 16), 0.0)).collect();
        let mut counts = vec![];
        for (pair, point) in points.iter().enumerate() {
            let path = 2.0 * point.distance(DVec3::new(0.3, 0.1, 0.6));
            for bin in 0..200 {
                let scene = 30.0 * (-0.5 * ((bin as f64 - path / 0.01) / 2.0).powi(2)).exp();
                let glass = peak * (-0.5 * (bin as f64 - 90.0).powi(2)).exp();
                let noise = [0.0, 2.0, 1.0, 1.0][(7 * pair + 3 * bin + pair * bin / 5) % 4];
                counts.push((scene + glass + noise).round() as f32);
            }
        }
        Capture::new([16, 16], points.clone(), points, 200, 0.01, counts)
    }

    #[test]
    fn a_peak_of_every_pair_is_found_and_the_light_of_a_scene_is_not() {
        let shared = capture(20.0).shared_light(1.0).expect("a peak");
        let top = (0..200).max_by(|a, b| shared[*a].total_cmp(&shared[*b])).unwrap();
        assert!(top == 90 && (shared[90] - 20.0).abs() < 1.0, "{top} {}", shared[90]);
        assert!(shared.iter().enumerate().all(|(bin, v)| bin.abs_diff(90) <= 4 || *v == 0.0), "{shared:?}");
        assert_eq!(capture(0.0).shared_light(1.0), None);
    }
}
