//! Declares round-to-nearest for fp32 in a kernel's module. The mode is implementation-defined unless declared, and
//! declarable only where supported.

const CAPABILITY: u32 = 17;
const ENTRY_POINT: u32 = 15;
const EXECUTION_MODE: u32 = 16;
/// Number of the capability and of the mode, in SPIR-V 1.4 and later.
const CAN_ROUND_TO_NEAREST: u32 = 4467;
const ROUND_TO_NEAREST: u32 = 4462;

/// The module `words` with the declaration. Requires a single entry point.
pub fn to_nearest(words: &[u32]) -> Vec<u32> {
    let header = 5.min(words.len());
    let mut all = words[..header].to_vec();
    all.extend([2 << 16 | CAPABILITY, CAN_ROUND_TO_NEAREST]);
    let mut at = header;
    while let Some(first) = words.get(at) {
        let (op, length) = (first & 0xffff, (first >> 16).max(1) as usize);
        let instruction = &words[at..(at + length).min(words.len())];
        all.extend_from_slice(instruction);
        if op == ENTRY_POINT {
            all.extend([4 << 16 | EXECUTION_MODE, instruction[2], ROUND_TO_NEAREST, 32]);
        }
        at += length;
    }
    all
}
