//! Counts what a kernel's innermost loop does, from its SPIR-V: instructions by class and bytes, per turn.
//!
//! Specialization constants are known: branches that depend on them alone go one way, and unused results do not count,
//! as in every driver's compiler. A multiplication whose only use is an addition counts as one fused multiply-add.
//! Values that stay the same from turn to turn, and loads of uniforms and push constants, count as done before the
//! loop. Both sides of a branch on data count: a subgroup whose lanes disagree issues both. Instructions that the
//! driver's compiler adds (addresses beyond one addition each, moves, loop bookkeeping) are not known here, so the
//! counts are lower bounds.

mod class;
mod flow;
mod module;

pub use class::Counts;

use super::code::KernelCode;

/// Counts of one turn of the main loop (loops inside it count once), and of one turn of the loop around it without the
/// main loop. `None` if there is no loop, or if one calls functions that the compiler did not expand. `constants` are
/// specialization constants by name.
pub fn count_loop<N: AsRef<str>>(code: &KernelCode, constants: &[(N, u32)]) -> Option<[Counts; 2]> {
    flow::count(&parsed(code, constants)?)
}

/// Numbers of the extended instructions (GLSL.std.450) that the entry point holds under such constants. `None` if the module
/// ends within an instruction.
pub fn extended<N: AsRef<str>>(code: &KernelCode, constants: &[(N, u32)]) -> Option<Vec<u32>> {
    let module = parsed(code, constants)?;
    let all = module.blocks.iter().flat_map(|b| &b.instructions);
    Some(all.filter(|i| i.op == module::op::EXT_INST).map(|i| i.rest[1]).collect())
}

fn parsed<N: AsRef<str>>(code: &KernelCode, constants: &[(N, u32)]) -> Option<module::Module> {
    let ids = constants.iter().filter_map(|(name, value)| {
        code.constants.iter().find(|c| c.0.name() == name.as_ref()).map(|c| (c.1, *value))
    });
    let words: Vec<u32> =
        code.spirv.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    module::Module::parse(&words, &ids.collect())
}

#[cfg(test)]
mod tests;
