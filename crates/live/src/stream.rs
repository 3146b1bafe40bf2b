//! Frames in a stream: a header and the counts, again and again. docs/batch-and-live.md describes the bytes.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::SyncSender;

use thirdbounce::{Error, Result};

/// The first bytes of every frame.
pub const MAGIC: [u8; 4] = *b"TBFR";

/// Version of the framing.
pub const VERSION: u16 = 1;

/// Bytes of a header.
pub const HEADER: usize = 28;

/// Set in `flags`: a byte for every pair follows the header, 1 if it was measured since the last frame, else 0.
const PARTIAL: u32 = 1;

/// The type of the counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CountFormat {
    /// 32-bit floats.
    Float,
    /// Unsigned numbers of 16 bits.
    Short,
    /// Unsigned numbers of 32 bits.
    Word,
}

/// What stands before the counts of a frame. All numbers are little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameHeader {
    /// Type of the counts: 0, 1, 2 in the order of [`CountFormat`].
    pub format: CountFormat,
    /// The sender's number of the frame.
    pub frame: u64,
    /// Pairs.
    pub pairs: u32,
    /// Bins of a histogram.
    pub bins: u32,
    /// Whether it says which pairs were measured.
    pub is_partial: bool,
}

/// A frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameCounts {
    /// The sender's number of it.
    pub frame: u64,
    /// `[pair * bins + bin]`.
    pub values: Vec<f32>,
    /// Which pairs were measured; `None`: all.
    pub measured: Option<Vec<bool>>,
}

/// A frame on its way to the session.
pub(crate) enum Arrived {
    /// Its name, and what differs from the scan.
    Counts(String, FrameCounts, Option<String>),
    Failed(Option<String>, Error),
    /// Frames that are left out.
    Skipped(u64),
    /// Names of files that are no frames.
    Others(Vec<String>),
}

fn wrong(what: impl Into<String>) -> Error {
    Error::input(
        what,
        "send frames as docs/batch-and-live.md says, with the pairs and bins of the scan; the stream is closed",
    )
}

/// Reads the next frame, which must have the given pairs and bins; `None` at the end of the stream.
///
/// # Errors
/// The stream ends within a frame, or the header is not one of such frames: nothing is known of the bytes behind it then.
pub fn read(from: &mut impl Read, [pairs, bins]: [usize; 2]) -> Result<Option<FrameCounts>> {
    let mut bytes = [0; HEADER];
    let got = fill(from, &mut bytes)?;
    if got == 0 {
        return Ok(None);
    }
    if got < HEADER {
        return Err(wrong(format!("the stream ends after {got} bytes of a header of {HEADER}")));
    }
    let header = FrameHeader::of(&bytes)?;
    if [header.pairs as usize, header.bins as usize] != [pairs, bins] {
        return Err(wrong(format!(
            "frame {} has {} pairs of {} bins, the scan {pairs} of {bins}",
            header.frame, header.pairs, header.bins
        )));
    }
    let mut part = |bytes: usize| -> Result<Vec<u8>> {
        let mut all = vec![0; bytes];
        match fill(from, &mut all)? {
            got if got < bytes => {
                Err(wrong(format!("the stream ends within frame {}: {got} of {bytes} bytes", header.frame)))
            }
            _ => Ok(all),
        }
    };
    let measured = match header.is_partial {
        true => Some(part(pairs)?.into_iter().map(|m| m != 0).collect()),
        false => None,
    };
    let values = header.format.values(&part(pairs * bins * header.format.bytes())?);
    Ok(Some(FrameCounts { frame: header.frame, values, measured }))
}

/// Writes a frame of 32-bit floats, `[pair * bins + bin]`.
///
/// # Errors
/// The target does not take it.
pub fn write(to: &mut impl Write, frame: u64, bins: usize, values: &[f32]) -> std::io::Result<()> {
    let (pairs, bins) = ((values.len() / bins) as u32, bins as u32);
    let header = FrameHeader { format: CountFormat::Float, frame, pairs, bins, is_partial: false };
    to.write_all(&header.bytes())?;
    to.write_all(&values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>())?;
    to.flush()
}

/// Reads until `bytes` are full or the stream ends; how many were there.
fn fill(from: &mut impl Read, bytes: &mut [u8]) -> Result<usize> {
    let mut got = 0;
    while got < bytes.len() {
        match from.read(&mut bytes[got..]) {
            Ok(0) => break,
            Ok(n) => got += n,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(wrong(format!("the stream cannot be read: {e}"))),
        }
    }
    Ok(got)
}

impl FrameHeader {
    fn of(bytes: &[u8; HEADER]) -> Result<FrameHeader> {
        let short = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let word = |at: usize| u32::from(short(at)) | u32::from(short(at + 2)) << 16;
        if bytes[..4] != MAGIC {
            return Err(wrong(format!("a frame begins with {:?}, not with {MAGIC:?} (TBFR)", &bytes[..4])));
        }
        if short(4) != VERSION {
            return Err(wrong(format!("a frame of version {}, this program reads {VERSION}", short(4))));
        }
        let format = match short(6) {
            0 => CountFormat::Float,
            1 => CountFormat::Short,
            2 => CountFormat::Word,
            other => return Err(wrong(format!("a frame of format {other}, known are 0 to 2"))),
        };
        let flags = word(24);
        if flags & !PARTIAL != 0 {
            return Err(wrong(format!("a frame with flags {flags:#x}, known is 1")));
        }
        let frame = u64::from(word(8)) | u64::from(word(12)) << 32;
        Ok(FrameHeader { format, frame, pairs: word(16), bins: word(20), is_partial: flags & PARTIAL != 0 })
    }

