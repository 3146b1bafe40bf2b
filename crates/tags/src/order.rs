//! Tags in the order of their times.

use super::{Passed, Record};
use crate::error::{Error, Result};

/// A tag may come this many tags too late.
const WINDOW: usize = 4096;
/// Largest share of tags that come later than that.
const MOST_LATE: u64 = 1000;

/// Tags that are held back until no earlier one is expected.
#[derive(Debug, Default)]
pub(super) struct Order {
    held: Vec<Record>,
    newest: Option<i64>,
    passed_on: Option<i64>,
    moved: u64,
    late: u64,
    unwrap: Unwrap,
}

/// Fewer tags, and a smaller range of a counter, prove nothing.
const LEAST_TAGS: i64 = 64;
const LEAST_RANGE: i64 = 1 << 16;
/// Largest distance of a counter from its end before it begins again, and from 0 after that, over the mean interval of tags.
const NEAR: i64 = 32;

/// Times of a counter that begins again at 0 once it has reached a power of two.
#[derive(Debug)]
pub(super) struct Unwrap {
    /// Ticks of a unit of the counter.
    unit: i64,
    /// Ticks until it begins again, once that was seen, and how many of them are over.
    range: Option<i64>,
    base: i64,
    wraps: u64,
    /// The first and the newest time as stored, and tags.
    first: Option<i64>,
    newest: i64,
    tags: i64,
}

impl Default for Unwrap {
    fn default() -> Unwrap {
        Unwrap::of_unit(1)
    }
}

impl Unwrap {
    pub(super) fn of_unit(unit: i64) -> Unwrap {
        Unwrap { unit, range: None, base: 0, wraps: 0, first: None, newest: i64::MIN, tags: 0 }
    }

    /// The time since the counter was 0 first.
    #[inline]
    pub(super) fn time(&mut self, stored: i64) -> i64 {
        let first = *self.first.get_or_insert(stored);
        if stored < self.newest && self.range.is_none() {
            self.range = self.range(stored, first);
        }
        self.tags += 1;
        if let Some(range) = self.range {
            if stored < self.newest - range / 2 {
                self.base = self.base.saturating_add(range);
                self.wraps += 1;
                self.newest = stored;
            } else if stored > self.newest.saturating_add(range / 2) {
                // One that comes late, from before the counter began again.
                return stored.saturating_add(self.base - range);
            }
        }
        self.newest = self.newest.max(stored);
        stored.saturating_add(self.base)
    }

    /// The range of the counter, if it begins again at this time.
    fn range(&self, stored: i64, first: i64) -> Option<i64> {
        let units =
            u64::try_from(self.newest / self.unit).ok()?.checked_add(1)?.checked_next_power_of_two()?;
        let range = i64::try_from(units).ok()?.checked_mul(self.unit)?;
        let near = (self.newest.saturating_sub(first) / self.tags.max(1)).saturating_mul(NEAR);
        let is_one = self.tags >= LEAST_TAGS
            && units as i64 >= LEAST_RANGE
            && near < range / 8
            && range - self.newest <= near
            && (0..=near).contains(&stored);
        is_one.then_some(range)
    }

    fn note(&self) -> Option<String> {
        let range = self.range?;
        let units = range / self.unit;
        Some(format!(
            "times begin again at 0 after {units} (2^{}), {} times: the counter's range is added each time",
            units.ilog2(),
            self.wraps
        ))
    }
}

/// The record at another time.
fn at(record: Record, time: i64) -> Record {
    match record {
        Record::Sync { .. } => Record::Sync { time },
        Record::Photon { channel, delay, .. } => Record::Photon { channel, time, delay },
        Record::Marker { bits, .. } => Record::Marker { bits, time },
    }
}

impl Record {
    pub(super) fn time(&self) -> i64 {
        match *self {
            Record::Sync { time } | Record::Photon { time, .. } | Record::Marker { time, .. } => time,
        }
    }
}

impl Order {
    /// Tags whose counter has units of `unit` ticks.
    pub(super) fn of_unit(unit: i64) -> Order {
        Order { unwrap: Unwrap::of_unit(unit), ..Order::default() }
    }

    #[inline]
    pub(super) fn push(&mut self, record: Record, hear: &mut impl FnMut(Record)) {
        let time = self.unwrap.time(record.time());
        let record = at(record, time);
        self.moved += u64::from(self.newest > Some(time));
        self.late += u64::from(self.passed_on > Some(time));
        self.newest = self.newest.max(Some(time));
        self.held.push(record);
        if self.held.len() == 2 * WINDOW {
            self.pass_on(WINDOW, hear);
        }
    }

    fn pass_on(&mut self, count: usize, hear: &mut impl FnMut(Record)) {
        self.held.sort_by_key(Record::time);
        self.passed_on = self.held[..count].last().map(Record::time).max(self.passed_on);
        self.held.drain(..count).for_each(hear);
    }

    /// Passes the last tags on and reports those that were out of order.
    ///
    /// # Errors
    /// `Kind::Input` if many came too late to be put in order.
    pub(super) fn end(mut self, passed: &mut Passed, hear: &mut impl FnMut(Record)) -> Result<()> {
        self.pass_on(self.held.len(), hear);
        passed.notes.extend(self.unwrap.note());
        if MOST_LATE * self.late > passed.records {
            return Err(Error::input(
                format!(
                    "the tags are not in the order of time: {} of {} come more than {WINDOW} tags too late, as in a file sorted by \
                     channel",
                    self.late, passed.records
                ),
                "sort all tags by time, channels and times alike, and write the file again",
            ));
        }
        if self.moved > 0 {
            passed.notes.push(format!("{} tags were out of order and are put in order", self.moved));
        }
        Ok(())
    }
}
