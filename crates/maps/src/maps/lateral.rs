//! Maps, layers behind them, and truth, pixel by pixel.

use crate::error::{Error, Result};

/// Reconstructed maps.
#[derive(Debug, Clone, PartialEq)]
pub struct Maps {
    /// Pixels along x.
    pub nx: usize,
    /// Pixels along y.
    pub ny: usize,
    /// (xmin, xmax, ymin, ymax) in metres, outer edges of the cells.
    pub extent: [f64; 4],
    /// Albedo at the depth map's voxel, in the solver's own scale. Never NaN; 0 where there is no surface.
    pub albedo: Vec<f32>,
    /// Depth z in metres; NaN = no surface.
    pub depth: Vec<f32>,
    /// Unit normals; NaN = no surface.
    pub normal: Vec<[f32; 3]>,
    /// True for pixels classified as surface ([`Maps::set_mask`], [`Maps::leave_out_uncertain_parts`]).
    pub mask: Vec<bool>,
    /// Share of the albedo's 99.9th percentile above which a pixel is surface; `None`: [`Maps::MASK_FRACTION`].
    pub mask_fraction: Option<f64>,
    /// Expected depth error in metres: two of three pixels with a given value have a smaller error
    /// ([`Maps::set_depth_error`]). NaN without surface. `None` if unknown.
    pub depth_error: Option<Vec<f32>>,
    /// Probability of surface, where a network had the last word on the mask.
    pub probability: Option<Vec<f32>>,
    /// Surfaces behind the first ones; `None` if no pixel has two.
    pub behind: Option<Layer>,
}

/// Surfaces behind the first ones of maps or of truth, by the same pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Albedo in the scale of the maps; 0 where there is no second surface. In truth: 1 where there is one.
    pub albedo: Vec<f32>,
    /// Depth z in metres; NaN = no second surface.
    pub depth: Vec<f32>,
    /// Unit normals; NaN = no second surface.
    pub normal: Vec<[f32; 3]>,
    /// True where the albedo is above the threshold of the first surfaces.
    pub mask: Vec<bool>,
    /// Expected depth error in metres, as in [`Maps::depth_error`]; `None` of truth.
    pub depth_error: Option<Vec<f32>>,
}

/// True maps of a simulated or independently rendered scene (`gt_*` in a truth file).
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Pixels along x.
    pub nx: usize,
    /// Pixels along y.
    pub ny: usize,
    /// (xmin, xmax, ymin, ymax) in metres, outer edges of the cells.
    pub extent: [f64; 4],
    /// z of the first hit along +z from (x, y, 0) in metres; NaN = miss.
    pub depth: Vec<f32>,
    /// Unit normal at that point, toward the wall; NaN = miss.
    pub normal: Vec<[f32; 3]>,
    /// True where there is surface.
    pub mask: Vec<bool>,
    /// Albedo at that point; NaN = miss. `None` where it is not known, as of truth that no simulator made.
    pub albedo: Option<Vec<f32>>,
    /// The next surface behind the first hit; `None` where no pixel has one.
    pub behind: Option<Layer>,
}

impl Layer {
    /// Names and lengths of the arrays.
    fn lengths(&self) -> Vec<(&'static str, usize)> {
        let depth_error = self.depth_error.iter().map(|c| ("the second layer's depth_error", c.len()));
        [
            ("the second layer's albedo", self.albedo.len()),
            ("the second layer's depth", self.depth.len()),
            ("the second layer's normal", self.normal.len()),
            ("the second layer's mask", self.mask.len()),
        ]
        .into_iter()
        .chain(depth_error)
        .collect()
    }
}

impl Maps {
    /// The default of [`Maps::mask_fraction`].
    pub const MASK_FRACTION: f64 = 0.3;

    /// Maps of `[nx, ny]` pixels without any surface. `extent` is (xmin, xmax, ymin, ymax) in metres.
    pub fn empty([nx, ny]: [usize; 2], extent: [f64; 4]) -> Maps {
        let count = nx * ny;
        Maps {
            nx,
            ny,
            extent,
            albedo: vec![0.0; count],
            depth: vec![f32::NAN; count],
            normal: vec![[f32::NAN; 3]; count],
            mask: vec![false; count],
            mask_fraction: None,
            depth_error: None,
            probability: None,
            behind: None,
        }
    }

    /// True for pixels with an albedo above `fraction` of [`Maps::white`] and above zero; false for NaN.
    #[doc(hidden)]
    pub fn mask_of(albedo: &[f32], fraction: f64) -> Vec<bool> {
        let threshold = (fraction * f64::from(Maps::white(albedo))) as f32;
        albedo.iter().map(|&a| a > threshold && a > 0.0).collect()
    }

    /// Reference albedo: the 99.9th percentile. If that is zero (less than a thousandth of the pixels is lit), the
    /// maximum; 0 if no pixel is lit.
    #[doc(hidden)]
    pub fn white(albedo: &[f32]) -> f32 {
        match percentile(albedo, 99.9) {
            Some(white) if white > 0.0 => white,
            _ => albedo.iter().copied().filter(|a| a.is_finite()).fold(0.0, f32::max),
        }
    }

