//! Gates: the interval of paths that is used, given by the user or found automatically.

use std::ops::Range;

use super::negative::quiet_bins;
use crate::data::Capture;
use crate::data::rows::range_from;
use crate::data::scan::decimals;
use crate::error::{Error, Result};

/// A range of path lengths in metres; an open end is infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gate {
    /// Shortest path, metres.
    pub from: f64,
    /// Longest path, metres.
    pub to: f64,
}

/// A gate that was found in the data, and the reason.
#[derive(Debug, Clone, PartialEq)]
pub struct AutoGate {
    /// The range of paths.
    pub gate: Gate,
    /// A sentence that says why.
    pub reason: String,
}

impl Gate {
    /// Reads `FROM:TO` in metres of path; either end may be left out.
    ///
    /// # Errors
    /// `Kind::Options` if there is no colon, if an end is not a number, or if the range is empty.
    pub fn parse(text: &str) -> Result<Gate> {
        let hint = "write FROM:TO in metres of path, for example 0.8:2.4, 0.8: or :2.4";
        let wrong = |what: String| Error::options(format!("gate {text:?}: {what}"), hint);
        let (from, to) = text.split_once(':').ok_or_else(|| wrong("there is no colon".into()))?;
        let number = |part: &str, open: f64| match part.trim() {
            "" => Ok(open),
            part => match part.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(wrong(format!("{part:?} is not a length in metres"))),
            },
        };
        let gate = Gate { from: number(from, f64::NEG_INFINITY)?, to: number(to, f64::INFINITY)? };
        if gate.from >= gate.to {
            return Err(wrong("it ends before it begins".into()));
        }
        Ok(gate)
    }

    /// Whether all paths of `other` are in this gate.
    pub fn holds(self, other: Gate) -> bool {
        self.from <= other.from && self.to >= other.to
    }

    /// The paths in both gates; those of `other` if there are none.
    pub fn within(self, other: Gate) -> Gate {
        let both = Gate { from: self.from.max(other.from), to: self.to.min(other.to) };
        if both.from < both.to { both } else { other }
    }
}

impl std::fmt::Display for Gate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.from.is_finite() {
            write!(f, "{}", self.from)?;
        }
        write!(f, ":")?;
        if self.to.is_finite() {
            write!(f, "{}", self.to)?;
        }
        Ok(())
    }
}

#[doc(hidden)]
impl Capture {
    /// The capture cropped to the bins that the gate touches; a bin partly inside is kept. `t_start` moves with them.
    ///
    /// # Errors
    /// `Kind::Options` if the gate is empty, not a number, or touches no bin.
    pub fn gated(&self, gate: Gate) -> Result<Capture> {
        let Range { start, end } = self.bins_of(gate)?;
        let cropped = |counts: &[f32]| -> Vec<f32> {
            counts.chunks_exact(self.bins).flat_map(|h| &h[start..end]).copied().collect()
        };
        let histograms = cropped(&self.histograms);
        let mut gated = self.with_bins(end - start, self.bin_width, self.edge(start), histograms);
        gated.empty = self.empty.as_deref().map(cropped);
        // Pile-up comes from all earlier counts.
        Ok(Capture { cycles: self.cycles.filter(|_| start == 0), ..gated })
    }

    /// Crops the capture as [`Capture::gated`] does, in place, because histograms may be large.
    ///
    /// # Errors
    /// Those of [`Capture::gated`].
    pub fn set_gate(&mut self, gate: Gate) -> Result<()> {
        let Range { start, end } = self.bins_of(gate)?;
        let (kept, bins) = (end - start, self.bins);
        for counts in std::iter::once(&mut self.histograms).chain(&mut self.empty) {
            let rows = counts.len() / bins;
            for row in 0..rows {
                let from = row * bins;
                counts.copy_within(from + start..from + end, row * kept);
            }
            counts.truncate(rows * kept);
            counts.shrink_to_fit();
        }
        self.cycles = self.cycles.filter(|_| start == 0);
        (self.t_start, self.bins) = (self.edge(start), kept);
        Ok(())
    }

    /// Leading edge of a bin, metres of path.
    pub fn edge(&self, bin: usize) -> f64 {
        self.t_start + bin as f64 * self.bin_width
    }

    /// The bins that a gate touches.
    ///
    /// # Errors
    /// Those of [`Capture::gated`].
    pub(crate) fn bins_of(&self, gate: Gate) -> Result<Range<usize>> {
        // NaN ends are refused here too.
        if gate.from.partial_cmp(&gate.to) != Some(std::cmp::Ordering::Less) {
            return Err(Error::options(
                format!("the gate from {} m to {} m is empty", gate.from, gate.to),
                "give a range of path lengths in metres whose begin is less than its end",
            ));
        }
        // A gate end within a millionth of a bin from an edge means that edge.
        let bin = |t: f64| (t - self.t_start) / self.bin_width;
        let first = (bin(gate.from) + 1e-6).floor().max(0.0);
        let last = (bin(gate.to) - 1e-6).ceil().min(self.bins as f64);
        if first >= last {
            return Err(Error::options(
                format!(
                    "the gate {gate} lies outside the recorded paths, {:.4} m to {:.4} m",
                    self.t_start,
                    self.t_end()
                ),
                "give a gate in metres of path length (twice the depth) that overlaps them",
            ));
        }
        Ok(first as usize..last as usize)
    }
}

