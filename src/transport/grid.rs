//! The hidden volume's voxel grid and its storage order.

use glam::{DVec3, dvec3};

use crate::advice::advice;
use crate::{Error, Result};

pub use thirdbounce_kernels::BRICK_VOXELS;

/// The box that is reconstructed, up to the outer faces of its voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// Lowest corner, metres.
    pub min: DVec3,
    /// Highest corner, metres.
    pub max: DVec3,
}

/// A regular grid of voxels.
///
/// The order of storage is that of kernels ([`thirdbounce_kernels::index`]). The last bricks may extend beyond the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Voxels along x, y, z.
    pub n: [usize; 3],
    /// Centre of voxel (0, 0, 0) in metres.
    pub origin: DVec3,
    /// Voxel size in metres.
    pub pitch: DVec3,
}

impl Grid {
    /// A grid of `lateral` × `lateral` voxels over the volume's x and y. Along z, voxels of `depth_pitch` metres fill
    /// the volume's depth, with centres at whole multiples of the pitch (as in the paper, where depth k · pitch is
    /// voxel k).
    ///
    /// # Errors
    /// An empty or non-finite volume, no lateral voxels, a pitch that is not positive, more than 2^30 voxels.
    #[doc(hidden)]
    pub fn new(volume: Volume, lateral: usize, depth_pitch: f64) -> Result<Grid> {
        let size = volume.max - volume.min;
        if !(size.is_finite() && size.min_element() > 0.0 && volume.min.is_finite()) {
            return Err(Error::options(
                format!("the hidden volume is empty: from {} to {} m", volume.min, volume.max),
                advice!["check " Gate " and the wall's size against the capture (" [Capture] ")"],
            ));
        }
        if lateral == 0 || !(depth_pitch.is_finite() && depth_pitch > 0.0) {
            return Err(Error::options(
                format!("a grid of {lateral} lateral voxels with a depth pitch of {depth_pitch} m"),
                advice!["give " Lateral " at least 1 and " DepthPitch " a positive length in metres"],
            ));
        }
        let first = (volume.min.z / depth_pitch - 1e-6).ceil().max(0.0);
        let last = (volume.max.z / depth_pitch + 1e-6).floor().max(first);
        let deep = last - first + 1.0;
        let bricks = (lateral.div_ceil(8) as f64).powi(2) * (deep / 8.0).ceil();
        if bricks * BRICK_VOXELS as f64 > f64::from(1 << 30) {
            return Err(Error::memory(
                format!("a grid of {lateral} x {lateral} x {deep} voxels exceeds 2^30"),
                advice!["use a smaller " Lateral " or a larger " DepthPitch],
            ));
        }
        let pitch = dvec3(size.x / lateral as f64, size.y / lateral as f64, depth_pitch);
        let origin = dvec3(volume.min.x + 0.5 * pitch.x, volume.min.y + 0.5 * pitch.y, first * depth_pitch);
        Ok(Grid { n: [lateral, lateral, deep as usize], origin, pitch })
    }

    /// The same box at `1 / factor` of the lateral resolution; `factor` divides it.
    #[doc(hidden)]
    pub fn coarser(&self, factor: usize) -> Grid {
        let n = [self.n[0] / factor, self.n[1] / factor, self.n[2]];
        let pitch = self.pitch * dvec3(factor as f64, factor as f64, 1.0);
        let corner = self.origin - 0.5 * self.pitch;
        Grid { n, origin: corner + 0.5 * pitch, pitch }
    }

    /// Bricks along x, y, z.
    #[doc(hidden)]
    pub fn bricks(&self) -> [usize; 3] {
        self.n.map(|n| n.div_ceil(8))
    }

    /// Number of voxels of the grid.
    pub fn voxels(&self) -> usize {
        self.n.iter().product()
    }

    /// Number of voxels of the storage, including those of bricks beyond the grid.
    #[doc(hidden)]
    pub fn storage(&self) -> usize {
        self.bricks().iter().product::<usize>() * BRICK_VOXELS
    }

    /// True if voxel `c` lies in the grid.
    pub fn contains(&self, c: [usize; 3]) -> bool {
        (0..3).all(|a| c[a] < self.n[a])
    }

    /// Storage index of voxel `c`.
    pub fn index(&self, c: [usize; 3]) -> usize {
        thirdbounce_kernels::index(self.bricks(), c)
    }

    /// Voxel of a storage index. It may lie outside the grid, as the last bricks may.
    pub fn voxel(&self, index: usize) -> [usize; 3] {
        thirdbounce_kernels::voxel(self.bricks(), index)
    }

    /// Position in metres from a position in voxels (0 = centre of the first voxel).
    pub fn position(&self, g: DVec3) -> DVec3 {
        self.origin + g * self.pitch
    }

    /// (xmin, xmax, ymin, ymax) in metres, outer faces.
    pub fn extent(&self) -> [f64; 4] {
        let low = self.origin - 0.5 * self.pitch;
        [low.x, low.x + self.pitch.x * self.n[0] as f64, low.y, low.y + self.pitch.y * self.n[1] as f64]
    }

    /// (zmin, zmax) in metres, outer faces.
    pub fn depth_range(&self) -> [f64; 2] {
        let low = self.origin.z - 0.5 * self.pitch.z;
        [low, low + self.pitch.z * self.n[2] as f64]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn storage_holds_every_voxel_once_and_neighbours_close() {
        let volume = Volume { min: dvec3(-1.0, -0.5, 0.3), max: dvec3(1.0, 0.5, 0.52) };
        let grid = Grid::new(volume, 10, 0.02).unwrap();
        assert_eq!(grid.n, [10, 10, 12]);
        let mut seen = vec![false; grid.storage()];
        for (i, seen) in seen.iter_mut().enumerate() {
            let c = grid.voxel(i);
            assert_eq!(grid.index(c), i);
            assert!(!std::mem::replace(seen, true));
        }
        assert_eq!((0..grid.storage()).filter(|i| grid.contains(grid.voxel(*i))).count(), grid.voxels());
        assert_eq!(grid.index([1, 0, 0]), 1);
        assert_eq!(grid.index([0, 1, 0]), 2);
        assert_eq!(grid.index([0, 0, 1]), 4);
        assert_eq!(grid.index([8, 0, 0]), 512);
    }

    #[test]
    fn centres_lie_at_multiples_of_the_depth_pitch_and_coarser_grids_cover_the_same_box() {
        let volume = Volume { min: dvec3(-1.0, -1.0, 0.2), max: dvec3(1.0, 1.0, 1.0) };
        let grid = Grid::new(volume, 64, 0.006).unwrap();
        let z = grid.position(dvec3(0.0, 0.0, 66.0)).z;
        assert!((z / 0.006 - (z / 0.006).round()).abs() < 1e-9);
        let coarse = grid.coarser(4);
        assert_eq!(coarse.n[..2], [16, 16]);
        assert_eq!(coarse.extent(), grid.extent());
        assert!((coarse.extent()[0] + 1.0).abs() < 1e-12);
        assert!(Grid::new(Volume { min: volume.max, max: volume.min }, 8, 0.1).is_err());
        assert!(Grid::new(volume, 8, f64::NAN).is_err());
        assert!(Grid::new(volume, 1 << 20, 1e-6).is_err());
    }
}
