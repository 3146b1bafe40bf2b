//! Shuffled workgroup order, for tests.

/// Maximum number of parts of a shuffled dispatch along one axis.
const PARTS: u32 = 8;

/// The workgroups of a dispatch as boxes (first, counts), in an order drawn from `seed`.
pub(super) fn pieces(groups: [u32; 3], seed: u64) -> Vec<[[u32; 3]; 2]> {
    let cuts = groups.map(|n| n.min(PARTS));
    let at = |axis: usize, i: u32| (u64::from(groups[axis]) * u64::from(i) / u64::from(cuts[axis])) as u32;
    let total = cuts.iter().product();
    let order = shuffled(total, seed ^ u64::from(total));
    order
        .into_iter()
        .map(|k| {
            let i = [k % cuts[0], k / cuts[0] % cuts[1], k / (cuts[0] * cuts[1])];
            let from = [0, 1, 2].map(|axis| at(axis, i[axis]));
            [from, [0, 1, 2].map(|axis| at(axis, i[axis] + 1) - from[axis])]
        })
        .collect()
}

/// A permutation of 0..n determined by the seed (Fisher-Yates over a multiplicative generator).
fn shuffled(n: u32, seed: u64) -> Vec<u32> {
    let mut all: Vec<u32> = (0..n).collect();
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    for i in (1..all.len()).rev() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        all.swap(i, (state >> 33) as usize % (i + 1));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_every_workgroup_once() {
        for groups in [[1, 1, 1], [13, 3, 1], [0, 1, 1], [100, 9, 2]] {
            let mut seen = vec![0; groups.iter().product::<u32>() as usize];
            for [from, n] in pieces(groups, 5) {
                for z in from[2]..from[2] + n[2] {
                    for y in from[1]..from[1] + n[1] {
                        for x in from[0]..from[0] + n[0] {
                            seen[((z * groups[1] + y) * groups[0] + x) as usize] += 1;
                        }
                    }
                }
            }
            assert!(seen.iter().all(|n| *n == 1), "{groups:?}");
        }
        assert_ne!(pieces([13, 3, 1], 5), pieces([13, 3, 1], 6));
    }

    #[test]
    fn an_order_is_a_permutation_and_another_one() {
        let order = shuffled(100, 3);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().copied().eq(0..100) && order != sorted && order != shuffled(100, 4));
    }
}