/// The peak of direct light must come before this share of the longest path.
const NEAR_ZERO: f64 = 0.05;
/// It must be in the same bin, or one beside it, for at least this share of the pairs with signal.
const SAME_BIN: f64 = 0.9;
/// It must be this many times stronger than anything behind the valley.
const STRONGER: f64 = 5.0;
/// The signal behind the valley must rise this many times above the valley.
const VALLEY: f64 = 4.0;
/// The gate opens where the direct light has decayed to this share of the strongest bin behind the valley.
const RESIDUE: f64 = 0.03;

/// Looks for direct light: a strong peak near path 0, in the same bin for nearly all pairs, well separated from the
/// indirect signal. Where the capture knows the path of direct light, it need not be strong. Returns a gate that leaves the
/// peak out, or `None` if there is none.
pub fn auto_gate(capture: &Capture) -> Option<AutoGate> {
    direct(capture, &capture.mean_histogram())
}

/// [`auto_gate`] by the mean histogram.
pub(super) fn direct(capture: &Capture, mean: &[f64]) -> Option<AutoGate> {
    strong_direct(capture, mean).or_else(|| known_direct(capture, mean, capture.direct?))
}

/// Maximum distance, bins, of the peak of direct light from its known path.
const OFF: usize = 2;

/// The gate behind direct light whose path is known, `None` if no bin holds it.
fn known_direct(capture: &Capture, mean: &[f64], path: f64) -> Option<AutoGate> {
    let mean = smooth(mean);
    let at = ((path - capture.t_start) / capture.bin_width).floor();
    if !(at >= -(OFF as f64) && at < capture.bins as f64) {
        return None;
    }
    let strongest = |from: usize, to: usize| (from..to).rev().max_by(|a, b| mean[*a].total_cmp(&mean[*b]));
    let at = at.max(0.0) as usize;
    let peak = strongest(at.saturating_sub(OFF), (at + OFF + 1).min(capture.bins))?;
    let dark = mean[peak..].iter().copied().fold(f64::INFINITY, f64::min);
    // Where the peak has decayed to this share of itself, what is strongest behind is the scene's, or the rest of its tail.
    let decayed = |level: f64, from: usize, to: usize| {
        (from..to).find(|b| mean[*b] - dark <= RESIDUE * (level - dark)).unwrap_or(to)
    };
    let end = decayed(mean[peak], peak, capture.bins);
    let scene = strongest(end, capture.bins)?;
    let valley = (end..=scene).rev().min_by(|a, b| mean[*a].total_cmp(&mean[*b]))?;
    let open = decayed(mean[scene], end, valley);
    let from = capture.edge(open);
    let d = decimals(3, capture.unit());
    let reason = format!(
        "direct light is at path {path:.d$} m, as the capture says; paths below {from:.d$} m are left out"
    );
    Some(AutoGate { gate: Gate { from, to: f64::INFINITY }, reason })
}

/// The gate behind a strong peak near path 0, `None` without one.
fn strong_direct(capture: &Capture, mean: &[f64]) -> Option<AutoGate> {
    let bins = capture.bins;
    let mut peaks: Vec<usize> = capture.of_rows(peak_bin).into_iter().flatten().collect();
    if peaks.is_empty() || bins < 8 {
        return None;
    }
    peaks.sort_unstable();
    let peak = peaks[peaks.len() / 2];
    let together = peaks.iter().filter(|&&b| b.abs_diff(peak) <= 1).count();
    let peak_path = capture.t_start + (peak as f64 + 0.5) * capture.bin_width;
    if (together as f64) < SAME_BIN * peaks.len() as f64 || peak_path.abs() > NEAR_ZERO * capture.t_end() {
        return None;
    }
    // Above the background, of which a multiple is no threshold.
    let mut mean = smooth(mean);
    let dark = quiet_bins(&mean).map_or(0.0, |(_, level)| level);
    mean.iter_mut().for_each(|m| *m -= dark);
    // Where the background was taken off, noise leaves means around zero.
    let noise = capture.negatives().map_or(0.0, |n| (n.variance / (5 * peaks.len()) as f64).sqrt());
    // The valley is the lowest bin before the mean rises clearly above it.
    let mut valley = peak;
    let rises = |valley: usize, b: usize| mean[b] > 0.0 && mean[b] >= VALLEY * mean[valley].max(noise);
    let mut risen = false;
    for b in peak..bins {
        if mean[b] < mean[valley] {
            valley = b;
        } else if b > valley && rises(valley, b) {
            risen = true;
            break;
        }
    }
    let indirect = mean[valley..].iter().copied().fold(0.0, f64::max);
    if !risen || mean[peak] < STRONGER * indirect {
        return None;
    }
    let open = (peak..valley).find(|&b| mean[b] <= RESIDUE * indirect).unwrap_or(valley);
    let from = capture.t_start + open as f64 * capture.bin_width;
    let d = decimals(3, capture.unit());
    let reason = format!(
        "direct light: {:.0} % of the pairs peak within a bin of path {:.d$} m, {:.0} times above the signal \
         behind it; paths below {from:.d$} m are left out",
        100.0 * together as f64 / peaks.len() as f64,
        peak_path,
        mean[peak] / indirect
    );
    Some(AutoGate { gate: Gate { from, to: f64::INFINITY }, reason })
}

