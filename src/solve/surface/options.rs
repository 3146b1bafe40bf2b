//! The surface's options.

use crate::solve::option::options;

options! {
    /// The surface, which begins with the volume's maps.
    pub struct SurfaceOptions(suit) {
        nested {}
        "Vector solver" {
            /// Iterations of the surface, after those of the volume; 0 keeps the volume's maps
            iterations as "surface_iterations": usize = if suit.confocal { 60 } else { 100 },
                Range::Count(0, 1_000_000);
            /// Pixels of the surface, and so of the maps, per lateral voxel of the finest volume [default: 2 if the
            /// volume then has 64 lateral voxels or more, else 1]
            pixels_per_voxel: Option<usize> = None, Range::Count(0, 4096);
            /// Points that render a pixel of the surface: 1 or 4 [default: 1 if a pixel is no wider than 2.2 bins of
            /// path, else 4]
            points as "surface_points": Option<usize> = None, Range::OneOf(&[1, 4]);
            /// Gaussian that averages the surface's residuals along time at first. Its sigma is a path, in pixels of
            /// the first grid, or of a grid with 32 pixels per side if that is coarser. It narrows to 0 in half of the
            /// iterations
            // It helps a surface to find its place. With the cosine model of a confocal scan, it also makes the surface
            // fit the model's error (docs/surface.md).
            blur as "surface_blur": f64 = if !suit.confocal || suit.lambertian() { 0.4 } else { 0.0 },
                Range::NotNegative;
            /// Weight of the term that gathers the surface's light in few pixels, as a share of the data that the
            /// surface explains. The term is the mean of log(1 + 10 a / a_max) / 10 over albedos a
            sparsity as "surface_sparsity": f64 = match (suit.lambertian(), suit.confocal) {
                (true, _) => 0.05,
                (false, false) => 0.02,
                (false, true) => 0.0,
            }, Range::NotNegative;
        }
    }
}
