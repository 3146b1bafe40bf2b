//! The second pass over a file of time tags: photons into cells of delay, point by point.

use super::cuts::{Cuts, NONE, Span};
use super::stored::InstrumentHistograms;
use super::{Event, Tags};
use crate::error::{Error, Result};
use crate::host;

/// Counts of each point by delay.
#[derive(Debug, Default)]
pub(super) struct PointCounts {
    /// `[point * cells + cell]`.
    pub counts: Vec<u32>,
    /// Cells of a point.
    pub cells: usize,
    /// Seconds of a cell.
    pub width: f64,
    /// Laser pulses of each point, if known.
    pub pulses: Option<Vec<u64>>,
    /// Photons of the detector that belong to no point.
    pub outside: u64,
    /// Photons behind the last cell.
    pub late: u64,
}

/// Maximum ratio of large histograms to the bytes of the file. Those of a few photons with late delays take more.
const OF_FILE: u64 = 256;

/// An empty list with room for the counts of a file of this size.
fn room(points: usize, cells: usize, file: u64) -> Result<Vec<u32>> {
    let what = format!("the histograms of {points} points and {cells} cells of delay");
    let all = points.saturating_mul(cells);
    if host::swells(host::bytes(all, size_of::<u32>()), file, OF_FILE) {
        return Err(Error::memory(
            format!("{what} are far larger than the file: a photon came very late after its laser pulse"),
            "choose an earlier last delay (until), or wider bins",
        ));
    }
    host::filled(&what, all, 0).map_err(|e| e.advised("choose an earlier last delay (until), or wider bins"))
}

impl PointCounts {
    /// The photons of a detector. `ticks` ticks are a cell.
    pub(super) fn of_tags(
        tags: &Tags,
        detector: i32,
        spans: &[Span],
        points: usize,
        ticks: i64,
        cells: usize,
    ) -> Result<PointCounts> {
        let (cuts, pulses) = Cuts::of(spans, points);
        let mut counts = room(points, cells, tags.length()?)?;
        // A division takes longer than all the rest; most files have a power of two.
        let shift = (ticks & (ticks - 1) == 0).then(|| ticks.trailing_zeros());
        let (mut at, mut outside, mut late) = (0, 0, 0);
        tags.events(|event| {
            let Event::Photon { channel, sync, delay } = event else { return };
            if channel != detector {
                return;
            }
            let point = cuts.point(sync, &mut at);
            if point == NONE {
                outside += 1;
                return;
            }
            let cell = shift.map_or_else(|| delay / ticks, |bits| delay >> bits) as usize;
            if cell >= cells {
                late += 1;
                return;
            }
            let count = &mut counts[point as usize * cells + cell];
            *count = count.saturating_add(1);
        })?;
        Ok(PointCounts {
            counts,
            cells,
            width: ticks as f64 * tags.tick,
            pulses: Some(pulses),
            outside,
            late,
        })
    }

    /// The histograms of an instrument. `ticks` bins are a cell; those later than `last` seconds are left out.
    pub(super) fn of_stored(
        stored: &InstrumentHistograms,
        ticks: usize,
        last: Option<f64>,
    ) -> Result<PointCounts> {
        PointCounts::of_counts(stored, &stored.counts, ticks, last)
    }

    /// The same of other counts of its points and bins.
    pub(super) fn of_counts(
        stored: &InstrumentHistograms,
        all: &[u32],
        ticks: usize,
        last: Option<f64>,
    ) -> Result<PointCounts> {
        let InstrumentHistograms { tick, bins, .. } = stored;
        let used = last.map_or(*bins, |last| ((last / tick).ceil().max(1.0) as usize).min(*bins));
        let cells = used.div_ceil(ticks);
        let mut counts = room(all.len() / bins, cells, u64::MAX)?;
        let mut late = 0;
        for (from, to) in all.chunks_exact(*bins).zip(counts.chunks_exact_mut(cells)) {
            for (from, to) in from[..used].chunks(ticks).zip(to) {
                *to = from.iter().fold(0, |sum, n| sum.saturating_add(*n));
            }
            late += from[used..].iter().map(|n| u64::from(*n)).sum::<u64>();
        }
        Ok(PointCounts { counts, cells, width: ticks as f64 * tick, pulses: None, outside: 0, late })
    }

    /// The counts of a point.
    pub(super) fn of(&self, point: usize) -> &[u32] {
        &self.counts[point * self.cells..(point + 1) * self.cells]
    }

    /// Number of points.
    pub(super) fn points(&self) -> usize {
        self.counts.len() / self.cells.max(1)
    }

    /// All counts.
    pub(super) fn total(&self) -> u64 {
        self.counts.iter().map(|n| u64::from(*n)).sum()
    }
}
