//! The delay of path 0, for each point of a scan.
//!
//! In a confocal scan, the strongest light of a point comes from the wall itself: from the laser to the wall point and from
//! there to the sensor. Taken as path 0, it removes both legs and the delays of cables and electronics at once.

use rayon::prelude::*;

use super::collect::PointCounts;
use crate::advice::advice;
use crate::capture::METRES_PER_PICOSECOND;
use crate::capture::median::median;
use crate::error::{Error, Result};

/// What delay is path 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Zero {
    /// The peak of direct light of each point; only for confocal scans.
    #[default]
    Direct,
    /// This delay, seconds, for all points: legs are not removed.
    At(f64),
}

/// Minimum height of the peak above its point's other counts, standard deviations of the noise.
const CLEAR: f64 = 6.0;
/// Cells at least this share of the peak belong to it.
const PART: f64 = 0.5;
/// At least this share of the points must have a direct peak.
const MOST: f64 = 0.5;

/// The delay of each point's direct peak in cells (the middle of cell c is c + 0.5), `None` where there is none. Peaks of
/// neighbours cannot differ by more than `reach` cells.
pub(super) fn direct(cells: &PointCounts, reach: f64) -> Result<Vec<Option<f64>>> {
    let all = |range: Option<[f64; 2]>| -> Vec<Option<f64>> {
        (0..cells.points()).into_par_iter().map(|point| peak(cells.of(point), range)).collect()
    };
    let mut first = all(None);
    let Some(usual) = median(first.iter().flatten().copied()) else { return Err(none(0, first.len())) };
    let near = [usual - reach, usual + reach];
    let is_near = |delay: &Option<f64>| delay.is_some_and(|d| (near[0]..=near[1]).contains(&d));
    if !first.iter().all(is_near) {
        let second = all(Some(near));
        for (delay, again) in first.iter_mut().zip(second) {
            if !is_near(delay) {
                *delay = again;
            }
        }
    }
    let found = first.iter().flatten().count();
    if (found as f64) < MOST * first.len() as f64 {
        return Err(none(found, first.len()));
    }
    Ok(first)
}

/// Light behind the direct peak is more than this many standard deviations above the valley between both.
const RISES: f64 = 6.0;
/// The direct peak has decayed below this share of its height where light of a scene is looked for.
const DECAYED: f64 = 0.02;

/// Refuses direct peaks behind which no light rises, although paths before them are recorded: they are the light of the scene.
///
/// # Errors
/// `Kind::Input`.
pub(super) fn check_scene(cells: &PointCounts, zeros: &[f64]) -> Result<()> {
    let known = || zeros.iter().copied().filter(|zero| zero.is_finite());
    let (early, late) = known().fold((f64::INFINITY, 0.0f64), |(a, b), zero| (a.min(zero), b.max(zero)));
    let length = cells.cells.saturating_sub(late as usize);
    // Sums over all points, from the peak on.
    let mut sums = vec![0.0f64; length]; // bounded: the cells of a point
    for (point, zero) in zeros.iter().enumerate().filter(|(_, zero)| zero.is_finite()) {
        let counts = cells.of(point)[*zero as usize..].iter();
        sums.iter_mut().zip(counts).for_each(|(sum, n)| *sum += f64::from(*n));
    }
    // A window's counts are enough for the spread of photons to tell.
    let wide = (length / 64).max(3);
    let windows: Vec<f64> = sums.windows(wide).map(|w| w.iter().sum()).collect();
    let decayed = windows.iter().position(|w| *w <= DECAYED * windows[0]).unwrap_or(windows.len());
    let mut valley = f64::INFINITY;
    let rises = windows[decayed.min(windows.len())..].iter().any(|w| {
        valley = valley.min(*w);
        *w > valley + RISES * (valley + *w + 1.0).sqrt()
    });
    if rises || early < 1.0 {
        return Ok(());
    }
    let path = early * cells.width * METRES_PER_PICOSECOND * 1e12;
    Err(Error::input(
        format!(
            "the light that is taken as direct light is that of the scene: no light rises behind it, and the histograms would begin \
             at a path of -{path:.2} m"
        ),
        advice!["if bin 0 is path 0, give the delay of path 0: " Zero " 0ps"],
    ))
}

fn none(found: usize, points: usize) -> Error {
    Error::input(
        format!("{found} of {points} points have a clear peak of direct light"),
        "give the delay of path 0 in place of the direct peak; check that the detector is not gated off when direct light comes",
    )
}

/// The middle of the strongest peak, in cells, among those of a range; `None` if it does not stand out.
fn peak(counts: &[u32], range: Option<[f64; 2]>) -> Option<f64> {
    let end = counts.len();
    let [from, to] = range.map_or([0, end], |r| r.map(|v| (v.max(0.0) as usize).min(end)));
    // Three cells together: single photons make no peak.
    let around =
        |c: usize| counts[c.saturating_sub(1)..(c + 2).min(end)].iter().map(|n| u64::from(*n)).sum::<u64>();
    let best = (from..to).rev().max_by_key(|c| around(*c))?;
    let total: u64 = counts.iter().map(|n| u64::from(*n)).sum();
    let noise = 3.0 * total as f64 / end as f64;
    if (around(best) as f64) < noise + CLEAR * (noise + 1.0).sqrt() {
        return None;
    }
    let level = PART * around(best) as f64;
    let first = (0..best).rev().find(|c| (around(*c) as f64) < level).map_or(0, |c| c + 1);
    let last = (best..end).find(|c| (around(*c) as f64) < level).unwrap_or(end);
    let (mut sum, mut moment) = (0.0, 0.0);
    for (c, count) in counts.iter().enumerate().take(last).skip(first) {
        sum += f64::from(*count);
        moment += f64::from(*count) * (c as f64 + 0.5);
    }
    (sum > 0.0).then(|| moment / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(rows: &[Vec<u32>]) -> PointCounts {
        PointCounts { counts: rows.concat(), cells: rows[0].len(), width: 1e-12, ..PointCounts::default() }
    }

    fn row(peaks: &[(usize, u32)]) -> Vec<u32> {
        let mut row: Vec<u32> = (0..200).map(|c| (c * 7 % 3) as u32).collect();
        for (at, count) in peaks {
            for (c, share) in [(at - 1, 2), (*at, 4), (at + 1, 2)] {
                row[c] += count * share / 4;
            }
        }
        row
    }

    #[test]
    fn the_direct_peak_is_found_point_by_point() {
        let rows = [row(&[(50, 400)]), row(&[(55, 400), (140, 40)]), row(&[(52, 300), (150, 900)]), row(&[])];
        let found = direct(&cells(&rows), 10.0).unwrap();
        for (delay, wanted) in found.iter().zip([Some(50.5), Some(55.5), Some(52.5), None]) {
            match (delay, wanted) {
                (Some(delay), Some(wanted)) => assert!((delay - wanted).abs() < 0.05, "{delay} {wanted}"),
                (delay, wanted) => assert_eq!(*delay, wanted),
            }
        }
        let dark = [row(&[]), row(&[]), row(&[(50, 400)])];
        assert!(direct(&cells(&dark), 10.0).unwrap_err().what.contains("1 of 3"));
        assert!(direct(&cells(&dark[..2]), 10.0).unwrap_err().what.contains("0 of 2"));
    }
}
