//! Tags of 16 bytes, as Swabian's Time Tagger passes them to measurements and its `Dump` writes them.
//!
//! Source: the struct `Tag` of the Time Tagger C++ API manual. Little endian: type (uint8; 0 a tag, 1 an error, 2 and 3 the
//! begin and end of an overflow, 4 missed events), a reserved byte, number of missed events (uint16), channel (int32), time
//! in picoseconds (int64).

use std::io::Read;

use super::{Inputs, Passed, Record, blocks, cut_record};
use crate::error::Result;

/// Calls `hear` with every tag.
pub(super) fn read(
    mut file: impl Read,
    inputs: &Inputs,
    passed: &mut Passed,
    mut hear: impl FnMut(Record),
) -> Result<()> {
    let mut kinds = Kinds::default();
    let rest = blocks::<16>(&mut file, |tag| {
        passed.records += 1;
        let [kind, _, m0, m1, c0, c1, c2, c3, time @ ..] = *tag;
        if kinds.take(kind, u64::from(u16::from_le_bytes([m0, m1])), passed) {
            hear(inputs.record(i32::from_le_bytes([c0, c1, c2, c3]), i64::from_le_bytes(time)));
        }
    })?;
    kinds.tell(passed);
    if rest > 0 {
        passed.notes.push(cut_record(rest));
    }
    Ok(())
}

/// Records that are no tags: events that the instrument missed.
#[derive(Default)]
pub(super) struct Kinds {
    missed: u64,
}

impl Kinds {
    /// Whether a record of this type is a tag. `missed` are its missed events.
    #[inline]
    pub(super) fn take(&mut self, kind: u8, missed: u64, passed: &mut Passed) -> bool {
        match kind {
            0 => return true,
            1..=3 => self.missed += 1,
            4 => self.missed = self.missed.saturating_add(missed),
            _ => passed.unknown += 1,
        }
        false
    }

    /// Tells what was missed.
    pub(super) fn tell(self, passed: &mut Passed) {
        if self.missed > 0 {
            passed
                .notes
                .push(format!("the instrument missed {} events or more: it could not keep up", self.missed));
        }
    }
}
