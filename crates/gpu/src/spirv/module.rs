//! A SPIR-V module, as far as required for counting (specification 1.5, sections 2.3 and 3.32).

use std::collections::HashMap;

pub(super) type Id = u32;

/// Opcodes by the specification's names.
#[allow(missing_docs)]
pub(super) mod op {
    pub const EXT_INST: u32 = 12;
    pub const ENTRY_POINT: u32 = 15;
    pub const TYPE_BOOL: u32 = 20;
    pub const TYPE_INT: u32 = 21;
    pub const TYPE_FLOAT: u32 = 22;
    pub const TYPE_VECTOR: u32 = 23;
    pub const TYPE_IMAGE: u32 = 25;
    pub const TYPE_POINTER: u32 = 32;
    pub const CONSTANT_TRUE: u32 = 41;
    pub const CONSTANT_FALSE: u32 = 42;
    pub const CONSTANT: u32 = 43;
    pub const SPEC_CONSTANT_TRUE: u32 = 48;
    pub const SPEC_CONSTANT_FALSE: u32 = 49;
    pub const SPEC_CONSTANT: u32 = 50;
    pub const SPEC_CONSTANT_OP: u32 = 52;
    pub const FUNCTION: u32 = 54;
    pub const FUNCTION_END: u32 = 56;
    pub const FUNCTION_CALL: u32 = 57;
    pub const VARIABLE: u32 = 59;
    pub const LOAD: u32 = 61;
    pub const STORE: u32 = 62;
    pub const ACCESS_CHAIN: u32 = 65;
    pub const IN_BOUNDS_ACCESS_CHAIN: u32 = 66;
    pub const DECORATE: u32 = 71;
    pub const VECTOR_SHUFFLE: u32 = 79;
    pub const COMPOSITE_EXTRACT: u32 = 81;
    pub const COMPOSITE_INSERT: u32 = 82;
    pub const IMAGE_READ: u32 = 98;
    pub const IMAGE_WRITE: u32 = 99;
    pub const F_NEGATE: u32 = 127;
    pub const F_ADD: u32 = 129;
    pub const F_SUB: u32 = 131;
    pub const F_MUL: u32 = 133;
    pub const VECTOR_TIMES_SCALAR: u32 = 142;
    pub const SELECT: u32 = 169;
    pub const CONTROL_BARRIER: u32 = 224;
    pub const MEMORY_BARRIER: u32 = 225;
    pub const ATOMIC_STORE: u32 = 228;
    pub const PHI: u32 = 245;
    pub const LOOP_MERGE: u32 = 246;
    pub const SELECTION_MERGE: u32 = 247;
    pub const LABEL: u32 = 248;
    pub const BRANCH: u32 = 249;
    pub const BRANCH_CONDITIONAL: u32 = 250;
    pub const SWITCH: u32 = 251;
    pub const UNREACHABLE: u32 = 255;
}

/// An instruction inside a function.
pub(super) struct Instruction {
    pub op: u32,
    /// Type of the result; 0 for none.
    pub kind: Id,
    pub result: Id,
    /// Raw operands after the result: ids and literals.
    pub rest: Vec<u32>,
}

impl Instruction {
    /// Ids among the operands.
    pub fn operands(&self) -> &[Id] {
        let r = &self.rest;
        match self.op {
            op::COMPOSITE_EXTRACT | op::LOAD => &r[..1],
            op::COMPOSITE_INSERT | op::VECTOR_SHUFFLE => &r[..2],
            op::EXT_INST => &r[2..],
            _ => r,
        }
    }
}

/// A basic block, including its terminator.
pub(super) struct Block {
    pub label: Id,
    pub instructions: Vec<Instruction>,
    /// Successors; one for a branch on a constant.
    pub next: Vec<Id>,
    /// The block after the loop that starts here.
    pub merge: Option<Id>,
}

#[derive(Default)]
pub(super) struct Module {
    /// Blocks of the entry point.
    pub blocks: Vec<Block>,
    /// Type of every typed id.
    pub kinds: HashMap<Id, Id>,
    /// (bits of a component, components) of scalar and vector types, and of texels.
    pub shapes: HashMap<Id, (u32, u32)>,
    /// (storage class, pointee) of pointer types.
    pub pointers: HashMap<Id, (u32, Id)>,
    /// Built-in variables by number.
    pub builtins: HashMap<Id, u32>,
    constants: HashMap<Id, u64>,
}

