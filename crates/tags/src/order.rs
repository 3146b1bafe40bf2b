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
}

impl Record {
    pub(super) fn time(&self) -> i64 {
        match *self {
            Record::Sync { time } | Record::Photon { time, .. } | Record::Marker { time, .. } => time,
        }
    }
}

impl Order {
    #[inline]
    pub(super) fn push(&mut self, record: Record, hear: &mut impl FnMut(Record)) {
        let time = record.time();
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
