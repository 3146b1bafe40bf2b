//! PicoQuant's records of 32 bits.
//!
//! Source: "TTTR record format" (PicoQuant, PicoQuant-Time-Tagged-File-Format-Demos). Times are counted beyond the bits of a
//! record by records of overflow. Detectors count from 1, as the instruments' inputs are labelled; the files of newer
//! instruments store them from 0.

use std::io::Read;

use super::Record;
use crate::error::Result;

/// Bytes that show which records a file holds, and fewer records than say so.
const LOOKED_AT: u64 = 1 << 20;
const FEW: usize = 100;

/// The layout of the records of an instrument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RecordLayout {
    /// PicoHarp 300, T2: 28 bits of time.
    PicoT2,
    /// PicoHarp 300, T3: 16 bits of sync number, 12 of delay.
    PicoT3,
    /// HydraHarp and later, T2: 25 bits of time. An overflow is one period of `wrap`, or with `counted` as many as it says.
    T2 { wrap: i64, counted: bool },
    /// HydraHarp and later, T3: 10 bits of sync number, 15 of delay.
    T3 { counted: bool },
}

/// Times end here, so that sums of them stay numbers in damaged files, too. Real ones end long before.
const FARTHEST: i64 = 1 << 61;

/// What a record of 32 bits holds.
pub(super) enum Word {
    Record(Record),
    Overflow,
    Unknown,
}

/// Record types as files name them: number, instrument, layout.
const TYPES: [(i64, &str, RecordLayout); 12] = [
    (0x0001_0203, "PicoHarp 300, T2", RecordLayout::PicoT2),
    (0x0001_0303, "PicoHarp 300, T3", RecordLayout::PicoT3),
    (0x0001_0204, "HydraHarp 1, T2", RecordLayout::T2 { wrap: 33_552_000, counted: false }),
    (0x0001_0304, "HydraHarp 1, T3", RecordLayout::T3 { counted: false }),
    (0x0101_0204, "HydraHarp 2, T2", NEWER_T2),
    (0x0101_0304, "HydraHarp 2, T3", NEWER_T3),
    (0x0001_0205, "TimeHarp 260 N, T2", NEWER_T2),
    (0x0001_0305, "TimeHarp 260 N, T3", NEWER_T3),
    (0x0001_0206, "TimeHarp 260 P, T2", NEWER_T2),
    (0x0001_0306, "TimeHarp 260 P, T3", NEWER_T3),
    (0x0001_0207, "generic (MultiHarp, PicoHarp 330), T2", NEWER_T2),
    (0x0001_0307, "generic (MultiHarp, PicoHarp 330), T3", NEWER_T3),
];
const NEWER_T2: RecordLayout = RecordLayout::T2 { wrap: 1 << 25, counted: true };
const NEWER_T3: RecordLayout = RecordLayout::T3 { counted: true };

/// The instrument and the layout of a record type; `None` if it is not known.
pub(super) fn of_type(number: i64) -> Option<(&'static str, RecordLayout)> {
    // The specification names TimeHarp 260 in T2 with a leading 01 in one place.
    let number = if matches!(number, 0x0101_0205 | 0x0101_0206) { number & 0x00FF_FFFF } else { number };
    TYPES.into_iter().find(|t| t.0 == number).map(|(_, name, layout)| (name, layout))
}

impl RecordLayout {
    /// Whether records hold sync number and delay. Else they hold times of everything, the sync input's among them.
    pub(super) fn is_t3(self) -> bool {
        matches!(self, RecordLayout::PicoT3 | RecordLayout::T3 { .. })
    }

    /// Whether some of the first records are laser pulses of T2, which T3 files do not have. `None` for few records without any.
    pub(super) fn holds_syncs(self, file: &mut impl Read) -> Result<Option<bool>> {
        let mut block = vec![];
        file.take(LOOKED_AT).read_to_end(&mut block).map_err(super::unreadable)?;
        let is_sync = |word: u32| match self {
            RecordLayout::PicoT2 | RecordLayout::PicoT3 => word >> 28 == 0,
            _ => word >> 25 == 64,
        };
        let (words, _) = block.as_chunks::<4>();
        let syncs = words.iter().filter(|word| is_sync(u32::from_le_bytes(**word))).count();
        let held = syncs > words.len() / 1000;
        Ok((held || words.len() >= FEW).then_some(held))
    }

    /// What a record holds. `base` is the time of the overflows so far.
    #[inline(always)]
    pub(super) fn record(self, word: u32, base: &mut i64) -> Word {
        match self {
            RecordLayout::PicoT2 => pico_t2(word, base),
            RecordLayout::PicoT3 => pico_t3(word, base),
            RecordLayout::T2 { wrap, counted } => newer(word, base, [25, 0], wrap, counted),
            RecordLayout::T3 { counted } => newer(word, base, [10, 15], 1 << 10, counted),
        }
    }
}

/// PicoHarp T2.
#[inline(always)]
fn pico_t2(word: u32, base: &mut i64) -> Word {
    const WRAP: i64 = 210_698_240;
    let time = *base + i64::from(word & 0x0FFF_FFFF);
    match (word >> 28, word & 15) {
        (15, 0) => {
            *base = FARTHEST.min(*base + WRAP);
            Word::Overflow
        }
        // The marker's bits are also the lowest of its time.
        (15, bits) => Word::Record(Record::Marker { bits: bits as u16, time }),
        (0, _) => Word::Record(Record::Sync { time }),
        (channel @ 1..=4, _) => Word::Record(Record::Photon { channel: channel as i32, time, delay: 0 }),
        _ => Word::Unknown,
    }
}

/// PicoHarp T3.
#[inline(always)]
fn pico_t3(word: u32, base: &mut i64) -> Word {
    const WRAP: i64 = 1 << 16;
    let (time, delay) = (*base + i64::from(word & 0xFFFF), (word >> 16) & 0xFFF);
    match word >> 28 {
        15 if delay == 0 => {
            *base = FARTHEST.min(*base + WRAP);
            Word::Overflow
        }
        15 => Word::Record(Record::Marker { bits: delay as u16, time }),
        channel @ 1..=4 => Word::Record(Record::Photon { channel: channel as i32, time, delay }),
        _ => Word::Unknown,
    }
}

/// HydraHarp and later: a special bit, 6 bits of channel, a delay, a time. `bits` are those of time and delay; T2 has no delay.
#[inline(always)]
fn newer(word: u32, base: &mut i64, bits: [u32; 2], wrap: i64, counted: bool) -> Word {
    let low = i64::from(word & ((1 << bits[0]) - 1));
    let (time, channel) = (*base + low, (word >> 25) & 63);
    if word >> 31 == 0 {
        let delay = (word >> bits[0]) & ((1 << bits[1]) - 1);
        return Word::Record(Record::Photon { channel: channel as i32 + 1, time, delay });
    }
    match channel {
        63 => {
            // A count of 0 is an overflow of old firmware: one.
            *base = FARTHEST.min(*base + wrap * if counted { low.max(1) } else { 1 });
            Word::Overflow
        }
        0 if bits[1] == 0 => Word::Record(Record::Sync { time }),
        1..=15 => Word::Record(Record::Marker { bits: channel as u16, time }),
        _ => Word::Unknown,
    }
}
