//! A pass as one declared row: what schedules, plans, faults, reports, the profiler and the tests know of it.
//!
//! Every solver's folder declares its passes with [`passes!`] in a file `passes.rs`; those that solvers share stand
//! in [`crate::engine::plan::passes`]. What a pass reads and writes is not written down: `build.rs` reads it from the compiled
//! module ([`Pass::reads`], [`Pass::writes`]).

use std::fmt;

use crate::advice::AdvicePart;
use crate::engine::plan::Plan;
use crate::gpu::{Buffer, Constant, Kernel, KernelCode, KernelRequest};

/// A pass, declared as one row.
pub struct Pass {
    /// What schedules, labels and timelines call it.
    pub kernel: Kernel,
    /// What the profiler's reports call it: every rendering begins with `forward`, every gather with `backward`.
    pub report: &'static str,
    /// The module that a plan runs it with.
    pub code: fn(&Plan) -> &'static KernelCode,
    /// Whether a plan that has these passes needs this one.
    pub when: fn(&Plan) -> bool,
    /// Constants of its own. The others that its module asks for are the plan's ([`Plan::constants`]).
    pub constants: &'static [(Constant, u32)],
    /// The voxels that it evaluates against every pair, if it evaluates pairs.
    pub pairs: Option<Voxels>,
    /// The values that are not finite that it can find.
    pub faults: &'static [Fault],
}

/// The voxels that a pass evaluates against every laser-sensor pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Voxels {
    /// Those in the active list.
    Active,
    /// Those of the grid that are not too near.
    Grid,
}

/// A value that is not finite, found by a kernel (`glsl/include/faults.glsl`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// Its bit in the trace. Lower bits come earlier in an iteration.
    pub bit: u32,
    /// What is not finite.
    pub what: &'static str,
    /// What may fix it.
    pub hint: &'static [AdvicePart],
}

/// Declares passes, and a list of all of them.
///
/// ```text
/// passes! {
///     /// Doc of the list.
///     pub static ALL;
///     /// Doc of the pass.
///     SAMPLE = Pass::of("sample", |_| &kernel::SAMPLE);
/// }
/// ```
macro_rules! passes {
    ($(#[$about:meta])* pub static $all:ident; $($(#[$doc:meta])* $name:ident = $row:expr;)*) => {
        $($(#[$doc])* pub static $name: $crate::engine::plan::Pass = $row;)*
        $(#[$about])*
        pub static $all: &[&$crate::engine::plan::Pass] = &[$(&$name),*];
    };
}

pub(crate) use passes;

impl Pass {
    /// A pass that evaluates no pairs, has no constants of its own, finds no faults, and is part of every plan.
    pub const fn of(name: &'static str, code: fn(&Plan) -> &'static KernelCode) -> Pass {
        Pass {
            kernel: Kernel::named(name),
            report: name,
            code,
            when: |_| true,
            constants: &[],
            pairs: None,
            faults: &[],
        }
    }

    /// The values of all constants that its module asks for, its own before the plan's. What neither sets keeps the
    /// default of the source.
    pub fn values(&self, plan: &Plan) -> Vec<(Constant, u32)> {
        let mut all = self.constants.to_vec();
        for (constant, _) in (self.code)(plan).constants {
            if let Some(value) = plan.constant(*constant).filter(|_| all.iter().all(|c| c.0 != *constant)) {
                all.push((*constant, value));
            }
        }
        all
    }

    /// Its kernel as an executor makes it.
    pub fn wanted(&self, plan: &Plan) -> KernelRequest<'static> {
        KernelRequest { kernel: self.kernel, code: (self.code)(plan), constants: self.values(plan) }
    }

    /// Blocks that it reads.
    pub fn reads(&self, plan: &Plan) -> impl Iterator<Item = Buffer> {
        (self.code)(plan).bindings.iter().filter(|b| b.reads).map(|b| b.block)
    }

    /// Blocks that it writes.
    pub fn writes(&self, plan: &Plan) -> impl Iterator<Item = Buffer> {
        (self.code)(plan).bindings.iter().filter(|b| b.writes).map(|b| b.block)
    }
}

impl From<&Pass> for Kernel {
    fn from(pass: &Pass) -> Kernel {
        pass.kernel
    }
}

impl PartialEq for Pass {
    fn eq(&self, other: &Pass) -> bool {
        self.kernel == other.kernel
    }
}

impl fmt::Debug for Pass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Pass({})", self.kernel)
    }
}
