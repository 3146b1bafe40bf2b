//! Numbers of a MATLAB v5 array, read one after the other, so that a large array need not be in memory.

use std::io::Read;

use crate::error::{Error, Result};
use crate::host;

/// Numbers that are decoded at a time.
const AT_ONCE: usize = 1 << 20;

/// The rest of an array's numbers.
pub(super) struct Numbers<'f> {
    bytes: Box<dyn Read + 'f>,
    /// The type of the stored numbers: a code of the format.
    kind: u32,
    big_endian: bool,
    left: usize,
}

/// The error of a damaged file.
pub(super) fn damaged(what: impl std::fmt::Display) -> Error {
    Error::input(
        format!("the MATLAB file cannot be read: {what}"),
        "the file is damaged or cut short: copy or download it again",
    )
}

impl<'f> Numbers<'f> {
    /// `count` numbers of a type, stored in `stored` bytes.
    ///
    /// # Errors
    /// `Kind::Input` if the type is not known or the bytes do not hold as many.
    pub(super) fn new(
        bytes: Box<dyn Read + 'f>,
        stored: usize,
        kind: u32,
        count: usize,
        big_endian: bool,
    ) -> Result<Numbers<'f>> {
        let numbers = Numbers { bytes, kind, big_endian, left: count };
        if numbers.size()?.checked_mul(count) != Some(stored) {
            return Err(damaged(format!("{stored} bytes do not hold {count} values")));
        }
        Ok(numbers)
    }

    /// Bytes of a number.
    fn size(&self) -> Result<usize> {
        match self.kind {
            1 | 2 => Ok(1),
            3 | 4 => Ok(2),
            5..=7 => Ok(4),
            9 | 12 | 13 => Ok(8),
            kind => Err(damaged(format!("its values are of the unknown type {kind}"))),
        }
    }

    /// The next `count` numbers, fewer at the end.
    ///
    /// # Errors
    /// `Kind::Input` if the file ends before, `Kind::Memory` if they do not fit.
    pub(super) fn next<T>(&mut self, count: usize, to: impl Fn(f64) -> T) -> Result<Vec<T>> {
        let count = count.min(self.left);
        let mut values = host::room("an array", count)?;
        let mut bytes = host::filled("a part of an array", count.min(AT_ONCE) * self.size()?, 0)?;
        while values.len() < count {
            let bytes = &mut bytes[..(count - values.len()).min(AT_ONCE) * self.size()?];
            self.bytes.read_exact(bytes).map_err(|e| match e.kind() {
                std::io::ErrorKind::UnexpectedEof => {
                    damaged(format!("an array ends {} values too early", self.left))
                }
                _ => damaged(e),
            })?;
            let before = values.len();
            self.decode(bytes, &to, &mut values);
            self.left -= values.len() - before;
        }
        Ok(values)
    }

    fn decode<T>(&self, bytes: &[u8], to: impl Fn(f64) -> T, values: &mut Vec<T>) {
        macro_rules! decode {
            ($type:ty) => {{
                let (stored, _) = bytes.as_chunks::<{ size_of::<$type>() }>();
                let big = self.big_endian;
                let value = |b: &[u8; size_of::<$type>()]| {
                    to(if big { <$type>::from_be_bytes(*b) } else { <$type>::from_le_bytes(*b) } as f64)
                };
                values.extend(stored.iter().map(value))
            }};
        }
        match self.kind {
            1 => decode!(i8),
            2 => decode!(u8),
            3 => decode!(i16),
            4 => decode!(u16),
            5 => decode!(i32),
            6 => decode!(u32),
            7 => decode!(f32),
            9 => decode!(f64),
            12 => decode!(i64),
            _ => decode!(u64),
        }
    }
}
