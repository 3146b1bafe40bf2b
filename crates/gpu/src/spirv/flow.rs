//! Loops of the entry point, and their instruction counts.

use std::collections::{HashMap, HashSet};

use super::class::{Counts, cost};
use super::module::{Block, Id, Instruction, Module, op};

const CLASS_INPUT: u32 = 1;
const CLASS_UNIFORM: u32 = 2;
const CLASS_FUNCTION: u32 = 7;
const CLASS_PUSH: u32 = 9;

/// Built-ins that differ between lanes of a subgroup.
const LANE_BUILTINS: [u32; 4] = [27, 28, 29, 41];

/// See [`super::count_loop`].
pub(super) fn count(m: &Module) -> Option<[Counts; 2]> {
    let by_label: HashMap<Id, &Block> = m.blocks.iter().map(|b| (b.label, b)).collect();
    let reached = reach(&by_label, m.blocks.first()?.label, None);
    if m.blocks
        .iter()
        .any(|b| reached.contains(&b.label) && b.instructions.iter().any(|i| i.op == op::FUNCTION_CALL))
    {
        return None;
    }
    let blocks: Vec<&Block> = m.blocks.iter().filter(|b| reached.contains(&b.label)).collect();
    let uses = live_uses(m, &blocks);
    let apart = lanes_apart(m, &blocks);
    let loops: Vec<(Id, HashSet<Id>)> = blocks
        .iter()
        .filter_map(|b| b.merge.map(|merge| (b.label, reach(&by_label, b.label, Some(merge)))))
        .collect();
    // The counts of a loop without the loops inside it.
    let own = |l: &(Id, HashSet<Id>)| {
        let nested = loops.iter().filter(|(h, _)| *h != l.0 && l.1.contains(h));
        let nested: HashSet<Id> = nested.flat_map(|(_, b)| b).copied().collect();
        let own: HashSet<Id> = l.1.difference(&nested).copied().collect();
        in_loop(m, &blocks, &l.1, &own, &uses, &apart)
    };
    let around = |l: &(Id, HashSet<Id>)| {
        let head = l.0;
        loops.iter().filter(move |(h, b)| *h != head && b.contains(&head))
    };
    // The main loop: the innermost among the loops with the most work of their own. Loops that prepare a product's
    // pairs may have more; loops that retry or empty a window have little.
    let weights: Vec<u32> = loops.iter().map(|l| own(l).issued()).collect();
    let most = *weights.iter().max()?;
    let much = loops.iter().zip(&weights).filter(|(_, w)| 2 * **w >= most);
    let (counted, _) = much.max_by_key(|(l, w)| (around(l).count(), **w))?;
    let body = &counted.1;
    let turn = in_loop(m, &blocks, body, body, &uses, &apart);
    // The smallest enclosing loop.
    let shared = around(counted).min_by_key(|l| l.1.len()).map_or(Counts::default(), own);
    Some([turn, shared])
}

/// Blocks that control reaches from `from` without passing `end`.
fn reach(blocks: &HashMap<Id, &Block>, from: Id, end: Option<Id>) -> HashSet<Id> {
    let (mut seen, mut open) = (HashSet::new(), vec![from]);
    while let Some(label) = open.pop() {
        if Some(label) != end && seen.insert(label) {
            open.extend(blocks.get(&label).into_iter().flat_map(|b| &b.next));
        }
    }
    seen
}

/// Ids used by an instruction. A selection or phi with a known outcome uses one side only.
fn used(m: &Module, i: &Instruction, reached: &HashSet<Id>) -> Vec<Id> {
    match i.op {
        op::SELECT => match m.value(i.rest[0]) {
            Some(v) => vec![i.rest[if v != 0 { 1 } else { 2 }]],
            None => i.rest.clone(),
        },
        op::PHI => i.rest.chunks(2).filter(|c| reached.contains(&c[1])).map(|c| c[0]).collect(),
        op::BRANCH_CONDITIONAL | op::SWITCH if m.value(i.rest[0]).is_some() => vec![],
        op::BRANCH_CONDITIONAL | op::SWITCH => vec![i.rest[0]],
        op::BRANCH => vec![],
        _ => i.operands().to_vec(),
    }
}

/// Number of uses of each id by instructions with an observable effect.
fn live_uses(m: &Module, blocks: &[&Block]) -> HashMap<Id, u32> {
    let reached: HashSet<Id> = blocks.iter().map(|b| b.label).collect();
    let all = || blocks.iter().flat_map(|b| &b.instructions);
    let by_result: HashMap<Id, &Instruction> =
        all().filter(|i| i.result != 0).map(|i| (i.result, i)).collect();
    let base = |pointer: Id| match by_result.get(&pointer) {
        Some(i) if matches!(i.op, op::ACCESS_CHAIN | op::IN_BOUNDS_ACCESS_CHAIN) => i.rest[0],
        _ => pointer,
    };
    let loaded: HashSet<Id> = all().filter(|i| i.op == op::LOAD).map(|i| base(i.rest[0])).collect();
    // Modules with extensions unknown to the optimiser keep unread function variables.
    let unread = |i: &Instruction| {
        i.op == op::STORE && m.class(i.rest[0]) == CLASS_FUNCTION && !loaded.contains(&base(i.rest[0]))
    };
    let effect =
        |i: &&Instruction| (i.result == 0 && !unread(i)) || (227..=242).contains(&i.op) || i.op == 6035;
    let mut open: Vec<&Instruction> = all().filter(effect).collect();
    let mut uses: HashMap<Id, u32> = HashMap::new();
    while let Some(i) = open.pop() {
        for id in used(m, i, &reached) {
            let count = uses.entry(id).or_default();
            *count += 1;
            if *count == 1 {
                // Instructions with an effect are already in the list.
                open.extend(by_result.get(&id).filter(|i| !effect(i)));
            }
        }
    }
    uses
}

