//! Expected depth error of a result.
//!
//! Errors increase with the dimness of a pixel, the slope of its surface and the roughness of surrounding depths;
//! over a whole map with the width of bins and impulse response, and with a single laser or sensor point. Noisy data
//! are smoothed, which makes roughness less informative. The expected error is a product of powers of these factors,
//! in pixels, from a quantile regression over reconstructions with truth (benches/NOTES.md).

use super::lateral::{Layer, Maps};
use super::smooth::{slope, smoothed};

/// The error, in pixels, where all factors are 1.
const USUAL: f64 = 0.88;

/// Powers of the albedo over the typical albedo, and of the cosine between the surface's normal and the wall's.
const BRIGHT: f64 = -1.0;
const FACING: f64 = -1.9;

/// Powers of the aperture, and of the width of a bin with its impulse response over that of a pixel.
const APERTURE: f64 = -1.0;
const WIDTH: f64 = 0.6;

/// Power of the roughness in the absence of noise.
const ROUGH: f64 = 1.08;

/// Factor of the error for models with two cosines, which determine normals, and thus depths, better.
const TWO_COSINES: f64 = 0.76;

/// Limits of the brightness, and the minimum cosine.
const DIMMEST: f64 = 0.1;
const BRIGHTEST: f64 = 1.5;
const STEEPEST: f64 = 0.15;

/// Roughness of a perfect surface, and the sigma of the reference Gaussian, in pixels.
const SMOOTHEST: f64 = 0.03;
const AROUND: f64 = 1.0;

/// Weight of a pixel outside the mask in means of depth.
const BESIDE: f64 = 1e-6;

/// Depth error of a volume from representing a voxel by its centre: shares of its width and its depth.
const OF_WIDTH: f64 = 0.25;
const OF_DEPTH: f64 = 0.5;

/// Properties of the data and of the solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// Expected energy of the noise over the energy of the measurement: 0 without noise, 1 without light.
    pub noise: f64,
    /// Combined width of a bin, the impulse response and the path spread of the spots, metres of path.
    pub width: f64,
    /// Mean extent of laser and sensor points over that of all points: 1 if both cover the wall, 1/2 if one of them is a
    /// single point.
    pub aperture: f64,
    /// Width and depth of a voxel in metres if depths are those of voxels; 0 for surfaces.
    pub voxel: [f64; 2],
    /// Whether the model is Lambertian, with a cosine at both ends of a path.
    pub two_cosines: bool,
}

#[doc(hidden)]
impl Maps {
    /// Sets the expected depth error of all layers in metres: two of three pixels with a given value have a smaller
    /// error. NaN for pixels without a depth. Values outside the mask are rough guesses.
    pub fn set_depth_error(&mut self, known: &Conditions) {
        let expected = |maps: &Maps| maps.expected_errors(known);
        let second = self.layer(1).map(|maps| expected(&maps));
        self.depth_error = Some(expected(self));
        if let (Some(Layer { depth_error, .. }), Some(second)) = (&mut self.behind, second) {
            *depth_error = Some(second);
        }
    }

    /// Expected errors of one layer, metres.
    fn expected_errors(&self, known: &Conditions) -> Vec<f32> {
        let pixel = self.pixel();
        let usual = self.usual_albedo();
        let depth: Vec<f64> = self.depth.iter().map(|z| f64::from(*z) / pixel).collect();
        let shown: Vec<bool> = depth.iter().zip(&self.mask).map(|(z, m)| *m && z.is_finite()).collect();
        let rough = self.roughness(&depth, &shown);
        let everywhere = USUAL
            * if known.two_cosines { TWO_COSINES } else { 1.0 }
            * known.aperture.powf(APERTURE)
            * (known.width / pixel).powf(WIDTH);
        let roughness = ROUGH * (1.0 - known.noise);
        let of_voxel = (OF_WIDTH * known.voxel[0]).hypot(OF_DEPTH * known.voxel[1]);
        let of = |i: usize| {
            let bright = (f64::from(self.albedo[i]) / usual).clamp(DIMMEST, BRIGHTEST);
            let error = everywhere
                * bright.powf(BRIGHT)
                * self.facing(&depth, &shown, i).max(STEEPEST).powf(FACING)
                * (rough[i] + SMOOTHEST).powf(roughness);
            if depth[i].is_finite() { (error * pixel).hypot(of_voxel) as f32 } else { f32::NAN }
        };
        (0..depth.len()).map(of).collect()
    }

