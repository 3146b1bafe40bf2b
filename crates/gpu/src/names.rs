//! Typed names of buffers, kernels and constants: undeclared names do not compile.

use std::fmt;

/// A buffer name, also the name of the block that kernels bind it to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Buffer {
    name: &'static str,
    at: Option<u16>,
}

impl Buffer {
    /// The buffer of that name.
    pub const fn named(name: &'static str) -> Buffer {
        Buffer { name, at: None }
    }

    /// One of several buffers of that name, e.g. one per level. Displayed as `name_index`.
    pub const fn at(self, index: u16) -> Buffer {
        Buffer { name: self.name, at: Some(index) }
    }

    /// The common name, without an index.
    pub const fn name(self) -> &'static str {
        self.name
    }

    /// The common name of indexed buffers.
    pub const fn family(self) -> Buffer {
        Buffer { name: self.name, at: None }
    }
}

impl fmt::Display for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at {
            None => f.pad(self.name),
            Some(index) => f.pad(&format!("{}_{index}", self.name)),
        }
    }
}

/// A kernel name used by schedules, labels and timelines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Kernel(&'static str);

impl Kernel {
    /// The kernel of that name.
    pub const fn named(name: &'static str) -> Kernel {
        Kernel(name)
    }

    /// The name.
    pub const fn name(self) -> &'static str {
        self.0
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.0)
    }
}

/// Name of a specialization constant in the sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Constant(&'static str);

impl Constant {
    /// The constant of that name.
    pub const fn named(name: &'static str) -> Constant {
        Constant(name)
    }

    /// The name.
    pub const fn name(self) -> &'static str {
        self.0
    }
}

impl fmt::Display for Constant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.0)
    }
}
