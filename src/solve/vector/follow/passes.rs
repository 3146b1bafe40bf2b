//! The passes that only a solver that follows a moving scene has.

use crate::solve::plan::pass::{Pass, passes, twin};
use crate::transport::kernels::*;

passes! {
    /// All of them.
    pub static ALL;

    /// Filters what the volume leaves of the measurement along time.
    FILTER_LEFT = Pass { twin: twin!(filter_left), ..Pass::of("filter_left", |_| &kernel::FILTER_LEFT) };

    /// Adds the old domain to the new one.
    JOIN = Pass { twin: twin!(join), ..Pass::of("join", |_| &kernel::JOIN) };
}