    /// Side of a pixel, metres.
    pub(super) fn pixel(&self) -> f64 {
        let [x0, x1, y0, y1] = self.extent;
        ((x1 - x0) / self.nx as f64 * (y1 - y0) / self.ny as f64).sqrt()
    }

    /// Median albedo of the mask; 1 without a mask.
    fn usual_albedo(&self) -> f64 {
        let lit = self.albedo.iter().zip(&self.mask).filter(|(a, m)| **m && **a > 0.0);
        let mut brightness = Vec::with_capacity(self.albedo.len());
        brightness.extend(lit.map(|(a, _)| *a));
        super::percentile(&brightness, 50.0).map_or(1.0, f64::from)
    }

    /// The cosine between the wall's normal and that of the surface through a pixel's neighbours.
    fn facing(&self, depth: &[f64], shown: &[bool], i: usize) -> f64 {
        let [x, y] = slope([self.nx, self.ny], depth, shown, i);
        1.0 / (1.0 + x * x + y * y).sqrt()
    }

    /// Root mean square deviation of the depths around each pixel from the smoothed depth.
    fn roughness(&self, depth: &[f64], shown: &[bool]) -> Vec<f64> {
        let [nx, ny] = [self.nx, self.ny];
        let weight = |i: usize| match (shown[i], depth[i].is_finite()) {
            (true, _) => 1.0,
            (false, true) => BESIDE,
            (false, false) => 0.0,
        };
        let weights: Vec<f64> = (0..depth.len()).map(weight).collect();
        let around = smoothed([nx, ny], &weights, AROUND);
        let mean = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let weighted = |i: usize| if weights[i] > 0.0 { weights[i] * of(i) } else { 0.0 };
            let all: Vec<f64> = (0..depth.len()).map(weighted).collect();
            let sums = smoothed([nx, ny], &all, AROUND);
            sums.iter().zip(&around).map(|(s, w)| if *w > 0.0 { s / w } else { 0.0 }).collect()
        };
        let smooth = mean(&|i| depth[i]);
        mean(&|i| (depth[i] - smooth[i]).powi(2)).into_iter().map(f64::sqrt).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 24;
    const KNOWN: Conditions =
        Conditions { noise: 0.0, width: 0.01, aperture: 1.0, voxel: [0.0; 2], two_cosines: false };

    /// Maps with pixels of 1 cm and given (albedo, depth in metres).
    fn maps(of: impl Fn(usize, usize) -> (f32, f64)) -> Maps {
        let all: Vec<(f32, f64)> = (0..SIDE * SIDE).map(|i| of(i / SIDE, i % SIDE)).collect();
        let mut maps = Maps {
            albedo: all.iter().map(|p| p.0).collect(),
            depth: all.iter().map(|p| p.1 as f32).collect(),
            ..Maps::empty([SIDE, SIDE], [0.0, 0.24, 0.0, 0.24])
        };
        maps.set_mask(0.3);
        maps
    }

    fn expected(mut maps: Maps, known: Conditions) -> Vec<f32> {
        maps.set_depth_error(&known);
        maps.check().unwrap();
        maps.depth_error.unwrap()
    }

    /// Value in the middle of the map.
    fn middle(maps: Maps, known: Conditions) -> f64 {
        f64::from(expected(maps, known)[SIDE / 2 * SIDE + SIDE / 2])
    }

    fn flat(_: usize, _: usize) -> (f32, f64) {
        (1.0, 0.5)
    }

    #[test]
    fn a_perfect_plate_is_certain_to_a_fraction_of_a_pixel() {
        let error = middle(maps(flat), KNOWN);
        let wanted = 0.01 * USUAL * SMOOTHEST.powf(ROUGH);
        assert!((error / wanted - 1.0).abs() < 0.02, "{error} {wanted}");
        assert!((1e-4..1e-3).contains(&error));
    }

    #[test]
    fn dim_steep_and_rough_pixels_are_less_certain() {
        let usual = middle(maps(flat), KNOWN);
        let is_middle = |x: usize, y: usize| (x, y) == (SIDE / 2, SIDE / 2);
        let dim = middle(maps(|x, y| (if is_middle(x, y) { 0.5 } else { 1.0 }, 0.5)), KNOWN);
        assert!((dim / usual - 0.5f64.powf(BRIGHT)).abs() < 0.05, "{}", dim / usual);
        // At 60 degrees to the wall, along either axis; the roughness of a plane is the width of the Gaussian.
        let steep = [0, 1].map(|axis| {
            middle(maps(|x, y| (1.0, 0.5 + 0.01 * 3f64.sqrt() * [x, y][axis] as f64)), KNOWN) / usual
        });
        assert!(steep[0] > 0.5f64.powf(FACING) && (steep[0] / steep[1] - 1.0).abs() < 1e-3, "{steep:?}");
        let rough = |deep: f64| middle(maps(|x, y| (1.0, 0.5 + deep * ((x + y) % 2) as f64)), KNOWN);
        assert!(rough(0.01) > 4.0 * usual && rough(0.02) > 1.5 * rough(0.01));
    }

