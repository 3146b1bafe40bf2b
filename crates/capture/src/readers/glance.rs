//! A look at counts that unpack to far more than the file: whether they hold any signal, before memory is taken for them.

use crate::error::{Error, Result};
use crate::host;

/// Compression ratio above which large counts are inspected first. Counts of a few photons are packed
/// about as tightly, so they are read twice.
const LOOKED_AT: u64 = 100;
/// A count of one byte takes four in memory, and twice that while it is scaled.
const IN_MEMORY: u64 = 8;
/// Counts that are looked at together.
pub(super) const AT_ONCE: usize = 1 << 20;

/// Whether counts of `size` bytes are inspected before they are kept, by their packed size.
pub(super) fn is_wanted(size: u64, packed: u64) -> bool {
    host::swells(size.saturating_mul(IN_MEMORY), packed, IN_MEMORY * LOOKED_AT)
}

/// What counts hold.
#[derive(Default)]
pub(super) struct Glance {
    above_zero: bool,
    infinite: Option<f32>,
}

impl Glance {
    pub(super) fn take(&mut self, counts: &[f32]) {
        self.above_zero |= counts.iter().any(|c| *c > 0.0);
        self.infinite = self.infinite.or_else(|| counts.iter().copied().find(|c| c.is_infinite()));
    }

    /// Refuses an array without signal.
    ///
    /// # Errors
    /// `Kind::Input`.
    pub(super) fn finish(self, name: &str) -> Result<()> {
        if let Some(count) = self.infinite {
            return Err(Error::input(
                format!("{name}: a count is {count}"),
                "counts must be finite: set unknown bins to 0 or drop the pair",
            ));
        }
        if self.above_zero {
            return Ok(());
        }
        Err(Error::input(
            format!("there is no signal: no count of {name} is above zero"),
            "check that the right file was given",
        ))
    }
}