/// Ids that may differ between lanes of a subgroup. Lanes lie along x of a workgroup. Control dependence is not
/// followed.
fn lanes_apart(m: &Module, blocks: &[&Block]) -> HashSet<Id> {
    let mut apart: HashSet<Id> = HashSet::new();
    let lane = |id: &Id| m.builtins.get(id).is_some_and(|b| LANE_BUILTINS.contains(b));
    let mut grown = true;
    while grown {
        grown = false;
        for i in blocks.iter().flat_map(|b| &b.instructions).filter(|i| i.result != 0) {
            let across = match i.op {
                // y and z of a lane's position are uniform along x.
                op::COMPOSITE_EXTRACT if i.rest[1] > 0 && is_place(m, blocks, i.rest[0]) => false,
                op::ACCESS_CHAIN if lane(&i.rest[0]) => m.value(i.rest[1]) == Some(0),
                227..=242 | 6035 => true,
                _ => i.operands().iter().any(|id| apart.contains(id) || lane(id)),
            };
            if across && apart.insert(i.result) {
                grown = true;
            }
        }
    }
    apart
}

/// Whether an id is a loaded built-in vector.
fn is_place(m: &Module, blocks: &[&Block], id: Id) -> bool {
    let all = || blocks.iter().flat_map(|b| &b.instructions);
    all().any(|i| i.result == id && i.op == op::LOAD && m.builtins.contains_key(&i.rest[0]))
}

/// Counts of the blocks `counted`, which are in the loop `body`.
fn in_loop(
    m: &Module,
    blocks: &[&Block],
    body: &HashSet<Id>,
    counted: &HashSet<Id>,
    uses: &HashMap<Id, u32>,
    apart: &HashSet<Id>,
) -> Counts {
    let inside: Vec<&Instruction> =
        blocks.iter().filter(|b| body.contains(&b.label)).flat_map(|b| &b.instructions).collect();
    let changing = changing(m, &inside);
    let products: HashMap<Id, u32> = inside
        .iter()
        .filter(|i| matches!(i.op, op::F_MUL | op::VECTOR_TIMES_SCALAR) && changing.contains(&i.result))
        .filter(|i| uses.get(&i.result) == Some(&1))
        .map(|i| (i.result, m.shape(i.kind).1))
        .collect();
    // A negated product fuses as well.
    let through: HashMap<Id, Id> =
        inside.iter().filter(|i| i.op == op::F_NEGATE).map(|i| (i.result, i.rest[0])).collect();
    let mut sum = Counts::default();
    for i in blocks.iter().filter(|b| counted.contains(&b.label)).flat_map(|b| &b.instructions) {
        let live =
            i.result == 0 || uses.contains_key(&i.result) || i.op == 6035 || (227..=242).contains(&i.op);
        let decided = match i.op {
            op::SELECT | op::BRANCH_CONDITIONAL | op::SWITCH => m.value(i.rest[0]).is_some(),
            _ => false,
        };
        if !live || decided || (i.result != 0 && !changing.contains(&i.result)) {
            continue;
        }
        // A pointer, or a texel's coordinate.
        let place = usize::from(matches!(i.op, op::IMAGE_READ | op::IMAGE_WRITE));
        let is_apart = i.rest.get(place).is_some_and(|id| apart.contains(id));
        sum.add(&cost(m, i, is_apart));
        if matches!(i.op, op::F_ADD | op::F_SUB) {
            let fused = i.rest.iter().find_map(|id| products.get(through.get(id).unwrap_or(id)));
            sum.fma -= fused.copied().unwrap_or(0);
        }
    }
    sum
}

/// Results that change between turns: phis, loads from written memory, and dependent results.
fn changing(m: &Module, inside: &[&Instruction]) -> HashSet<Id> {
    let mut changing: HashSet<Id> = HashSet::new();
    let mut grown = true;
    while grown {
        grown = false;
        for i in inside.iter().filter(|i| i.result != 0 && m.value(i.result).is_none()) {
            let by_itself = match i.op {
                op::PHI | op::FUNCTION_CALL => true,
                op::LOAD => !matches!(m.class(i.rest[0]), CLASS_INPUT | CLASS_UNIFORM | CLASS_PUSH),
                _ => (227..=242).contains(&i.op) || i.op == 6035,
            };
            let of_others = || i.operands().iter().any(|id| changing.contains(id));
            if (by_itself || of_others()) && changing.insert(i.result) {
                grown = true;
            }
        }
    }
    changing
}
