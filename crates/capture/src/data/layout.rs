//! What the arrays of a file hold, where the file does not say.

use std::fmt;

use crate::error::{Error, Result};

/// The bounces of a rendered capture that are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bounce {
    /// Bounce number n, from 2 on. 3 is wall, hidden scene, wall.
    Nth(usize),
    /// The sum of all bounces in the file.
    All,
}

impl Bounce {
    /// Reads `third`, `all` or a number from 2.
    ///
    /// # Errors
    /// `Kind::Options` for anything else.
    pub fn parse(text: &str) -> Result<Bounce> {
        match (text, text.parse()) {
            ("third", _) => Ok(Bounce::Nth(3)),
            ("all", _) => Ok(Bounce::All),
            (_, Ok(n)) if n >= 2 => Ok(Bounce::Nth(n)),
            _ => Err(Error::options(
                format!("the bounce {text:?} is not known"),
                "give third (wall, hidden scene, wall), all, or a number from 2",
            )),
        }
    }
}

impl fmt::Display for Bounce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Bounce::Nth(3) => f.write_str("third"),
            Bounce::Nth(n) => n.fmt(f),
            Bounce::All => f.write_str("all"),
        }
    }
}

/// The order of the axes of an array of counts: places of x, y and the bins, axis 0 is the slowest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AxisOrder([usize; 3]);

impl AxisOrder {
    /// Reads the letters x, y and t in the order of the axes, as the program that wrote the file shows them: `xyt`, `txy`.
    ///
    /// # Errors
    /// `Kind::Options` for anything else.
    pub fn parse(text: &str) -> Result<AxisOrder> {
        let place = |letter| text.find(letter).filter(|_| text.len() == 3);
        match (place('x'), place('y'), place('t')) {
            (Some(x), Some(y), Some(t)) => Ok(AxisOrder([x, y, t])),
            _ => Err(Error::options(
                format!("the axes {text:?} are not known"),
                "give the letters x, y and t in the order of the axes, such as xyt for counts [x, y, t]",
            )),
        }
    }
}

#[cfg(feature = "formats")]
impl AxisOrder {
    /// The bins at this axis in C order, then x before y.
    pub(crate) fn with_bins_at(t: usize) -> AxisOrder {
        let others = [[1, 2], [0, 2], [0, 1]][t];
        AxisOrder([others[0], others[1], t])
    }

    /// The same axes in C order; MATLAB shows them reversed.
    pub(crate) fn in_c_order(self, matlab: bool) -> AxisOrder {
        if matlab { AxisOrder(self.0.map(|place| 2 - place)) } else { self }
    }

    /// The axes of x, y and the bins.
    pub(crate) fn places(self) -> [usize; 3] {
        self.0
    }
}

impl fmt::Display for AxisOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letter = |axis: usize| ["x", "y", "t"].iter().zip(self.0).find(|row| row.1 == axis);
        (0..3).filter_map(letter).try_for_each(|(letter, _)| f.write_str(letter))
    }
}