    /// Number of pixels of the surface.
    #[doc(hidden)]
    pub fn surface_pixels(&self) -> usize {
        self.mask.iter().filter(|m| **m).count()
    }

    /// Median of the surface's pixels of a map with these values; `None` without any.
    #[doc(hidden)]
    pub fn median(&self, values: &[f32]) -> Option<f32> {
        let surface: Vec<f32> = values.iter().zip(&self.mask).filter(|(_, m)| **m).map(|(v, _)| *v).collect();
        percentile(&surface, 50.0)
    }

    /// Checks a mask fraction, if given.
    ///
    /// # Errors
    /// `Kind::Options`.
    #[doc(hidden)]
    pub fn check_mask_fraction(fraction: Option<f64>) -> Result<()> {
        match fraction.filter(|f| !(0.0..1.0).contains(f)) {
            None => Ok(()),
            Some(fraction) => Err(Error::options(
                format!("the mask fraction is {fraction}"),
                format!(
                    "give a share of the brightest albedo from 0 to below 1, usually {}",
                    Maps::MASK_FRACTION
                ),
            )),
        }
    }

    /// Sets `mask` from the albedo: pixels above `fraction`, or [`Maps::MASK_FRACTION`], of [`Maps::white`].
    pub fn set_mask(&mut self, fraction: impl Into<Option<f64>>) {
        self.mask_fraction = fraction.into();
        let fraction = self.mask_fraction.unwrap_or(Maps::MASK_FRACTION);
        let threshold = (fraction * f64::from(Maps::white(&self.albedo))) as f32;
        let above = |albedo: &[f32]| albedo.iter().map(|a| *a > threshold && *a > 0.0).collect();
        self.mask = above(&self.albedo);
        if let Some(behind) = &mut self.behind {
            behind.mask = above(&behind.albedo);
        }
    }

    /// Maps of one layer: these without the second layer, or the second layer. `None` if there is no such layer.
    pub fn layer(&self, layer: usize) -> Option<Maps> {
        let first = Maps { behind: None, ..self.clone() };
        match (layer, &self.behind) {
            (0, _) => Some(first),
            (1, Some(Layer { albedo, depth, normal, mask, depth_error })) => Some(Maps {
                albedo: albedo.clone(),
                depth: depth.clone(),
                normal: normal.clone(),
                mask: mask.clone(),
                depth_error: depth_error.clone(),
                ..first
            }),
            _ => None,
        }
    }

    /// Checks that all arrays have nx * ny values and that the extent is valid.
    ///
    /// # Errors
    /// `Kind::Input` naming the array.
    pub fn check(&self) -> Result<()> {
        let mut lengths = vec![
            ("albedo", self.albedo.len()),
            ("depth", self.depth.len()),
            ("normal", self.normal.len()),
            ("mask", self.mask.len()),
        ];
        lengths.extend(self.depth_error.iter().map(|c| ("depth_error", c.len())));
        lengths.extend(self.probability.iter().map(|c| ("probability", c.len())));
        lengths.extend(self.behind.iter().flat_map(Layer::lengths));
        check_grid([self.nx, self.ny], self.extent, &lengths)
    }

    /// The same maps with each pixel divided into `factor` × `factor`. Albedo is interpolated bilinearly between
    /// pixel centres. Depth and normal are means of the four surrounding pixels, weighted by interpolated albedo and
    /// restricted to 2.5 pixels of depth around the heaviest, so that no point falls between an edge and the surface
    /// behind it. Second layer and expected depth error are omitted.
    #[doc(hidden)]
    pub fn finer(&self, factor: usize) -> Maps {
        if factor <= 1 {
            return self.clone();
        }
        let [nx, ny] = [self.nx * factor, self.ny * factor];
        let [x0, x1, y0, y1] = self.extent;
        let edge = (2.5 * (x1 - x0) / self.nx as f64).max(2.5 * (y1 - y0) / self.ny as f64) as f32;
        let white = Maps::white(&self.albedo).max(f32::MIN_POSITIVE);
        // The two neighbouring pixels along an axis, and their weights.
        let between = |i: usize, n: usize| {
            let at = ((i as f32 + 0.5) / factor as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            [(at as usize, 1.0 - at.fract()), ((at as usize + 1).min(n - 1), at.fract())]
        };
        let mut all = Maps {
            nx,
            ny,
            albedo: vec![],
            depth: vec![],
            normal: vec![],
            mask: vec![],
            depth_error: None,
            probability: None,
            behind: None,
            ..*self
        };
        for (x, y) in (0..nx * ny).map(|i| (i / ny, i % ny)) {
            let [rows, columns] = [between(x, self.nx), between(y, self.ny)];
            let near = rows.map(|(i, a)| columns.map(|(j, b)| (i * self.ny + j, a * b)));
            let lit =
                near.concat().into_iter().map(|(from, share)| (from, share * self.albedo[from] / white));
            let lit: Vec<(usize, f32)> = lit.filter(|(from, _)| self.depth[*from].is_finite()).collect();
            let heaviest = lit.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|most| most.1 > 0.0);
            let (mut weight, mut depth, mut normal) = (0.0, 0.0, [0.0; 3]);
            for &(from, w) in &lit {
                if heaviest.is_none_or(|most| (self.depth[from] - self.depth[most.0]).abs() > edge) {
                    continue;
                }
                weight += w;
                depth += w * self.depth[from];
                (0..3).for_each(|k| normal[k] += w * self.normal[from][k]);
            }
            let long = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
            all.albedo.push(white * lit.iter().map(|l| l.1).sum::<f32>());
            all.depth.push(if weight > 0.0 { depth / weight } else { f32::NAN });
            all.normal.push(normal.map(|v| if long > 0.0 { v / long } else { f32::NAN }));
        }
        all.set_mask(self.mask_fraction);
        all
    }