    /// Its bytes.
    pub fn bytes(&self) -> [u8; HEADER] {
        let mut all = [0; HEADER];
        all[..4].copy_from_slice(&MAGIC);
        all[4..6].copy_from_slice(&VERSION.to_le_bytes());
        all[6..8].copy_from_slice(&(self.format as u16).to_le_bytes());
        all[8..16].copy_from_slice(&self.frame.to_le_bytes());
        all[16..20].copy_from_slice(&self.pairs.to_le_bytes());
        all[20..24].copy_from_slice(&self.bins.to_le_bytes());
        all[24..].copy_from_slice(&u32::from(self.is_partial).to_le_bytes());
        all
    }
}

impl CountFormat {
    fn bytes(self) -> usize {
        if self == CountFormat::Short { 2 } else { 4 }
    }

    fn values(self, bytes: &[u8]) -> Vec<f32> {
        let words = bytes.as_chunks::<4>().0;
        match self {
            CountFormat::Float => words.iter().map(|w| f32::from_le_bytes(*w)).collect(),
            CountFormat::Short => {
                bytes.as_chunks::<2>().0.iter().map(|w| f32::from(u16::from_le_bytes(*w))).collect()
            }
            CountFormat::Word => words.iter().map(|w| u32::from_le_bytes(*w) as f32).collect(),
        }
    }
}

/// Begins to read the standard input.
pub fn begin_stdin(size: [usize; 2], give: SyncSender<Arrived>) -> Result<()> {
    begin(move || {
        let mut from = std::io::stdin().lock();
        loop {
            let arrived = match read(&mut from, size) {
                Ok(None) => return,
                Ok(Some(counts)) => Arrived::Counts(format!("frame-{}", counts.frame), counts, None),
                Err(error) => {
                    // The receiver may have gone.
                    let _ = give.send(Arrived::Failed(None, error));
                    return;
                }
            };
            if give.send(arrived).is_err() {
                return;
            }
        }
    })
}

pub(super) fn begin(work: impl FnOnce() + Send + 'static) -> Result<()> {
    let thread = std::thread::Builder::new().name("thirdbounce frames".into()).spawn(work);
    thread
        .map(drop)
        .map_err(|e| Error::memory(format!("a thread for frames does not start ({e})"), "close programs"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(frames: &[&[u8]]) -> Vec<u8> {
        frames.concat()
    }

    fn header(format: u16, pairs: u32, bins: u32, flags: u32) -> Vec<u8> {
        let mut all =
            FrameHeader { format: CountFormat::Float, frame: 7, pairs, bins, is_partial: false }.bytes();
        all[6..8].copy_from_slice(&format.to_le_bytes());
        all[24..].copy_from_slice(&flags.to_le_bytes());
        all.to_vec()
    }

    #[test]
    fn frames_of_every_format_are_read() {
        let mut bytes = vec![];
        write(&mut bytes, 3, 2, &[1.0, 2.5, -3.0, 4.0]).unwrap();
        bytes.extend(stream(&[&header(1, 2, 2, 0), &[1, 0, 2, 0, 3, 0, 0, 1]]));
        bytes.extend(stream(&[
            &header(2, 2, 2, 1),
            &[0, 1],
            &[1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 1, 0],
        ]));
        let mut from = &bytes[..];
        let mut next = || read(&mut from, [2, 2]).unwrap();
        assert_eq!(next(), Some(FrameCounts { frame: 3, values: vec![1.0, 2.5, -3.0, 4.0], measured: None }));
        assert_eq!(next().unwrap().values, [1.0, 2.0, 3.0, 256.0]);
        let partial = next().unwrap();
        assert_eq!(partial.values, [1.0, 2.0, 3.0, 65536.0]);
        assert_eq!(partial.measured, Some(vec![false, true]));
        assert_eq!(next(), None);
    }

    #[test]
    fn a_header_that_is_cut_or_lies_is_one_clear_error() {
        let whole = header(0, 2, 2, 0);
        for (bytes, words) in [
            (whole[..11].to_vec(), "ends after 11 bytes"),
            (whole.clone(), "0 of 16 bytes"),
            ([whole.clone(), vec![0; 9]].concat(), "9 of 16 bytes"),
            ([b"PK\x03\x04".to_vec(), whole[4..].to_vec()].concat(), "begins with"),
            ([whole[..4].to_vec(), vec![2, 0], whole[6..].to_vec()].concat(), "version 2"),
            (header(9, 2, 2, 0), "format 9"),
            // A lie about the size is no reason to allocate it.
            (header(0, u32::MAX, u32::MAX, 0), "4294967295 pairs"),
            (header(0, 2, 2, 6), "flags 0x6"),
        ] {
            let error = read(&mut &bytes[..], [2, 2]).unwrap_err();
            assert!(error.what.contains(words), "{words}: {error}");
        }
    }
}
