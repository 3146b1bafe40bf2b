//! What frames of a session need of a plan.

use super::VectorOptions;
use super::follow::{self, Follow};
use crate::gpu::{Buffer, Constant};
use crate::solve::plan::pass::Pass;
use crate::solve::{Demand, LeftOut, LentRows, Level, Needs, Plan};

/// What frames of a session ask of their solver beside what single captures do.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Frames {
    /// They begin with the frame before.
    pub follow: Option<Follow>,
    /// Their counts may lie in a caller's buffer, in these rows.
    pub lent: Option<LentRows>,
}

/// What the solver needs of a plan for frames of a session.
pub struct ForFrames<'o>(pub &'o VectorOptions, pub Frames);

impl Needs for ForFrames<'_> {
    fn demand(&self) -> Demand {
        Demand { lent: self.1.lent, ..self.0.demand() }
    }

    fn capacities(&self, levels: &[Level]) -> [usize; 2] {
        self.0.capacities(levels)
    }

    fn constants(&self, plan: &Plan) -> Vec<(Constant, u32)> {
        self.0.constants(plan)
    }

    fn passes(&self) -> Vec<&'static Pass> {
        let of_frames = if self.1.follow.is_some() { follow::passes::ALL } else { &[] };
        [&Needs::passes(self.0)[..], of_frames].concat()
    }

    fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)> {
        self.0.buffers(plan)
    }

    fn left_out(&self, plan: &Plan, out: &mut LeftOut) {
        self.0.left_out(plan, out);
    }
}
