//! A file of time tags that an instrument is still writing: a capture after each pass of the scan.
//!
//! The file is read once, as it grows. A pass is whole when two points (or lines) of the next have begun, because instruments
//! write markers and photons a little out of order. Photons of one pass are in memory, 24 bytes each, and nothing else. The first
//! pass says where each point's path 0 is, and how many bins there are: later ones have the same.

use std::cell::Cell;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use super::collect::Filling;
use super::histogram::{bins, check, outline, widths, zeros};
use super::{Asked, Division, Event, Format, Scan, Survey, Tags, of_file};
use crate::capture::Capture;
use crate::error::{Error, Result};

/// Time between two looks at the end of the file.
const BETWEEN: Duration = Duration::from_millis(20);
/// So many points, lines or frames of the next pass have begun when a pass is taken.
const AHEAD: usize = 2;
/// Most photons of a pass: 3 GiB.
const MOST: usize = 1 << 27;

/// A file that waits at its end.
pub(super) struct Growing<'w> {
    pub(super) file: File,
    /// No more is read.
    pub(super) ended: &'w Cell<bool>,
    /// Called each time that nothing is left to read; the file ends where it breaks.
    pub(super) wait: &'w dyn Fn() -> ControlFlow<()>,
}

impl Read for Growing<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            if self.ended.get() {
                return Ok(0);
            }
            match self.file.read(buffer) {
                Ok(0) if (self.wait)().is_continue() => std::thread::sleep(BETWEEN),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                read => return read,
            }
        }
    }
}

/// Calls `hear` with the capture of each pass of the scan as the file grows, until `hear` or `wait` breaks; `wait` is called
/// while there is nothing to read. All captures have the pairs and bins of the first, whose points without direct light are left
/// out.
///
/// # Errors
/// Those of [`histogram()`](super::histogram()), as far as they concern one pass. `Kind::Options` for begins in a file, and for
/// histograms of the instrument, which do not grow.
pub fn passes(
    path: &Path,
    scan: &Scan,
    asked: &Asked,
    wait: &dyn Fn() -> ControlFlow<()>,
    hear: &mut dyn FnMut(Capture) -> ControlFlow<()>,
) -> Result<()> {
    check(scan, asked)?;
    let tags = Tags::open(path, &asked.inputs)?;
    if let Format::Arrays(_) = tags.format {
        let error = Error::options(
            "arrays of time tags are whole when they are written",
            "follow a dump, text or .ptu",
        );
        return Err(error.at(path.display()));
    }
    follow(&tags, scan, asked, wait, hear).map_err(|e| of_file(e, path))
}

fn follow(
    tags: &Tags,
    scan: &Scan,
    asked: &Asked,
    wait: &dyn Fn() -> ControlFlow<()>,
    hear: &mut dyn FnMut(Capture) -> ControlFlow<()>,
) -> Result<()> {
    let mut passes = Passes::new(tags, scan, asked)?;
    let (ended, mut wrong) = (Cell::new(false), None);
    tags.follow(&ended, wait, |event| {
        if ended.get() {
            return;
        }
        match passes.take(event) {
            Ok(None) => {}
            Ok(Some(capture)) => ended.set(hear(capture).is_break()),
            Err(error) => {
                wrong = Some(error);
                ended.set(true);
            }
        }
    })?;
    wrong.map_or(Ok(()), Err)
}

/// What is known of the pass that is measured.
struct Passes<'a> {
    tags: &'a Tags,
    scan: &'a Scan,
    asked: &'a Asked,
    division: Division,
    /// Points of a line, if lines are marked.
    per_line: Option<usize>,
    /// Channel, laser pulse and delay of photons, in the order of the file.
    photons: Vec<(i32, i64, i64)>,
    markers: Vec<(i64, u16)>,
    /// Markers or laser pulses that are awaited before a pass is looked at.
    begun: usize,
    /// The last laser pulse.
    last: i64,
    first: Option<First>,
}

/// What the first pass says for all.
struct First {
    detector: i32,
    cells: usize,
    zeros: Vec<f64>,
    direct: bool,
}

