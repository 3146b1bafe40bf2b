//! A capture whose points are known and whose counts are still in the file, as one array [T, ...].

use glam::DVec3;

use super::frame::{self, Axes};
use super::scatter::{ArraySelection, Scattered, Shifts};
use super::variables::Variables;
use crate::conditioning::choose::{Measured, PairOrder, retain_rows, scan_of};
use crate::conditioning::{Conditioned, Conditioning, ConditioningStep};
use crate::error::{Error, Result};
use crate::{Capture, host};

/// A capture as a reader of its format finds it.
pub(super) enum ReadCapture<'f> {
    Whole(Capture),
    /// All but the counts.
    Unread(Unread<'f>),
}

/// A capture whose counts are not read yet.
pub(super) struct Unread<'f> {
    /// All but the counts, with the bins after the shift. Whether counts are whole is found when they are read.
    pub(super) outline: Capture,
    pub(super) file: &'f Variables,
    /// Name of the array [T, ...]; its first axis are the bins.
    pub(super) array: String,
    /// Bins of the array.
    pub(super) bins: usize,
    /// Where the histogram of each pair is: its position behind the first axis, in C order.
    pub(super) from: Vec<usize>,
    pub(super) shifts: Option<Shifts>,
}

impl<'f> Unread<'f> {
    /// A capture whose histograms are one array [T, ...], in the order of its pairs.
    pub(super) fn in_order(outline: Capture, file: &'f Variables, array: &str) -> Unread<'f> {
        let from = (0..outline.pair_count()).collect();
        Unread { bins: outline.bins, outline, file, array: array.into(), from, shifts: None }
    }

    /// A confocal scan of a flat wall whose counts are (d1, d2, t) in MATLAB, which is [T, d2, d1] in C order.
    ///
    /// # Errors
    /// `Kind::Input` if the array is missing or does not have three axes.
    pub(super) fn scanned(
        file: &'f Variables,
        name: &str,
        axes: Axes,
        wall: f64,
        bin_width: f64,
    ) -> Result<Unread<'f>> {
        let shape = file.counts_shape(name)?;
        let [bins, n2, n1] = shape[..] else {
            return Err(Error::input(
                format!("{name} has {} axes, not three (two of the scan, and the bins)", shape.len()),
                format!("store {name} in MATLAB as an array with two scan axes, then the bins"),
            ));
        };
        // The points of both sides, and their order.
        host::ask("the wall points", host::bytes(n1 * n2, 2 * size_of::<DVec3>() + 4 * size_of::<usize>()))?;
        let mut from = host::filled("the wall points", n1 * n2, 0)?;
        axes.pairs([n1, n2]).into_iter().enumerate().for_each(|(place, pair)| from[pair] = place);
        let scan = axes.scan([n1, n2]);
        let points = frame::lattice(scan, wall);
        let outline = Capture::new(scan, points.clone(), points, bins, bin_width, vec![]);
        Ok(Unread { from, ..Unread::in_order(outline, file, name) })
    }

    /// Puts the pairs of a lattice scan in our order: ix along +x, iy along +y.
    pub(super) fn in_our_order(self) -> Unread<'f> {
        match frame::order_of(&self.outline) {
            Some(PairOrder { pairs, scan }) => Unread {
                from: pairs.iter().map(|pair| self.from[*pair]).collect(),
                outline: self.outline.keep(&pairs, scan),
                ..self
            },
            None => self,
        }
    }

    /// Reads the counts that are kept after `steps`. The result is that of reading all counts, leaving out pairs that were
    /// not measured, and running the steps afterwards. `place` adds the file to its errors.
    ///
    /// # Errors
    /// Those of [`super::read_through`].
    pub(super) fn read(
        mut self,
        name: String,
        (steps, how): (&[ConditioningStep], &Conditioning),
        mut notes: Vec<String>,
        place: &dyn Fn(Error) -> Error,
    ) -> Result<Conditioned> {
        self.outline.name = name;
        let (of_outline, of_counts) = steps.split_at(steps.partition_point(|step| !step.counts));
        let chosen = |unread: &Self, measured: &[usize]| {
            let outline = Conditioned::begin(unread.listed(measured), 0, vec![]);
            outline.through(of_outline, how)
        };
        // Which pairs were measured is known when all counts were seen. Usually all were, and one reading is enough.
        let points = self.outline.laser.iter().zip(&self.outline.sensor);
        let known = points.enumerate().filter(|(_, (l, s))| !(l.is_nan() || s.is_nan()));
        let known: Vec<usize> = known.map(|(pair, _)| pair).collect();
        self.listed(&known).check_scan().map_err(place)?;
        let mut kept = chosen(&self, &known)?;
        let mut from = self.places(&kept, &known);
        let mut read = self.fill(&kept, &from).map_err(place)?;
        self.outline.integer_counts = read.whole;
        let seen: Vec<_> = self.from.iter().map(|place| read.seen[*place]).collect();
        let measured = Measured::of(&self.outline, &seen, how.keep_empty).map_err(place)?;
        notes.extend(self.shifts.as_ref().and_then(|shifts| (shifts.note)(shifts, read.late)));
        notes.extend(measured.notes);
        let counted = measured.pairs.iter().map(|pair| seen[*pair]);
        self.listed(&measured.pairs).check_seen(counted).map_err(place)?;
        if measured.pairs != known {
            let before = (std::mem::take(&mut from), kept.first_bin..kept.first_bin + kept.capture.bins);
            kept = chosen(&self, &measured.pairs)?;
            from = self.places(&kept, &measured.pairs);
            let bins = kept.first_bin..kept.first_bin + kept.capture.bins;
            read.histograms = match places_in(&before.0, &from).filter(|_| before.1 == bins) {
                Some(rows) => retain_rows(read.histograms, bins.len(), &rows),
                None => {
                    read.histograms = vec![];
                    self.fill(&kept, &from).map_err(place)?.histograms
                }
            };
        }
        kept.dropped = self.from.len() - measured.pairs.len();
        kept.notes.splice(0..0, notes);
        (kept.capture.histograms, kept.capture.integer_counts) = (read.histograms, read.whole);
        kept.with_faults(measured.faults).through(of_counts, how)
    }

    /// The outline of the measured pairs: a list if they are not some rows by some columns of the scan.
    fn listed(&self, measured: &[usize]) -> Capture {
        if measured.len() == self.from.len() {
            return self.outline.clone();
        }
        self.outline.keep(measured, scan_of(measured, &self.outline))
    }

    /// Where the histogram of each pair that is kept of the measured ones is.
    fn places(&self, kept: &Conditioned, measured: &[usize]) -> Vec<usize> {
        kept.pairs.iter().map(|pair| self.from[measured[*pair]]).collect()
    }

    fn fill(&self, kept: &Conditioned, from: &[usize]) -> Result<Scattered> {
        let wanted = ArraySelection {
            stored: [self.bins, self.from.len()],
            from,
            bins: kept.first_bin..kept.first_bin + kept.capture.bins,
            shifts: self.shifts.as_ref(),
        };
        self.file.scatter(&self.array, &wanted)
    }
}

/// The place of every element of `after` in `before`, if both are in one order.
fn places_in(before: &[usize], after: &[usize]) -> Option<Vec<usize>> {
    let mut rest = before.iter().enumerate();
    after.iter().map(|wanted| rest.find(|(_, from)| *from == wanted).map(|(row, _)| row)).collect()
}
