//! The one error type: what is wrong, and how to mend it.

use std::any::Any;

use crate::advice::Advice;

/// The subject of an [`Error`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A capture, truth or scene file that cannot be used.
    Input,
    /// An option or setting that is not valid, alone or with the capture.
    Options,
    /// No Vulkan loader, no device, a missing feature, a lost device.
    Device,
    /// Not enough memory on the host or the device, or a limit of the device is exceeded.
    Memory,
    /// A result that could not be written.
    Output,
    /// The caller cancelled the work.
    Cancelled,
}

/// What is wrong, and what to do about it.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{what}\n  {mend}")]
pub struct Error {
    /// The subject.
    pub kind: Kind,
    /// What is wrong, and where.
    pub what: String,
    /// What the reader can do about it.
    pub mend: Advice,
}

impl Error {
    /// An error of any kind.
    pub fn new(kind: Kind, what: impl Into<String>, mend: impl Into<Advice>) -> Self {
        Error { kind, what: what.into(), mend: mend.into() }
    }

    /// An error of [`Kind::Input`].
    pub fn input(what: impl Into<String>, mend: impl Into<Advice>) -> Self {
        Error::new(Kind::Input, what, mend)
    }

    /// An error of [`Kind::Options`].
    pub fn options(what: impl Into<String>, mend: impl Into<Advice>) -> Self {
        Error::new(Kind::Options, what, mend)
    }

    /// An error of [`Kind::Device`].
    pub fn device(what: impl Into<String>, mend: impl Into<Advice>) -> Self {
        Error::new(Kind::Device, what, mend)
    }

    /// An error of [`Kind::Memory`].
    pub fn memory(what: impl Into<String>, mend: impl Into<Advice>) -> Self {
        Error::new(Kind::Memory, what, mend)
    }

    /// An error of [`Kind::Output`].
    pub fn output(what: impl Into<String>, mend: impl Into<Advice>) -> Self {
        Error::new(Kind::Output, what, mend)
    }

    /// The same error with other advice.
    pub fn advised(self, mend: impl Into<Advice>) -> Self {
        Error { mend: mend.into(), ..self }
    }

    /// The same error with its place (a file, a dataset) in front of what is wrong.
    pub fn at(mut self, place: impl std::fmt::Display) -> Self {
        self.what = format!("{place}: {}", self.what);
        self
    }
}

/// The message of a panic that was caught; `None` if it has none that is text.
pub fn panic_message(panic: &(dyn Any + Send)) -> Option<&str> {
    panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied())
}

/// The result of everything that can fail.
pub type Result<T> = std::result::Result<T, Error>;