impl<'a> Passes<'a> {
    fn new(tags: &'a Tags, scan: &'a Scan, asked: &'a Asked) -> Result<Passes<'a>> {
        let division = asked.division.clone().or(Division::of_image(&tags.image)).ok_or_else(|| {
            Error::options(
                "it is not known which photons belong to which point",
                "name the marker of points or lines, or the laser pulses of a point",
            )
        })?;
        if let Division::Starts(_) = division {
            return Err(Error::options(
                "begins from a file do not say where a second pass begins",
                "name the marker of points or lines, or the laser pulses of a point",
            ));
        }
        let per_line = scan.per_line.or(tags.image.size[0]);
        let first = None;
        let (photons, markers) = (vec![], vec![]);
        Ok(Passes { tags, scan, asked, division, per_line, photons, markers, begun: 0, last: -1, first })
    }

    /// Takes an event; a capture if a pass is whole.
    fn take(&mut self, event: Event) -> Result<Option<Capture>> {
        let whole = match event {
            Event::Photon { channel, sync, delay } => {
                self.last = self.last.max(sync);
                let wanted = self.first.as_ref().map(|f| f.detector).or(self.asked.channel);
                if wanted.is_none_or(|number| number == channel) {
                    if self.photons.len() >= MOST {
                        return Err(Error::memory(
                            format!("a pass of the scan has more than {MOST} photons"),
                            "check which marker begins what, and the size of the scan",
                        ));
                    }
                    self.photons.push((channel, sync, delay));
                }
                match self.division {
                    Division::Pulses { each, before } => {
                        let round = each.saturating_mul(self.scan.points() as u64 + AHEAD as u64);
                        u64::try_from(self.last).is_ok_and(|last| last >= before.saturating_add(round))
                    }
                    _ => false,
                }
            }
            Event::Marker { bits, sync } => {
                self.last = self.last.max(sync);
                self.markers.push((sync, bits));
                self.begun += usize::from(self.division.begins(bits));
                self.begun >= self.count() + AHEAD
            }
        };
        if whole { self.cut() } else { Ok(None) }
    }

    /// Points or lines of a pass.
    fn count(&self) -> usize {
        match (&self.division, self.per_line) {
            (Division::Lines { .. }, Some(n)) => self.scan.points().div_ceil(n),
            _ => self.scan.points(),
        }
    }

    /// The capture of the pass that is whole; what belongs to the next stays.
    fn cut(&mut self) -> Result<Option<Capture>> {
        self.markers.sort_by_key(|marker| marker.0);
        let points = self.scan.points();
        // Behind a long pause there are many passes without light. They are taken one by one, as they are needed.
        let known = match self.division {
            Division::Pulses { each, before } => {
                let end = before.saturating_add(each.saturating_mul(points as u64));
                i64::try_from(end).unwrap_or(i64::MAX).min(self.last + 1)
            }
            _ => self.last + 1,
        };
        let survey = Survey {
            markers: self.markers.clone(),
            pulses: known,
            period: self.tags.period,
            ..Survey::default()
        };
        let spans = match self.division.spans(&survey, points, self.per_line, &mut vec![]) {
            // The file may begin within a round, and there may be more points or lines than the scan has.
            Err(_) if self.division.has_rounds() && self.begun < 3 * (self.count() + AHEAD) => {
                return Ok(None);
            }
            spans => spans?,
        };
        let end = match self.division {
            Division::Pulses { each, before } => {
                let end = before.saturating_add(each.saturating_mul(points as u64));
                self.division = Division::Pulses { each, before: end };
                i64::try_from(end).unwrap_or(i64::MAX)
            }
            // Where the point or line behind the pass begins, or the frame that it belongs to.
            _ => {
                let last = spans.get(points - 1).map_or(i64::MIN, |span| span.to - 1);
                let next = |bits: u16| self.division.begins(bits) || self.division.begins_round(bits);
                let behind = self.markers.iter().find(|(sync, bits)| *sync > last && next(*bits));
                behind.map_or(self.last, |marker| marker.0)
            }
        };
        let capture = self.capture(&spans[..points.min(spans.len())])?;
        self.photons.retain(|photon| photon.1 >= end);
        self.markers.retain(|marker| marker.0 >= end);
        self.begun = self.markers.iter().filter(|marker| self.division.begins(marker.1)).count();
        Ok(Some(capture))
    }

    fn capture(&mut self, spans: &[super::cuts::Span]) -> Result<Capture> {
        let (fine, ticks) = widths(self.asked.bin_width, self.tags.tick, &mut vec![])?;
        let (detector, cells) = match &self.first {
            Some(first) => (first.detector, first.cells),
            None => self.detector(fine)?,
        };
        let points = self.scan.points();
        let mut filling = Filling::new(spans, points, fine, cells, self.tags.length()?)?;
        let of_detector = self.photons.iter().filter(|photon| photon.0 == detector);
        of_detector.for_each(|&(_, sync, delay)| filling.add(sync, delay));
        let cells = filling.done(self.tags.tick);
        if self.first.is_none() {
            let (zeros, direct) = zeros(&cells, self.scan, self.asked, &mut vec![])?;
            self.first = Some(First { detector, cells: cells.cells, zeros, direct });
        }
        let Some(first) = &self.first else {
            return Err(Error::input("there is no first pass", "report this"));
        };
        let (outline, pair_of) = outline(self.scan, self.asked, &first.zeros, cells.width, &mut vec![])?;
        let mut capture = bins(&cells, (ticks / fine) as usize, &first.zeros, &pair_of, outline)?;
        capture.direct = first.direct.then_some(0.0);
        let measured: Vec<usize> =
            (0..capture.pair_count()).filter(|pair| !capture.histogram(*pair)[0].is_nan()).collect();
        if measured.len() < capture.pair_count() {
            capture = capture.keep(&measured, [measured.len(), 1]);
        }
        Ok(capture)
    }

    /// The detector, and cells for its longest delay, by the first pass.
    fn detector(&self, fine: i64) -> Result<(i32, usize)> {
        let mut channels: Vec<i32> = self.photons.iter().map(|photon| photon.0).collect();
        channels.sort_unstable();
        channels.dedup();
        let [channel] = channels[..] else {
            return Err(Error::options(
                match channels.len() {
                    0 => "the first pass of the scan has no photon".to_string(),
                    n => format!("{n} channels have photons: {channels:?}"),
                },
                "name the detector's channel",
            ));
        };
        let longest = self.photons.iter().map(|photon| photon.2).max().unwrap_or(0);
        let until = self.asked.until.map_or(i64::MAX, |until| (until / self.tags.tick).ceil() as i64 - 1);
        let cells = longest.min(until).max(0) / fine + 1;
        Ok((channel, cells as usize))
    }
}
