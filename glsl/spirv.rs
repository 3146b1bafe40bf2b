//! Reflection of a SPIR-V module: bindings with their access, and specialization constants. SPIR-V specification 1.5,
//! sections 2.3 and 3.32.

use std::collections::BTreeMap;

pub struct Binding {
    pub name: String,
    pub slot: u32,
    /// View, as Rust code.
    pub view: &'static str,
    pub reads: bool,
    pub writes: bool,
}

pub struct Constant {
    pub name: String,
    pub id: u32,
}

pub struct Module {
    pub bindings: Vec<Binding>,
    pub constants: Vec<Constant>,
}

const OP_NAME: u32 = 5;
const OP_TYPE_POINTER: u32 = 32;
const OP_VARIABLE: u32 = 59;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const SPEC_ID: u32 = 1;
const NON_WRITABLE: u32 = 24;
const NON_READABLE: u32 = 25;
const BINDING: u32 = 33;
const CLASS_UNIFORM: u32 = 2;

/// Bindings and constants of the module `words`, which must contain names (debug information).
pub fn reflect(words: &[u32]) -> Module {
    let mut names = BTreeMap::new();
    let mut slots = BTreeMap::new();
    let mut spec_ids = BTreeMap::new();
    let (mut unwritten, mut unread) = (Vec::new(), Vec::new());
    let mut pointees = BTreeMap::new();
    let mut variables = Vec::new();
    let mut at = 5;
    while at < words.len() {
        let (op, length) = (words[at] & 0xffff, (words[at] >> 16) as usize);
        let w = &words[at..at + length];
        match op {
            OP_NAME => {
                names.insert(w[1], text(&w[2..]));
            }
            OP_DECORATE if w[2] == BINDING => {
                slots.insert(w[1], w[3]);
            }
            OP_DECORATE if w[2] == SPEC_ID => {
                spec_ids.insert(w[1], w[3]);
            }
            OP_DECORATE if w[2] == NON_WRITABLE => unwritten.push(w[1]),
            OP_DECORATE if w[2] == NON_READABLE => unread.push(w[1]),
            OP_MEMBER_DECORATE if w[3] == NON_WRITABLE => unwritten.push(w[1]),
            OP_MEMBER_DECORATE if w[3] == NON_READABLE => unread.push(w[1]),
            OP_TYPE_POINTER => {
                pointees.insert(w[1], w[3]);
            }
            OP_VARIABLE => variables.push((w[2], w[1], w[3])),
            _ => {}
        }
        at += length;
    }
    let mut bindings: Vec<Binding> = variables
        .iter()
        .filter_map(|(variable, pointer, class)| {
            let slot = *slots.get(variable)?;
            let block = pointees[pointer];
            let has = |list: &[u32]| list.contains(&block) || list.contains(variable);
            let is_uniform = *class == CLASS_UNIFORM;
            Some(Binding {
                name: snake(&names[&block]),
                slot,
                view: if is_uniform { "View::Uniform" } else { "View::Storage" },
                reads: !has(&unread),
                writes: !is_uniform && !has(&unwritten),
            })
        })
        .collect();
    bindings.sort_by_key(|b| b.slot);
    let mut constants: Vec<Constant> = spec_ids
        .iter()
        .filter_map(|(target, id)| Some(Constant { name: names.get(target)?.clone(), id: *id }))
        .collect();
    constants.sort_by_key(|c| c.id);
    Module { bindings, constants }
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|b| *b != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// `BrickCounts` → `brick_counts`.
fn snake(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_ascii_uppercase() && i > 0 {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}