/// The strongest bin, `None` without signal.
pub(super) fn peak_bin(histogram: &[f32]) -> Option<usize> {
    let [_, most] = range_from([0.0; 2], histogram);
    histogram.iter().position(|count| *count == most).filter(|_| most > 0.0)
}

/// The mean histogram over all pairs, averaged over five bins so that single photons do not make valleys.
fn smooth(mean: &[f64]) -> Vec<f64> {
    (0..mean.len())
        .map(|b| {
            let window = &mean[b.saturating_sub(2)..(b + 3).min(mean.len())];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

/// Share of the light up to whose path bins are used.
const LIGHT: f64 = 0.98;
/// A mean that exceeds the background by this multiple of its noise is light.
const ABOVE_NOISE: f64 = 3.0;

/// The gate that ends where nearly all light has come back, whatever the length of the record. Light of paths below `after` is direct
/// light and does not count. `None` without bins that are dark enough to tell the background.
pub fn light_gate(capture: &Capture, after: Option<f64>) -> Option<AutoGate> {
    lit(capture, &capture.mean_histogram(), after)
}

/// [`light_gate`] by the mean histogram.
pub(super) fn lit(capture: &Capture, mean: &[f64], after: Option<f64>) -> Option<AutoGate> {
    let mean = smooth(mean);
    let (quiet, level) = quiet_bins(&mean)?;
    let variance = mean[quiet.clone()].iter().map(|m| (m - level).powi(2)).sum::<f64>() / quiet.len() as f64;
    let least = level + ABOVE_NOISE * variance.sqrt();
    let first = after.map_or(0, |after| bin_at(capture, after));
    let light = |b: usize| if mean[b] > least { mean[b] - level } else { 0.0 };
    let all: f64 = (first..mean.len()).map(light).sum();
    let mut sum = 0.0;
    let last = (first..mean.len()).find(|b| {
        sum += light(*b);
        sum >= LIGHT * all
    })?;
    let to = capture.edge(last + 1);
    let d = decimals(3, capture.unit());
    let reason = format!(
        "{:.0} % of the light has come back by path {to:.d$} m, and later bins are left out",
        100.0 * LIGHT
    );
    (all > 0.0 && last + 1 < mean.len())
        .then_some(AutoGate { gate: Gate { from: f64::NEG_INFINITY, to }, reason })
}

/// The first bin that does not begin before a path.
fn bin_at(capture: &Capture, path: f64) -> usize {
    ((path - capture.t_start) / capture.bin_width).ceil().clamp(0.0, capture.bins as f64) as usize
}

/// Share of the bins that the published gate drops at the start.
const PUBLISHED_START: f64 = 0.15;

/// The gate of the paper's code for real captures: it drops the first 15 % of the bins and keeps the window of half the
/// bins that holds the most counts. Without it, dark counts far behind the scene become bright far voxels, and the
/// scene, which is darker, is removed from the domain. Paths below `after` are direct light and do not count.
pub fn published_gate(capture: &Capture, after: Option<f64>) -> AutoGate {
    let bins = capture.bins;
    let mut sums = vec![0.0f64; bins + 1];
    // Sums, not means: sums of whole counts are exact, so equal windows stay equal.
    let mut counts = vec![0.0f64; bins];
    for histogram in capture.histograms.chunks_exact(bins) {
        for (m, &v) in counts.iter_mut().zip(histogram) {
            *m += f64::from(v);
        }
    }
    let direct = after.map_or(0, |after| bin_at(capture, after));
    let dropped = ((bins as f64 * PUBLISHED_START) as usize).max(direct).min(bins - 1);
    for b in 0..bins {
        sums[b + 1] = sums[b] + if b < dropped { 0.0 } else { counts[b] };
    }
    let length = (bins / 2).max(1);
    let held = |s: usize| sums[s + length] - sums[s];
    // The first of equal windows is taken, so that the choice does not depend on the order of comparison.
    let start =
        (0..=bins - length).rev().max_by(|a, b| held(*a).total_cmp(&held(*b))).unwrap_or(0).max(dropped);
    let from = capture.t_start + start as f64 * capture.bin_width;
    let to = capture.t_start + (start + length).min(bins) as f64 * capture.bin_width;
    let d = decimals(3, capture.unit());
    let reason = format!("the half of the bins with the most counts is used: paths {from:.d$} to {to:.d$} m");
    AutoGate { gate: Gate { from, to }, reason }
}
