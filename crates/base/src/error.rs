//! Error type: problem and hint.

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

/// An error: problem and hint for fixing it.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{what}\n  {hint}")]
pub struct Error {
    /// Category.
    pub kind: Kind,
    /// Problem and location.
    pub what: String,
    /// Hint for fixing it.
    pub hint: Advice,
}

impl Error {
    /// An error of any kind.
    pub fn new(kind: Kind, what: impl Into<String>, hint: impl Into<Advice>) -> Self {
        Error { kind, what: what.into(), hint: hint.into() }
    }

    /// An error of [`Kind::Input`].
    pub fn input(what: impl Into<String>, hint: impl Into<Advice>) -> Self {
        Error::new(Kind::Input, what, hint)
    }

    /// An error of [`Kind::Options`].
    pub fn options(what: impl Into<String>, hint: impl Into<Advice>) -> Self {
        Error::new(Kind::Options, what, hint)
    }

    /// An error of [`Kind::Device`].
    pub fn device(what: impl Into<String>, hint: impl Into<Advice>) -> Self {
        Error::new(Kind::Device, what, hint)
    }

    /// An error of [`Kind::Memory`].
    pub fn memory(what: impl Into<String>, hint: impl Into<Advice>) -> Self {
        Error::new(Kind::Memory, what, hint)
    }

    /// An error of [`Kind::Output`].
    pub fn output(what: impl Into<String>, hint: impl Into<Advice>) -> Self {
        Error::new(Kind::Output, what, hint)
    }

    /// The same error with another hint.
    pub fn advised(self, hint: impl Into<Advice>) -> Self {
        Error { hint: hint.into(), ..self }
    }

    /// The same error with its location (a file, a dataset) prepended.
    pub fn at(mut self, place: impl std::fmt::Display) -> Self {
        self.what = format!("{place}: {}", self.what);
        self
    }
}

/// Message of a caught panic; `None` if it is not text.
pub fn panic_message(panic: &(dyn Any + Send)) -> Option<&str> {
    panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied())
}

/// Result of a fallible operation.
pub type Result<T> = std::result::Result<T, Error>;

/// An error of [`Kind::Options`]: a name that is none of these.
#[doc(hidden)]
pub fn unknown(option: &str, name: &str, here: &[&str]) -> Error {
    let hint = format!("use {}, or leave it out", here.join(" or "));
    Error::options(format!("the {option} {name} is not known"), hint)
}
