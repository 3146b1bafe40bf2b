//! The active domain: sets of voxels as bits in storage order, and slots of their state.

use super::{BRICK_VOXELS, Call, Real, SceneGrid};

/// Words of a set per brick.
pub const WORDS: usize = BRICK_VOXELS / 32;

/// Whether a voxel's bit is set.
#[inline(always)]
pub fn is_set(mask: &[u32], index: usize) -> bool {
    mask[index / 32] >> (index % 32) & 1 == 1
}

/// Numbers of the set bits of a word.
pub fn bits_of(mut word: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
        word &= word - 1;
        Some(bit)
    })
}

/// The voxels of a brick in the grid from layer `near` on.
pub fn inside<F: Real>(grid: &SceneGrid<F>, brick: usize, near: usize) -> [u32; WORDS] {
    let corner = grid.voxel(brick * BRICK_VOXELS);
    if grid.contains(corner.map(|c| c + 7)) && corner[2] >= near {
        return [u32::MAX; WORDS];
    }
    let is_inside = |index: usize| {
        let c = grid.voxel(index);
        grid.contains(c) && c[2] >= near
    };
    words_of(|i| is_inside(brick * BRICK_VOXELS + i))
}

/// The words of a brick in which a voxel is set by its place in the brick.
pub fn words_of(is_on: impl Fn(usize) -> bool) -> [u32; WORDS] {
    std::array::from_fn(|w| (0..32).fold(0, |word, i| word | u32::from(is_on(32 * w + i)) << i))
}

/// Slots of the state of a set's voxels: one each in storage order, as far as there is room.
#[derive(Debug, Clone, Copy)]
pub struct Slots<'m> {
    pub mask: &'m [u32],
    /// Slot of the first voxel of each word.
    pub ranks: &'m [u32],
    pub room: u32,
}

impl Slots<'_> {
    /// The slot of a voxel.
    #[inline(always)]
    pub fn of(&self, index: usize) -> Option<usize> {
        let (word, bit) = (self.mask[index / 32], 1 << (index % 32));
        if word & bit == 0 {
            return None;
        }
        let slot = self.ranks[index / 32] + (word & (bit - 1)).count_ones();
        (slot < self.room).then_some(slot as usize)
    }
}

/// Slots of touched voxels: the active ones and, after them, the rim.
#[derive(Debug, Clone, Copy)]
pub struct Touched<'m> {
    active: Slots<'m>,
    rim: Option<Slots<'m>>,
}

impl<'m> Touched<'m> {
    /// Those of a dispatch by the buffers mask, ranks, rim_mask and rim_ranks.
    pub fn of_dispatch(call: &Call<'_>, [mask, ranks, rim, rim_ranks]: [&'m [u32]; 4]) -> Touched<'m> {
        let active = Slots { mask, ranks, room: call.scene.capacity };
        let rim = Slots { mask: rim, ranks: rim_ranks, room: call.scene.touched_capacity };
        Touched { active, rim: is_continuous(call).then_some(rim) }
    }

    /// The slot of a voxel.
    #[inline(always)]
    pub fn of(&self, index: usize) -> Option<usize> {
        self.active.of(index).or_else(|| self.rim.and_then(|rim| rim.of(index)))
    }
}

/// Whether samples are random points of voxels instead of centres.
pub fn is_continuous(call: &Call<'_>) -> bool {
    call.constant("CONTINUOUS", 1) != 0
}
