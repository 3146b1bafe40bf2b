//! Counts the work of a kernel's innermost loop from its SPIR-V: instructions by class and bytes, per turn.
//!
//! Specialization constants are known: branches depending only on them are resolved, and unused results do not count,
//! as in every driver's compiler. A multiplication used only by an addition counts as one fused multiply-add.
//! Loop-invariant values, and loads of uniforms and push constants, count as hoisted. Both sides of a data-dependent
//! branch count, as for a divergent subgroup. Instructions added by the driver's compiler (further addresses, moves,
//! loop bookkeeping) are unknown, so the counts are lower bounds.

mod class;
mod flow;
mod module;

pub use class::Counts;

use super::code::KernelCode;

/// Counts of one turn of the main loop (inner loops count once), and of one turn of the enclosing loop without the
/// main loop. `None` without a loop, or if one calls functions that were not inlined. `constants` are specialization
/// constants by name.
pub fn count_loop<N: AsRef<str>>(code: &KernelCode, constants: &[(N, u32)]) -> Option<[Counts; 2]> {
    flow::count(&parsed(code, constants)?)
}

/// Numbers of the extended instructions (GLSL.std.450) in the entry point under the given constants. `None` for a
/// truncated module.
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
