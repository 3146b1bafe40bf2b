//! Selects pairs of a capture: thinning, random subsets, removal of pairs without data.

use glam::DVec3;
use rand::SeedableRng;
use rand::seq::index;
use rand_pcg::Pcg64;

use super::lattice::Lattice;
use super::{Capture, PairKind};
use crate::error::{Error, Result};

/// A pair without a count is dead if half of the pairs have more counts than this. By chance a pair would be empty once
/// in e^20 pairs.
const DEAD_BELOW: f64 = 20.0;

impl Capture {
    /// Keeps every `n`th scan point in x and in y (`ix % n == 0`, `iy % n == 0`), with their histograms. In an
    /// exhaustive capture the laser points and the sensor points are thinned separately, each on their lattice, or
    /// along their list if they form no lattice.
    ///
    /// # Errors
    /// `Kind::Options` if `n` is 0, or if the scan is a list of points that form no row.
    pub fn stride(&self, n: usize) -> Result<Capture> {
        if n == 0 {
            return Err(Error::options("a stride of 0 keeps no scan point", "use 1 to keep every point"));
        }
        if n == 1 {
            return Ok(self.clone());
        }
        let [nx, ny] = self.scan;
        if let PairKind::Exhaustive { .. } = self.pair_kind() {
            return Ok(self.stride_exhaustive(n));
        }
        if ny == 1 && nx > 1 && !self.resolution().contains(&1) {
            return Err(Error::options(
                format!(
                    "a stride of {n} was given, but the scan is a list of {nx} pairs, not rows and columns"
                ),
                format!("use a random subset of {} pairs instead", nx.div_ceil(n.saturating_mul(n))),
            ));
        }
        let kept: Vec<usize> =
            (0..nx).step_by(n).flat_map(|ix| (0..ny).step_by(n).map(move |iy| ix * ny + iy)).collect();
        Ok(self.keep(&kept, [nx.div_ceil(n), ny.div_ceil(n)]))
    }

    fn stride_exhaustive(&self, n: usize) -> Capture {
        let Some(product) = self.product() else { return self.clone() };
        let thin = |points: &[DVec3]| -> Vec<usize> {
            match Lattice::of(points).places {
                Some(at) => (0..points.len()).filter(|&k| at[k].iter().all(|i| i % n == 0)).collect(),
                None => (0..points.len()).step_by(n).collect(),
            }
        };
        let (scanned, other) = (thin(&product.scanned), thin(&product.other));
        let pair = |o: &usize, a: &usize| product.pair_of[o * product.scanned.len() + a];
        // Laser point by laser point, each with all sensor points.
        let kept: Vec<usize> = if product.laser_scanned {
            scanned.iter().flat_map(|a| other.iter().map(move |o| pair(o, a))).collect()
        } else {
            other.iter().flat_map(|o| scanned.iter().map(move |a| pair(o, a))).collect()
        };
        let (lasers, sensors) =
            if product.laser_scanned { (scanned.len(), other.len()) } else { (other.len(), scanned.len()) };
        self.keep(&kept, [lasers, sensors])
    }

    /// Keeps `count` pairs in their order, drawn at random by `seed`. The scan becomes a list.
    ///
    /// # Errors
    /// `Kind::Options` if `count` is 0 or larger than the number of pairs.
    pub fn subset(&self, count: usize, seed: u64) -> Result<Capture> {
        let pairs = self.pair_count();
        if count == 0 || count > pairs {
            return Err(Error::options(
                format!("a subset of {count} pairs of {pairs} is not possible"),
                format!("give a number of pairs from 1 to {pairs}"),
            ));
        }
        if count == pairs {
            return Ok(self.clone());
        }
        let mut kept = index::sample(&mut Pcg64::seed_from_u64(seed), pairs, count).into_vec();
        kept.sort_unstable();
        Ok(self.keep(&kept, [count, 1]))
    }

    /// Leaves out the pairs that were not measured: pairs whose laser or sensor point is NaN, and pairs whose histogram
    /// is NaN in every bin. If the counts are whole and half of the pairs have more than 20, pairs without a single
    /// count are left out too. If any pair is left out, the scan becomes a list. Returns the capture, the number of
    /// pairs left out, and sentences that say why.
    ///
    /// # Errors
    /// `Kind::Input` if no pair is left.
    pub fn without_missing(self) -> Result<(Capture, usize, Vec<String>)> {
        let missing = self.missing();
        let mut notes = Vec::new();
        let mut gone = 0;
        let mut tell = |fault: Fault, why: &str| {
            let count = missing.iter().filter(|m| **m == Some(fault)).count();
            if count > 0 {
                notes.push(format!("{count} of {} pairs are left out: {why}", missing.len()));
            }
            gone += count;
        };
        tell(Fault::Point, "their laser or sensor point is not a number");
        tell(Fault::Histogram, "their histogram is not a number in any bin");
        tell(Fault::Dead, "they have not a single count, but half of the pairs have more than 20");
        if gone == 0 {
            return Ok((self, 0, notes));
        }
        if gone == missing.len() {
            return Err(Error::input(
                format!("no pair has both points and counts: all {gone} pairs are left out"),
                "check that the file holds the histograms and wall points of the same measurement",
            ));
        }
        let kept: Vec<usize> = (0..missing.len()).filter(|&p| missing[p].is_none()).collect();
        Ok((self.keep(&kept, [kept.len(), 1]), gone, notes))
    }

    /// Why each pair counts as not measured; `None` for measured pairs.
    fn missing(&self) -> Vec<Option<Fault>> {
        // If the lengths do not agree, the check reports it.
        let pairs = self.laser.len();
        if self.bins == 0 || self.sensor.len() != pairs || self.histograms.len() / self.bins != pairs {
            return vec![None; pairs];
        }
        let totals: Vec<f64> =
            self.histograms.chunks_exact(self.bins).map(|h| h.iter().map(|&v| f64::from(v)).sum()).collect();
        let mut sorted: Vec<f64> = totals.iter().copied().filter(|t| t.is_finite()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let dark = self.integer_counts && median > DEAD_BELOW;
        let dead = |pair: usize| self.histogram(pair).iter().all(|v| *v == 0.0);
        (0..pairs)
            .map(|pair| {
                if self.laser[pair].is_nan() || self.sensor[pair].is_nan() {
                    Some(Fault::Point)
                } else if totals[pair].is_nan() && self.histogram(pair).iter().all(|v| v.is_nan()) {
                    Some(Fault::Histogram)
                } else if dark && totals[pair] == 0.0 && dead(pair) {
                    Some(Fault::Dead)
                } else {
                    None
                }
            })
            .collect()
    }

    fn histogram(&self, pair: usize) -> &[f32] {
        &self.histograms[pair * self.bins..(pair + 1) * self.bins]
    }

    /// The given pairs in the given order, as a scan of that shape.
    pub(super) fn keep(&self, kept: &[usize], scan: [usize; 2]) -> Capture {
        let pick = |points: &[DVec3]| kept.iter().map(|&p| points[p]).collect::<Vec<_>>();
        Capture {
            name: self.name.clone(),
            scan,
            laser: pick(&self.laser),
            sensor: pick(&self.sensor),
            laser_normal: self.laser_normal.as_deref().map(pick),
            sensor_normal: self.sensor_normal.as_deref().map(pick),
            histograms: kept.iter().flat_map(|&p| self.histogram(p)).copied().collect(),
            pulse: self.pulse.clone(),
            ..*self
        }
    }
}

/// Why a pair was not measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    Point,
    Histogram,
    Dead,
}
