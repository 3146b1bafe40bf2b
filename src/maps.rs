//! Lateral maps: what a reconstruction yields and what the truth is given as.
//!
//! All maps are stored `[ix * ny + iy]`, ix along +x, iy along +y; a pixel is a cell of the extent, its
//! value belongs to the cell's centre. NaN = nothing there.

/// Reconstructed maps.
#[derive(Debug, Clone, PartialEq)]
pub struct Maps {
    pub nx: usize,
    pub ny: usize,
    /// (xmin, xmax, ymin, ymax) in metres, outer edges of the cells.
    pub extent: [f64; 4],
    /// Albedo at the depth map's voxel, in the solver's own scale. Never NaN; 0 where nothing is.
    pub albedo: Vec<f32>,
    /// Depth z in metres; NaN = nothing there.
    pub depth: Vec<f32>,
    /// Unit normals; NaN = nothing there.
    pub normal: Vec<[f32; 3]>,
    /// True where the albedo is above [`Maps::mask_fraction`] of its 99.9th percentile.
    pub mask: Vec<bool>,
    pub mask_fraction: f64,
}

/// True maps of a simulated or independently rendered scene (`gt_*` in a truth file).
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    pub nx: usize,
    pub ny: usize,
    /// (xmin, xmax, ymin, ymax) in metres, outer edges of the cells.
    pub extent: [f64; 4],
    /// z of the first hit along +z from (x, y, 0) in metres; NaN = miss.
    pub depth: Vec<f32>,
    /// Unit normal there, towards the wall; NaN = miss.
    pub normal: Vec<[f32; 3]>,
    pub mask: Vec<bool>,
}