const DECORATION_SPEC_ID: u32 = 1;
const DECORATION_BUILTIN: u32 = 11;
const FORMAT_RGBA32F: u32 = 1;

impl Module {
    /// `special` has specialization constants by number. `None` for a truncated module.
    pub fn parse(words: &[u32], special: &HashMap<u32, u32>) -> Option<Module> {
        let mut m = Module::default();
        let (mut entry, mut spec_ids) = (0, HashMap::new());
        let (mut at, mut inside) = (5, false);
        while at < words.len() {
            let (op, length) = (words[at] & 0xffff, (words[at] >> 16) as usize);
            let w = words.get(at..at + length.max(1))?;
            at += length.max(1);
            if inside && op != op::FUNCTION_END {
                m.instruction(op, w);
                continue;
            }
            match op {
                op::ENTRY_POINT => entry = w[2],
                op::DECORATE if w[2] == DECORATION_SPEC_ID => {
                    spec_ids.insert(w[1], w[3]);
                }
                op::DECORATE if w[2] == DECORATION_BUILTIN => {
                    m.builtins.insert(w[1], w[3]);
                }
                op::TYPE_BOOL => {
                    m.shapes.insert(w[1], (32, 1));
                }
                op::TYPE_INT | op::TYPE_FLOAT => {
                    m.shapes.insert(w[1], (w[2], 1));
                }
                op::TYPE_VECTOR => {
                    let bits = m.shapes.get(&w[2]).map_or(32, |s| s.0);
                    m.shapes.insert(w[1], (bits, w[3]));
                }
                op::TYPE_IMAGE => {
                    m.shapes.insert(w[1], (32, if w[8] == FORMAT_RGBA32F { 4 } else { 1 }));
                }
                op::TYPE_POINTER => {
                    m.pointers.insert(w[1], (w[2], w[3]));
                }
                op::VARIABLE => {
                    m.kinds.insert(w[2], w[1]);
                }
                op::CONSTANT | op::SPEC_CONSTANT => {
                    let mut value = u64::from(w[3]) | u64::from(*w.get(4).unwrap_or(&0)) << 32;
                    let given = spec_ids.get(&w[2]).and_then(|id| special.get(id));
                    if let (op::SPEC_CONSTANT, Some(v)) = (op, given) {
                        value = u64::from(*v);
                    }
                    m.constant(w, value);
                }
                op::CONSTANT_TRUE | op::CONSTANT_FALSE | op::SPEC_CONSTANT_TRUE | op::SPEC_CONSTANT_FALSE => {
                    let given =
                        spec_ids.get(&w[2]).and_then(|id| special.get(id)).map(|v| u64::from(*v != 0));
                    let own = u64::from(op == op::CONSTANT_TRUE || op == op::SPEC_CONSTANT_TRUE);
                    m.constant(w, given.unwrap_or(own));
                }
                op::SPEC_CONSTANT_OP => {
                    m.kinds.insert(w[2], w[1]);
                    if let Some(value) = m.evaluate(w[3], &w[4..]) {
                        m.constants.insert(w[2], value);
                    }
                }
                op::FUNCTION => inside = w[2] == entry,
                op::FUNCTION_END => inside = false,
                _ => {}
            }
        }
        m.connect();
        Some(m)
    }

    fn constant(&mut self, w: &[u32], value: u64) {
        self.kinds.insert(w[2], w[1]);
        self.constants.insert(w[2], value);
    }

    fn instruction(&mut self, op: u32, w: &[u32]) {
        match op {
            op::LABEL => {
                let label = w[1];
                self.blocks.push(Block { label, instructions: vec![], next: vec![], merge: None });
                return;
            }
            op::LOOP_MERGE => {
                if let Some(b) = self.blocks.last_mut() {
                    b.merge = Some(w[1]);
                }
                return;
            }
            // Lines, parameters, selection merges.
            0 | 8 | 55 | 317 | op::SELECTION_MERGE => return,
            _ => {}
        }
        let bare = matches!(
            op,
            op::STORE | op::IMAGE_WRITE | op::CONTROL_BARRIER | op::MEMORY_BARRIER | op::ATOMIC_STORE
        ) || (op::BRANCH..=op::UNREACHABLE).contains(&op);
        let (kind, result, rest) = if bare { (0, 0, &w[1..]) } else { (w[1], w[2], &w[3..]) };
        if result != 0 {
            self.kinds.insert(result, kind);
            // A result of constants alone is a constant.
            if let Some(value) = self.evaluate(op, rest) {
                self.constants.insert(result, value);
            }
        }
        if let Some(b) = self.blocks.last_mut() {
            b.instructions.push(Instruction { op, kind, result, rest: rest.to_vec() });
        }
    }

