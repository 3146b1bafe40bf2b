//! Names of buffers, kernels and constants as types: a name that nobody declared does not compile.

use std::fmt;

/// A buffer by its name, which is also the name of the block that kernels bind it to.
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

    /// One of several buffers of that name, such as one for each level. It shows as `name_index`.
    pub const fn at(self, index: u16) -> Buffer {
        Buffer { name: self.name, at: Some(index) }
    }

    /// What all buffers of that name are called, without the index.
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

/// A kernel by the name that schedules, labels and timelines use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Kernel(&'static str);

impl Kernel {
    /// The kernel of that name.
    pub const fn named(name: &'static str) -> Kernel {
        Kernel(name)
    }

    /// Its name.
    pub const fn name(self) -> &'static str {
        self.0
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.0)
    }
}

/// A specialization constant by its name in the sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Constant(&'static str);

impl Constant {
    /// The constant of that name.
    pub const fn named(name: &'static str) -> Constant {
        Constant(name)
    }

    /// Its name.
    pub const fn name(self) -> &'static str {
        self.0
    }
}

impl fmt::Display for Constant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.0)
    }
}
