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
    let mut missed = 0;
    let rest = blocks::<16>(&mut file, |tag| {
        passed.records += 1;
        let [kind, _, m0, m1, c0, c1, c2, c3, time @ ..] = *tag;
        match kind {
            0 => hear(inputs.record(i32::from_le_bytes([c0, c1, c2, c3]), i64::from_le_bytes(time))),
            1..=3 => missed += 1,
            4 => missed += u64::from(u16::from_le_bytes([m0, m1])),
            _ => passed.unknown += 1,
        }
    })?;
    if missed > 0 {
        passed.notes.push(format!("the instrument missed {missed} events or more: it could not keep up"));
    }
    if rest > 0 {
        passed.notes.push(cut_record(rest));
    }
    Ok(())
}
