//! Where the time goes.

pub mod limits;