    fn connect(&mut self) {
        for i in 0..self.blocks.len() {
            let Some(end) = self.blocks[i].instructions.last() else { continue };
            let next = match (end.op, &end.rest[..]) {
                (op::BRANCH, [to]) => vec![*to],
                (op::BRANCH_CONDITIONAL, [on, yes, no, ..]) => match self.value(*on) {
                    Some(0) => vec![*no],
                    Some(_) => vec![*yes],
                    None => vec![*yes, *no],
                },
                (op::SWITCH, [on, default, cases @ ..]) => match self.value(*on) {
                    Some(v) => {
                        vec![cases.chunks(2).find(|c| u64::from(c[0]) == v).map_or(*default, |c| c[1])]
                    }
                    None => cases.chunks(2).filter_map(|c| c.get(1).copied()).chain([*default]).collect(),
                },
                _ => vec![],
            };
            self.blocks[i].next = next;
        }
    }

    /// Value of an id that is constant under the given specialization.
    pub fn value(&self, id: Id) -> Option<u64> {
        self.constants.get(&id).copied()
    }

    /// (bits of a component, components) of an id's type, or of the pointee.
    pub fn shape(&self, kind: Id) -> (u32, u32) {
        let kind = self.pointers.get(&kind).map_or(kind, |p| p.1);
        self.shapes.get(&kind).copied().unwrap_or((32, 1))
    }

    /// Storage class of a pointer id.
    pub fn class(&self, pointer: Id) -> u32 {
        self.kinds.get(&pointer).and_then(|k| self.pointers.get(k)).map_or(u32::MAX, |p| p.0)
    }

    /// Evaluates an operation on 32-bit integers and booleans, which determine branches.
    fn evaluate(&self, op: u32, operands: &[u32]) -> Option<u64> {
        let at = |i: usize| self.value(*operands.get(i)?).map(|v| v as u32);
        let signed = |i| at(i).map(|v| v as i32);
        let truth = |b: bool| Some(u64::from(b));
        let word = |v: u32| Some(u64::from(v));
        match op {
            128 => word(at(0)?.wrapping_add(at(1)?)),
            130 => word(at(0)?.wrapping_sub(at(1)?)),
            132 => word(at(0)?.wrapping_mul(at(1)?)),
            134 => word(at(0)?.checked_div(at(1)?)?),
            137 => word(at(0)?.checked_rem(at(1)?)?),
            164 | 170 => truth(at(0)? == at(1)?),
            165 | 171 => truth(at(0)? != at(1)?),
            // One known side suffices.
            166 if at(0).or(at(1)).is_some() && (at(0) == Some(1) || at(1) == Some(1)) => Some(1),
            167 if at(0) == Some(0) || at(1) == Some(0) => Some(0),
            166 => truth(at(0)? | at(1)? != 0),
            167 => truth(at(0)? & at(1)? != 0),
            168 => truth(at(0)? == 0),
            op::SELECT => self.value(operands[if at(0)? != 0 { 1 } else { 2 }]),
            172 => truth(at(0)? > at(1)?),
            173 => truth(signed(0)? > signed(1)?),
            174 => truth(at(0)? >= at(1)?),
            175 => truth(signed(0)? >= signed(1)?),
            176 => truth(at(0)? < at(1)?),
            177 => truth(signed(0)? < signed(1)?),
            178 => truth(at(0)? <= at(1)?),
            179 => truth(signed(0)? <= signed(1)?),
            194 => word(at(0)?.checked_shr(at(1)?)?),
            196 => word(at(0)?.checked_shl(at(1)?)?),
            197 => word(at(0)? | at(1)?),
            198 => word(at(0)? ^ at(1)?),
            199 => word(at(0)? & at(1)?),
            _ => None,
        }
    }
}