    #[test]
    fn wide_bins_and_one_laser_point_make_all_less_certain() {
        let of = |known: Conditions| middle(maps(flat), known) / middle(maps(flat), KNOWN);
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-5;
        assert!(near(of(Conditions { two_cosines: true, ..KNOWN }), TWO_COSINES));
        assert!(near(of(Conditions { width: 0.02, ..KNOWN }), 2f64.powf(WIDTH)));
        assert!(near(of(Conditions { aperture: 0.5, ..KNOWN }), 0.5f64.powf(APERTURE)));
    }

    #[test]
    fn the_noisier_the_less_a_smooth_map_tells() {
        let bumpy = |x: usize, y: usize| (1.0, 0.5 + 0.005 * ((x + y) % 2) as f64);
        let of = |noise: f64| {
            let known = Conditions { noise, ..KNOWN };
            [middle(maps(flat), known), middle(maps(bumpy), known)]
        };
        let [exact, noisy, lost] = [0.0, 0.5, 1.0].map(of);
        assert!(exact[1] > 10.0 * exact[0] && noisy[1] > 2.0 * noisy[0] && noisy[1] < 5.0 * noisy[0]);
        assert!(
            exact[0] < noisy[0] && noisy[0] < lost[0],
            "flat maps are less certain: {exact:?} {noisy:?} {lost:?}"
        );
        assert!((lost[1] / lost[0] - 1.0).abs() < 1e-6 && (lost[0] / (0.01 * USUAL) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn depths_of_voxels_are_at_least_half_a_voxel_off() {
        let error = |voxel: [f64; 2]| middle(maps(flat), Conditions { voxel, ..KNOWN });
        let [flat, wide] = [error([0.0, 0.02]), error([0.04, 0.02])];
        assert!((0.01..0.0101).contains(&flat) && (0.0141..0.0143).contains(&wide), "{flat} {wide}");
    }

    #[test]
    fn other_units_and_scales_of_albedo_change_nothing() {
        let bumpy = |x: usize, y: usize| (1.0 + 0.1 * (x % 3) as f32, 0.5 + 0.002 * (x * y % 7) as f64);
        let one = expected(maps(bumpy), KNOWN);
        let mut large = maps(|x, y| (5.0 * bumpy(x, y).0, 1e3 * bumpy(x, y).1));
        large.extent = large.extent.map(|v| 1e3 * v);
        let large = expected(large, Conditions { width: 1e3 * KNOWN.width, ..KNOWN });
        for (a, b) in one.iter().zip(&large) {
            assert!((1e3 * a / b - 1.0).abs() < 1e-2, "{a} {b}");
        }
    }

    #[test]
    fn nothing_is_told_where_there_is_no_depth() {
        let half = |x: usize, y: usize| if x < 12 { flat(x, y) } else { (0.0, f64::NAN) };
        let all = expected(maps(half), KNOWN);
        assert!(all.iter().enumerate().all(|(i, c)| c.is_nan() == (i >= 12 * SIDE)));
        // Equal expected error at a plate's edge and inside: pixels outside the mask have no weight.
        assert!((all[11 * SIDE + 12] / all[5 * SIDE + 12] - 1.0).abs() < 0.02);
        assert!(expected(maps(|_, _| (0.0, f64::NAN)), KNOWN).iter().all(|c| c.is_nan()));
    }

    #[test]
    fn each_layer_has_its_own() {
        let mut both = maps(flat);
        let back = maps(|x, y| (0.5, 0.7 + 0.02 * ((x + y) % 2) as f64));
        both.behind = Some(Layer {
            albedo: back.albedo,
            depth: back.depth,
            normal: back.normal,
            mask: back.mask,
            depth_error: None,
        });
        both.set_depth_error(&KNOWN);
        let at = SIDE / 2 * SIDE + SIDE / 2;
        let [first, second] = [0, 1].map(|l| both.layer(l).unwrap().depth_error.unwrap()[at]);
        assert!(second > 2.0 * first, "{first} {second}");
    }
}
