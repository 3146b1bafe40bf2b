//! What a kernel's innermost loop holds, read from its SPIR-V: instructions by class and bytes, per turn.
//!
//! Specialization constants are known, so branches that depend on them alone are followed one way, and what nothing
//! uses then does not count, as every driver's compiler does. Inside the loop a multiplication whose only use is an
//! addition counts as one fused multiply-add; what does not change from turn to turn, and loads of uniforms and push
//! constants, count as done before the loop. Both sides of a branch that depends on data count: a subgroup whose
//! lanes disagree issues both. Instructions that the compiler adds (addresses beyond one add each, moves, a loop's
//! bookkeeping beyond what is written) are not known here, so the counts are from below.

mod class;
mod flow;
mod module;

pub use class::Counts;

use super::KernelCode;

/// Counts of one turn of the loop that holds the most, loops inside it once, and what the loop around it does besides:
/// once for all turns of the inner one. `None` if there is no loop, or one calls functions that the compiler did not
/// expand. `constants` are specialization constants by name.
pub fn count_loop<N: AsRef<str>>(code: &KernelCode, constants: &[(N, u32)]) -> Option<[Counts; 2]> {
    let ids = constants.iter().filter_map(|(name, value)| {
        code.constants.iter().find(|c| c.0.name() == name.as_ref()).map(|c| (c.1, *value))
    });
    let words: Vec<u32> =
        code.spirv.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    flow::count(&module::Module::parse(&words, &ids.collect())?)
}

#[cfg(test)]
mod tests;