    /// The pixel whose cell contains (x, y), `None` outside the extent.
    pub fn pixel_at(&self, x: f64, y: f64) -> Option<usize> {
        let cell = |v: f64, low: f64, high: f64, n: usize| {
            let at = (v - low) / (high - low) * n as f64;
            (at >= 0.0 && at < n as f64).then_some(at as usize)
        };
        let [x0, x1, y0, y1] = self.extent;
        Some(cell(x, x0, x1, self.nx)? * self.ny + cell(y, y0, y1, self.ny)?)
    }

    /// Centre (x, y) of a pixel in metres.
    pub fn centre(&self, ix: usize, iy: usize) -> [f64; 2] {
        centre([self.nx, self.ny], self.extent, ix, iy)
    }
}

impl Truth {
    /// Checks that all arrays have nx * ny values and that the extent is valid.
    ///
    /// # Errors
    /// `Kind::Input` naming the array.
    pub fn check(&self) -> Result<()> {
        let mut lengths = vec![
            ("gt_depth", self.depth.len()),
            ("gt_normal", self.normal.len()),
            ("gt_mask", self.mask.len()),
        ];
        lengths.extend(self.albedo.iter().map(|albedo| ("gt_albedo", albedo.len())));
        lengths.extend(self.behind.iter().flat_map(Layer::lengths));
        check_grid([self.nx, self.ny], self.extent, &lengths)
    }

    /// Centre (x, y) of a pixel in metres.
    pub fn centre(&self, ix: usize, iy: usize) -> [f64; 2] {
        centre([self.nx, self.ny], self.extent, ix, iy)
    }
}

/// The `p`th percentile (0 to 100) of the values that are not NaN, interpolated linearly between ranks as
/// numpy does; `None` if there are none.
pub fn percentile(values: &[f32], p: f64) -> Option<f32> {
    let mut sorted = Vec::with_capacity(values.len());
    sorted.extend(values.iter().copied().filter(|v| !v.is_nan()));
    if sorted.is_empty() {
        return None;
    }
    let rank = (p / 100.0).clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let (_, low, above) = sorted.select_nth_unstable_by(rank.floor() as usize, f32::total_cmp);
    let low = *low;
    let high = if rank.ceil() > rank { above.iter().copied().min_by(f32::total_cmp) } else { None };
    let high = high.unwrap_or(low);
    let part = rank - rank.floor();
    Some(if part == 0.0 { low } else { (f64::from(low) * (1.0 - part) + f64::from(high) * part) as f32 })
}

fn centre([nx, ny]: [usize; 2], [x0, x1, y0, y1]: [f64; 4], ix: usize, iy: usize) -> [f64; 2] {
    [x0 + (ix as f64 + 0.5) * (x1 - x0) / nx as f64, y0 + (iy as f64 + 0.5) * (y1 - y0) / ny as f64]
}

fn check_grid([nx, ny]: [usize; 2], extent: [f64; 4], lengths: &[(&str, usize)]) -> Result<()> {
    let [x0, x1, y0, y1] = extent;
    if !extent.iter().all(|v| v.is_finite()) || x0 >= x1 || y0 >= y1 {
        return Err(Error::input(
            format!("the extent {extent:?} is not a valid (xmin, xmax, ymin, ymax)"),
            "give the outer edges of the map in metres",
        ));
    }
    if nx == 0 || ny == 0 {
        return Err(Error::input(format!("the maps are {nx} x {ny}"), "maps need at least one pixel"));
    }
    match lengths.iter().find(|(_, length)| nx.checked_mul(ny) != Some(*length)) {
        None => Ok(()),
        Some((name, length)) => Err(Error::input(
            format!("{name} holds {length} values for {nx} x {ny} pixels"),
            "all maps hold one value per pixel, [ix, iy]",
        )),
    }
}
