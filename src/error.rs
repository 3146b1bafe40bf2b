//! The one error type: what is wrong, and how to mend it.

/// What an [`Error`] is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A capture, truth or scene file that cannot be used.
    Input,
    /// An option or setting that makes no sense, alone or with the capture.
    Options,
    /// No Vulkan loader, no device, a missing feature, a lost device.
    Device,
    /// Not enough memory on the host or the device, or beyond a limit of the device.
    Memory,
    /// A result that could not be written.
    Output,
    /// The caller cancelled the work.
    Cancelled,
}

/// Says what is wrong and where (`what`) and what to do about it (`mend`).
#[derive(Debug, Clone, thiserror::Error)]
#[error("{what}\n  {mend}")]
pub struct Error {
    pub kind: Kind,
    pub what: String,
    pub mend: String,
}

impl Error {
    pub fn new(kind: Kind, what: impl Into<String>, mend: impl Into<String>) -> Self {
        Error { kind, what: what.into(), mend: mend.into() }
    }

    pub fn input(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Error::new(Kind::Input, what, mend)
    }

    pub fn options(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Error::new(Kind::Options, what, mend)
    }

    pub fn device(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Error::new(Kind::Device, what, mend)
    }

    pub fn memory(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Error::new(Kind::Memory, what, mend)
    }

    pub fn output(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Error::new(Kind::Output, what, mend)
    }

    /// The same error with the place (a file, a dataset) put before what is wrong.
    pub fn at(mut self, place: impl std::fmt::Display) -> Self {
        self.what = format!("{place}: {}", self.what);
        self
    }
}

pub type Result<T> = std::result::Result<T, Error>;
