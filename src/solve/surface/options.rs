//! The surface's options.

use crate::solve::option::options;

options! {
    /// The surface that the volume's maps begin.
    pub struct SurfaceOptions(suit) {
        nested {}
        "Vector solver" {
            /// Iterations of the surface, after those of the volume; 0 leaves the volume's maps as they are
            iterations as "surface_iterations": usize = if suit.confocal { 60 } else { 100 },
                Range::Count(0, 1_000_000);
            /// Pixels of the surface, and so of the maps, side by side in a voxel of the finest volume [default: 2 if that leaves
            /// the volume 64 lateral voxels or more, else 1]
            pixels_per_voxel: Option<usize> = None, Range::Count(0, 4096);
            /// Points that a pixel of the surface is rendered as: 1 or 4 [default: 1 if a pixel is no wider than two bins of
            /// path, else 4]
            points as "surface_points": Option<usize> = None, Range::OneOf(&[1, 4]);
            /// Gaussian that averages the surface's residuals along time at first: sigma as path, in pixels of the first grid or of
            /// 32 a side if that is coarser; it narrows to 0 in half of the iterations
            // Helps a surface to find its place where the cosine model of a confocal scan does not (docs/surface.md).
            blur as "surface_blur": f64 = if !suit.confocal || suit.lambertian() { 0.4 } else { 0.0 },
                Range::NotNegative;
            /// Weight of the term that gathers the surface's light in few pixels, the mean of log(1 + 10 a / a_max) / 10 over
            /// albedos a, as a share of the data that the surface explains
            sparsity as "surface_sparsity": f64 = match (suit.lambertian(), suit.confocal) {
                (true, _) => 0.05,
                (false, false) => 0.02,
                (false, true) => 0.0,
            }, Range::NotNegative;
        }
    }
}
