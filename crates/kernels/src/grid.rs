//! The voxels of a scene, and their order of storage: brick by brick (x fastest among bricks), in Morton order inside a
//! brick, as in `glsl/include/grid.glsl`. The last bricks may extend beyond the grid.

use super::shared::SceneData;
use super::{Real, V3};

/// Voxels of a brick: 8 × 8 × 8.
pub const BRICK_VOXELS: usize = 512;

/// Storage index of voxel `c` among `bricks` bricks along x, y, z.
pub fn index(bricks: [usize; 3], c: [usize; 3]) -> usize {
    let brick = ((c[2] / 8) * bricks[1] + c[1] / 8) * bricks[0] + c[0] / 8;
    brick * BRICK_VOXELS + (spread(c[0] % 8) | spread(c[1] % 8) << 1 | spread(c[2] % 8) << 2)
}

/// Voxel of a storage index. It may lie outside the grid, as the last bricks may.
pub fn voxel(bricks: [usize; 3], index: usize) -> [usize; 3] {
    let (brick, inside) = (index / BRICK_VOXELS, index % BRICK_VOXELS);
    let at = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / (bricks[0] * bricks[1])];
    std::array::from_fn(|a| at[a] * 8 + gather(inside >> a))
}

fn spread(v: usize) -> usize {
    (v & 1) | (v & 2) << 2 | (v & 4) << 4
}

fn gather(v: usize) -> usize {
    (v & 1) | v >> 2 & 2 | v >> 4 & 4
}

/// The voxels of a scene.
#[derive(Debug, Clone, Copy)]
pub struct SceneGrid<F> {
    /// Voxels along x, y, z.
    pub n: [usize; 3],
    /// Bricks along x, y, z.
    pub bricks: [usize; 3],
    /// First z index that may be active.
    pub near_z: usize,
    /// Centre of voxel (0, 0, 0), metres.
    pub origin: V3<F>,
    /// Voxel size, metres.
    pub pitch: V3<F>,
}

impl<F: Real> SceneGrid<F> {
    /// The grid that a scene has.
    pub fn of(s: &SceneData) -> SceneGrid<F> {
        let count = |all: [u32; 3]| all.map(|n| n as usize);
        let vector = |[x, y, z]: [f32; 3]| V3 { x: F::from32(x), y: F::from32(y), z: F::from32(z) };
        SceneGrid {
            n: count([s.grid_x, s.grid_y, s.grid_z]),
            bricks: count([s.bricks_x, s.bricks_y, s.bricks_z]),
            near_z: s.near_z as usize,
            origin: vector([s.origin_x, s.origin_y, s.origin_z]),
            pitch: vector([s.pitch_x, s.pitch_y, s.pitch_z]),
        }
    }

    /// The voxels of half the lateral resolution.
    pub fn coarser(&self) -> SceneGrid<F> {
        let n = [self.n[0] / 2, self.n[1] / 2, self.n[2]];
        let two = F::of(2.0);
        let pitch = V3 { x: self.pitch.x * two, y: self.pitch.y * two, z: self.pitch.z };
        let shift = V3 { x: self.pitch.x / two, y: self.pitch.y / two, z: F::zero() };
        SceneGrid { n, bricks: n.map(|n| n.div_ceil(8)), origin: self.origin + shift, pitch, ..*self }
    }

    /// Number of voxels of the storage, including those of bricks beyond the grid.
    pub fn storage(&self) -> usize {
        self.bricks.iter().product::<usize>() * BRICK_VOXELS
    }

    /// True if voxel `c` lies in the grid.
    pub fn contains(&self, c: [usize; 3]) -> bool {
        (0..3).all(|a| c[a] < self.n[a])
    }

    /// Whether a voxel is in the grid and not too near.
    pub fn may_be_active(&self, c: [usize; 3]) -> bool {
        self.contains(c) && c[2] >= self.near_z
    }

    /// Storage index of voxel `c`.
    pub fn index(&self, c: [usize; 3]) -> usize {
        index(self.bricks, c)
    }

    /// Voxel of a storage index.
    pub fn voxel(&self, at: usize) -> [usize; 3] {
        voxel(self.bricks, at)
    }

    /// Position in metres from a position in voxels (0 = centre of the first voxel).
    #[inline(always)]
    pub fn position(&self, g: V3<F>) -> V3<F> {
        self.origin + g.times(self.pitch)
    }

    /// Least and largest depth of a surface, metres.
    pub fn depth_limits(&self) -> [F; 2] {
        let at = |z: usize| self.origin.z + self.pitch.z * F::of(z as f64);
        [at(self.near_z), at(self.n[2] - 1)]
    }
}
