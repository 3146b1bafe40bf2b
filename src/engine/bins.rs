//! How many of a capture's bins a job takes as one.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::{Error, Result};

/// How many of the capture's bins are one for the solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Bins {
    /// As many as neither the maps' pixels nor the instrument's pulse tell apart. The paper's solver takes the
    /// capture's own bins.
    #[default]
    Auto,
    /// One: the capture's own bins. Voxels are then as deep as a bin, however wide they are.
    Native,
    /// This many.
    Sum(usize),
}

impl fmt::Display for Bins {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Bins::Auto => f.write_str("auto"),
            Bins::Native => f.write_str("native"),
            Bins::Sum(n) => write!(f, "{n}"),
        }
    }
}

impl FromStr for Bins {
    type Err = Error;

    fn from_str(text: &str) -> Result<Bins> {
        match (text.trim(), text.trim().parse()) {
            ("auto", _) => Ok(Bins::Auto),
            ("native", _) => Ok(Bins::Native),
            (_, Ok(n)) if n > 0 => Ok(Bins::Sum(n)),
            _ => Err(Error::options(
                format!("the bins are {text:?}"),
                "give auto, native, or how many neighbouring bins are one",
            )),
        }
    }
}

impl Serialize for Bins {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_read_as_they_are_written() {
        for bins in [Bins::Auto, Bins::Native, Bins::Sum(4)] {
            assert_eq!(bins.to_string().parse::<Bins>().unwrap(), bins);
        }
        for wrong in ["", "0", "-1", "1.5", "all"] {
            assert!(wrong.parse::<Bins>().is_err(), "{wrong:?}");
        }
    }
}
