//! Cost of instructions, by class.

use serde::{Deserialize, Serialize};

use super::module::{Instruction, Module, op};

/// Instructions and bytes of one loop turn, per lane. Vectors count once per component.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// fp32 additions, multiplications and fused multiply-adds.
    pub fma: u32,
    /// Inverse square roots, square roots, reciprocals and exponentials (special function unit).
    pub special: u32,
    /// Integer operations, comparisons, selections, conversions, rounding, minima, addresses, branches, barriers.
    pub other: u32,
    /// Roundings and conversions between floats and integers, included in `other`; executed by the special function
    /// unit on GPUs.
    pub conversions: u32,
    /// Words loaded from buffers with per-lane addresses.
    pub loads: u32,
    /// Words stored to buffers with per-lane addresses.
    pub stores: u32,
    /// Words loaded from subgroup-uniform addresses.
    pub broadcasts: u32,
    /// Words loaded from and stored to shared memory.
    pub shared: u32,
    /// Atomic operations on buffers.
    pub atomics: u32,
    /// Atomic operations on shared memory.
    pub shared_atomics: u32,
    /// Bytes of all loads, stores and atomics on buffers, before caches.
    pub bytes: u32,
}

const CLASS_INPUT: u32 = 1;
const CLASS_WORKGROUP: u32 = 4;
const CLASS_PRIVATE: u32 = 6;
const CLASS_FUNCTION: u32 = 7;
const CLASS_BUFFER: u32 = 12;

impl Counts {
    /// Issue slots.
    pub fn issued(&self) -> u32 {
        let memory = self.loads + self.stores + self.broadcasts + self.shared;
        self.fma + self.special + self.other + memory + self.atomics + self.shared_atomics
    }

    pub(super) fn add(&mut self, o: &Counts) {
        self.fma += o.fma;
        self.special += o.special;
        self.other += o.other;
        self.conversions += o.conversions;
        self.loads += o.loads;
        self.stores += o.stores;
        self.broadcasts += o.broadcasts;
        self.shared += o.shared;
        self.atomics += o.atomics;
        self.shared_atomics += o.shared_atomics;
        self.bytes += o.bytes;
    }
}

/// Cost of an instruction; `apart`: addresses may differ between lanes of a subgroup.
pub(super) fn cost(m: &Module, i: &Instruction, apart: bool) -> Counts {
    let (bits, n) = m.shape(i.kind);
    let n = n * bits.div_ceil(32);
    let fma = |fma| Counts { fma, ..Counts::default() };
    let other = |other| Counts { other, ..Counts::default() };
    let of_first = || i.rest.first().and_then(|id| m.kinds.get(id)).map_or(1, |k| m.shape(*k).1);
    match i.op {
        op::F_ADD | op::F_SUB | op::F_MUL | op::VECTOR_TIMES_SCALAR => fma(n),
        // A dot product is a multiplication and fused multiply-adds.
        148 => fma(of_first()),
        // A division is a reciprocal and a multiplication.
        136 => Counts { special: n, fma: n, ..Counts::default() },
        op::EXT_INST => extended(m, i, n),
        op::LOAD => memory(m, i.rest[0], n, apart, true),
        op::STORE => {
            let value = m.kinds.get(&i.rest[1]).map_or((32, 1), |k| m.shape(*k));
            memory(m, i.rest[0], value.1 * value.0.div_ceil(32), apart, false)
        }
        op::IMAGE_READ | op::IMAGE_WRITE => {
            let words = m.kinds.get(&i.rest[0]).map_or(1, |k| m.shape(*k).1);
            of_buffer(words, apart, i.op == op::IMAGE_READ)
        }
        227..=242 | 6035 => {
            let (bits, _) = m.kinds.get(&i.rest[0]).map_or((32, 1), |k| m.shape(*k));
            if m.class(i.rest[0]) == CLASS_WORKGROUP {
                Counts { shared_atomics: 1, ..Counts::default() }
            } else {
                Counts { atomics: 1, bytes: bits / 8, ..Counts::default() }
            }
        }
        // One address each; registers have none.
        op::ACCESS_CHAIN | op::IN_BOUNDS_ACCESS_CHAIN => match m.class(i.result) {
            CLASS_INPUT | CLASS_PRIVATE | CLASS_FUNCTION => Counts::default(),
            _ => other(1),
        },
        109..=112 => Counts { other: n, conversions: n, ..Counts::default() },
        // Signs are modifiers. Composites, copies and phis only rename registers.
        op::F_NEGATE | op::PHI | op::BRANCH | 79..=83 | 124 | 253..=255 => Counts::default(),
        op::BRANCH_CONDITIONAL | op::SWITCH | op::CONTROL_BARRIER => other(1),
        _ => other(n),
    }
}

fn of_buffer(words: u32, apart: bool, load: bool) -> Counts {
    let bytes = 4 * words;
    match load {
        true if !apart => Counts { broadcasts: words, bytes, ..Counts::default() },
        true => Counts { loads: words, bytes, ..Counts::default() },
        false => Counts { stores: words, bytes, ..Counts::default() },
    }
}

fn memory(m: &Module, pointer: u32, words: u32, apart: bool, load: bool) -> Counts {
    let none = Counts::default();
    match (m.class(pointer), load) {
        (CLASS_BUFFER, _) => of_buffer(words, apart, load),
        (CLASS_WORKGROUP, _) => Counts { shared: words, ..none },
        // Registers, uniforms, push constants.
        _ => none,
    }
}

/// GLSL.std.450 by number.
fn extended(m: &Module, i: &Instruction, n: u32) -> Counts {
    let counts = |fma, special, other| Counts { fma, special, other, ..Counts::default() };
    let of_first = i.rest.get(2).and_then(|id| m.kinds.get(id)).map_or(n, |k| m.shape(*k).1);
    match i.rest[1] {
        // |x| is a modifier.
        4 => counts(0, 0, 0),
        // sin, cos, exp2, log2, sqrt, inversesqrt
        13 | 14 | 29..=32 => counts(0, n, 0),
        // exp, log: through powers of two
        27 | 28 => counts(n, n, 0),
        // pow
        26 => counts(n, 2 * n, 0),
        // tan, asin to atanh: two special functions and a polynomial
        15..=25 => counts(4 * n, 2 * n, 0),
        // round, trunc, floor, ceil, fract
        1..=3 | 8..=10 => Counts { conversions: n, ..counts(0, 0, n) },
        // A clamp to [0, 1] is a modifier of the preceding instruction.
        43 | 81 if m.value(i.rest[3]) == Some(0) && m.value(i.rest[4]) == Some(u64::from(1f32.to_bits())) => {
            counts(0, 0, 0)
        }
        // clamp, sign
        6 | 43..=45 | 81 => counts(0, 0, 2 * n),
        // mix: a subtraction and an fma
        46 => counts(2 * n, 0, 0),
        50 => counts(n, 0, 0),
        // length, distance, cross, normalize
        66 => counts(of_first, 1, 0),
        67 => counts(2 * of_first, 1, 0),
        68 => counts(6, 0, 0),
        69 => counts(2 * n, 1, 0),
        _ => counts(0, 0, n),
    }
}
