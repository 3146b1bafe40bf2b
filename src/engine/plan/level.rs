//! One level of a solve: a grid, the pairs that are used on it, and the buffers that hold what is its own.

use crate::gpu::Buffer;
use crate::transport::Grid;

/// Pairs of wall points as passes over pairs see them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelPairs {
    /// How many.
    pub count: usize,
    /// Their scanned points.
    pub scanned: usize,
    /// Their other points.
    pub others: usize,
    /// Buffer that holds these points.
    pub wall: Buffer,
    /// Buffer that holds the level's constants with their numbers.
    pub scene: Buffer,
}

/// One step of the coarse-to-fine sequence: a resolution, and the pairs that are used on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// The volume at this resolution.
    pub grid: Grid,
    /// The first pair that is used: 0, but for a batch.
    pub first: usize,
    /// How many pairs are used.
    pub pairs: usize,
    /// Buffer that holds the measurement of these pairs.
    pub measured: Buffer,
    /// Buffer that holds the wall points of these pairs.
    pub wall: Buffer,
    /// Buffer that holds its constants.
    pub scene: Buffer,
    /// The pairs that light is rendered for: its own, or those that cover their spots.
    pub rendered: LevelPairs,
    /// Buffer that says which bricks can reach a bin.
    pub reachable: Buffer,
}
