//! A capture whose points are known and whose counts are still in the file, as one array [T, ...].

use std::ops::Range;

use glam::DVec3;

use super::frame::{self, Axes};
use super::opened::{Opened, Prepare};
use super::scatter::{Scattered, Shifts, Wanted};
use super::variables::Variables;
use crate::conditioning::choose::{Measured, Order, retain_rows};
use crate::error::{Error, Result};
use crate::{Capture, Keep, Turn, host};

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

/// The part of a capture that is kept.
struct Chosen {
    outline: Capture,
    from: Vec<usize>,
    bins: Range<usize>,
    notes: Vec<String>,
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
            Some(Order { pairs, scan }) => Unread {
                from: pairs.iter().map(|pair| self.from[*pair]).collect(),
                outline: self.outline.keep(&pairs, scan),
                ..self
            },
            None => self,
        }
    }

    /// Reads the counts that are kept. The result is that of reading all counts, leaving out pairs that were not
    /// measured, and choosing pairs and bins afterwards. `place` adds the file to its errors.
    ///
    /// # Errors
    /// Those of [`super::read_prepared`].
    pub(super) fn read(
        mut self,
        name: String,
        keep: &Keep,
        turn: Turn,
        prepare: &mut Prepare,
        mut notes: Vec<String>,
        place: &dyn Fn(Error) -> Error,
    ) -> Result<Opened> {
        self.outline.name = name;
        // Which pairs were measured is known when all counts were seen. Usually all were, and one reading is enough.
        let points = self.outline.laser.iter().zip(&self.outline.sensor);
        let known = points.enumerate().filter(|(_, (l, s))| !(l.is_nan() || s.is_nan()));
        let known: Vec<usize> = known.map(|(pair, _)| pair).collect();
        self.listed(&known).check_scan().map_err(place)?;
        let mut chosen = self.choose(&known, keep, turn, prepare)?;
        let mut read = self.fill(&chosen).map_err(place)?;
        self.outline.integer_counts = read.whole;
        let seen: Vec<_> = self.from.iter().map(|place| read.seen[*place]).collect();
        let measured = Measured::of(&self.outline, &seen).map_err(place)?;
        notes.extend(self.shifts.as_ref().and_then(|shifts| (shifts.note)(shifts, read.late)));
        notes.extend(measured.notes);
        let counted = measured.pairs.iter().map(|pair| seen[*pair]);
        self.listed(&measured.pairs).check_seen(counted).map_err(place)?;
        if measured.pairs != known {
            let before = std::mem::replace(&mut chosen, self.choose(&measured.pairs, keep, turn, prepare)?);
            read.histograms = match places_in(&before, &chosen) {
                Some(rows) => retain_rows(read.histograms, chosen.bins.len(), &rows),
                None => {
                    read.histograms = vec![];
                    self.fill(&chosen).map_err(place)?.histograms
                }
            };
        }
        notes.extend(chosen.notes);
        let dropped = self.from.len() - measured.pairs.len();
        let capture = Capture {
            t_start: chosen.outline.edge(chosen.bins.start),
            bins: chosen.bins.len(),
            histograms: read.histograms,
            integer_counts: read.whole,
            ..chosen.outline
        };
        Ok(Opened { capture, dropped, notes })
    }

    /// The outline of the measured pairs: a list if any pair is missing.
    fn listed(&self, measured: &[usize]) -> Capture {
        if measured.len() == self.from.len() {
            return self.outline.clone();
        }
        self.outline.keep(measured, [measured.len(), 1])
    }

    /// Chooses pairs and bins, if only these pairs were measured.
    fn choose(&self, measured: &[usize], keep: &Keep, turn: Turn, prepare: &mut Prepare) -> Result<Chosen> {
        let mut outline = self.listed(measured);
        let mut from: Vec<usize> = measured.iter().map(|pair| self.from[*pair]).collect();
        let mut notes = Vec::from_iter(turn.note());
        outline.turn_points(turn);
        if let Some(order) = outline.turned_order(turn) {
            outline = outline.keep(&order.pairs, order.scan);
            from = order.pairs.iter().map(|pair| from[*pair]).collect();
        }
        prepare(&mut outline, &mut notes)?;
        let mut taken = |pairs: &[usize]| from = pairs.iter().map(|pair| from[*pair]).collect();
        outline = keep.choose(outline, &mut notes, &mut taken)?;
        let bins = keep.gate.map_or(Ok(0..outline.bins), |gate| outline.bins_of(gate))?;
        Ok(Chosen { outline, from, bins, notes })
    }

    fn fill(&self, chosen: &Chosen) -> Result<Scattered> {
        let wanted = Wanted {
            stored: [self.bins, self.from.len()],
            from: &chosen.from,
            bins: chosen.bins.clone(),
            shifts: self.shifts.as_ref(),
        };
        self.file.scatter(&self.array, &wanted)
    }
}

/// The place of every pair of `after` in `before`, if both are in one order and of the same bins.
fn places_in(before: &Chosen, after: &Chosen) -> Option<Vec<usize>> {
    let mut rest = before.from.iter().enumerate();
    let places = after.from.iter().map(|wanted| rest.find(|(_, from)| *from == wanted).map(|(row, _)| row));
    places.collect::<Option<Vec<usize>>>().filter(|_| before.bins == after.bins)
}
