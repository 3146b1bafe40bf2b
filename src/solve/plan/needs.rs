//! What a plan asks a solver.

use super::pass::Pass;
use super::{Demand, LeftOut, Level, Plan};
use crate::gpu::{Buffer, Constant};

/// What a solver needs of a plan. Its options implement this.
pub trait Needs {
    /// The plain part.
    fn demand(&self) -> Demand;

    /// Voxels that may be active at once, and touched at once, over these levels.
    fn capacities(&self, levels: &[Level]) -> [usize; 2];

    /// Values of the constants that its passes share.
    fn constants(&self, plan: &Plan) -> Vec<(Constant, u32)>;

    /// The content of its own uniform blocks over these levels: numbers that the scene does not have.
    fn blocks(&self, _levels: &[Level]) -> Vec<(Buffer, Vec<u8>)> {
        vec![]
    }

    /// Its passes. The plan adds those that all solvers have, and leaves out those it does not need ([`Pass::when`]).
    fn passes(&self) -> Vec<&'static Pass>;

    /// Its device buffers with their bytes. The plan adds those that all solvers have.
    fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)>;

    /// Lists what it does not need, and what that saves.
    fn left_out(&self, plan: &Plan, out: &mut LeftOut);
}
