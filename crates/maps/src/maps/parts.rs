//! Removal of small mask parts with uncertain depths.
//!
//! Unmodelled light produces fragments at the borders of the box and beside bright objects. They are as bright as dim
//! parts of a surface, so no threshold separates them, but their depths are rough and steep, and hence their expected
//! error is large. Figures: benches/NOTES.md.

use serde::Serialize;

use super::lateral::{Maps, percentile};

/// A part is removed if its expected depth error exceeds this share of its width.
const OF_WIDTH: f64 = 0.25;

#[doc(hidden)]
impl Maps {
    /// Removes from the mask of each layer every connected part whose expected depth error exceeds a quarter of its
    /// width (the root of its area). The largest part is kept. Requires [`Maps::set_depth_error`]; returns whether any
    /// part was removed.
    pub fn leave_out_uncertain_parts(&mut self) -> bool {
        let sides = [self.nx, self.ny];
        let pixel = self.pixel();
        let mut changed = false;
        let first = self.depth_error.as_ref().map(|errors| (&mut self.mask, errors));
        let behind = self.behind.as_mut().and_then(|b| Some((&mut b.mask, b.depth_error.as_ref()?)));
        for (mask, errors) in first.into_iter().chain(behind) {
            let parts = parts_of(sides, mask);
            let largest = parts.iter().map(Vec::len).max().unwrap_or(0);
            for part in parts.iter().filter(|part| part.len() < largest) {
                let errors: Vec<f32> = part.iter().map(|i| errors[*i]).collect();
                let error = percentile(&errors, 50.0).map_or(f64::INFINITY, f64::from);
                if error > OF_WIDTH * pixel * (part.len() as f64).sqrt() {
                    part.iter().for_each(|i| mask[*i] = false);
                    changed = true;
                }
            }
        }
        changed
    }
}

/// A connected part of a mask: what can be said of it without truth.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MaskPart {
    /// Its pixels.
    pub pixels: usize,
    /// How far depths are off the plane that fits best, root mean square, metres.
    pub off_plane: f64,
    /// Standard deviation over mean of its albedos.
    pub albedo_spread: f64,
}

#[doc(hidden)]
impl Maps {
    /// The connected parts of the mask, the largest first.
    pub fn parts(&self) -> Vec<MaskPart> {
        let mut all = parts_of([self.nx, self.ny], &self.mask);
        all.sort_by_key(|part| std::cmp::Reverse(part.len()));
        all.iter().map(|part| self.part(part)).collect()
    }

    fn part(&self, pixels: &[usize]) -> MaskPart {
        let count = pixels.len() as f64;
        let mean = |of: &dyn Fn(usize) -> f64| pixels.iter().map(|p| of(*p)).sum::<f64>() / count;
        let place = |p: usize| {
            let [x, y] = self.centre(p / self.ny, p % self.ny);
            [x, y, f64::from(self.depth[p])]
        };
        let middle = [0, 1, 2].map(|k| mean(&|p| place(p)[k]));
        let product = |a: usize, b: usize| mean(&|p| (place(p)[a] - middle[a]) * (place(p)[b] - middle[b]));
        let [xx, xy, yy, xz, yz, zz] =
            [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)].map(|(a, b)| product(a, b));
        // What the regression of z on x and y explains; along a line only that line does.
        let determinant = xx * yy - xy * xy;
        let explained = if determinant > 1e-9 * xx * yy {
            (yy * xz * xz - 2.0 * xy * xz * yz + xx * yz * yz) / determinant
        } else {
            let along = xx + yy;
            if along > 0.0 { (xz * xz + yz * yz) / along } else { 0.0 }
        };
        let albedo = mean(&|p| f64::from(self.albedo[p]));
        let variance = mean(&|p| (f64::from(self.albedo[p]) - albedo).powi(2));
        MaskPart {
            pixels: pixels.len(),
            off_plane: (zz - explained).max(0.0).sqrt(),
            albedo_spread: if albedo > 0.0 { variance.sqrt() / albedo } else { 0.0 },
        }
    }
}

/// Connected parts of a mask, 8-connectivity.
fn parts_of([nx, ny]: [usize; 2], mask: &[bool]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; mask.len()];
    let mut parts = vec![];
    for begin in 0..mask.len() {
        if !mask[begin] || seen[begin] {
            continue;
        }
        seen[begin] = true;
        let mut part = vec![begin];
        let mut at = 0;
        while let Some(&i) = part.get(at) {
            let (x, y) = (i / ny, i % ny);
            for x in x.saturating_sub(1)..(x + 2).min(nx) {
                for j in (y.saturating_sub(1)..(y + 2).min(ny)).map(|y| x * ny + y) {
                    if mask[j] && !seen[j] {
                        seen[j] = true;
                        part.push(j);
                    }
                }
            }
            at += 1;
        }
        parts.push(part);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maps::Layer;

    /// Maps of 12 × 8 pixels of 0.1 m, whose mask is given by the letters of `picture`, and the expected error of
    /// each in metres.
    fn maps(picture: [&str; 8], error: impl Fn(char) -> f32) -> Maps {
        let at = |i: usize| picture[i % 8].as_bytes()[i / 8] as char;
        let all = || (0..12 * 8).map(at);
        Maps {
            albedo: vec![1.0; 96],
            depth: vec![1.0; 96],
            normal: vec![[0.0, 0.0, -1.0]; 96],
            mask: all().map(|c| c != '.').collect(),
            depth_error: Some(all().map(error).collect()),
            ..Maps::empty([12, 8], [0.0, 1.2, 0.0, 0.8])
        }
    }

    /// The letters of a picture inside the mask.
    fn left(maps: &Maps, mask: &[bool], picture: [&str; 8]) -> String {
        let at = |i: usize| picture[i % 8].as_bytes()[i / 8] as char;
        let mut all: Vec<char> = (0..maps.mask.len()).filter(|i| mask[*i]).map(at).collect();
        all.sort_unstable();
        all.dedup();
        all.into_iter().collect()
    }

    const PICTURE: [&str; 8] = [
        "AAAA....BB..",
        "AAAA....BB..",
        "AAAA........",
        "....A...CC..",
        ".....A..CC..",
        "............",
        "D..........E",
        "..........E.",
    ];

    #[test]
    fn small_parts_whose_depths_are_uncertain_go() {
        // B and C are 0.2 m wide: a quarter is 0.05 m. D is one pixel, E two diagonal pixels: 0.14 m.
        let error = |c: char| match c {
            'A' => 0.01,
            'B' => 0.049,
            'C' => 0.051,
            'D' => 0.024,
            _ => 0.036,
        };
        let mut maps = maps(PICTURE, error);
        assert!(maps.leave_out_uncertain_parts());
        assert_eq!(left(&maps, &maps.mask, PICTURE), "ABD");
        assert_eq!(maps.mask.iter().filter(|m| **m).count(), 14 + 4 + 1, "A hangs together over its corners");
        assert!(!maps.leave_out_uncertain_parts(), "what is left stays");
    }

    #[test]
    fn the_largest_part_stays_whatever_its_depths_are() {
        let mut all = maps(PICTURE, |_| 100.0);
        assert!(all.leave_out_uncertain_parts());
        assert_eq!(left(&all, &all.mask, PICTURE), "A");
        let mut untold = maps(PICTURE, |_| 100.0);
        untold.depth_error = None;
        assert!(!untold.leave_out_uncertain_parts());
        // A part without expected errors has no depth.
        let mut nowhere = maps(PICTURE, |c| if c == 'B' { f32::NAN } else { 0.0 });
        nowhere.leave_out_uncertain_parts();
        assert_eq!(left(&nowhere, &nowhere.mask, PICTURE), "ACDE");
    }

    #[test]
    fn layers_have_parts_of_their_own() {
        let mut both = maps(PICTURE, |_| 0.0);
        let behind = maps(PICTURE, |c| if c == 'A' { 0.0 } else { 1.0 });
        both.behind = Some(Layer {
            albedo: behind.albedo,
            depth: behind.depth,
            normal: behind.normal,
            mask: behind.mask,
            depth_error: behind.depth_error,
        });
        assert!(both.leave_out_uncertain_parts());
        assert_eq!(left(&both, &both.mask, PICTURE), "ABCDE");
        assert_eq!(left(&both, &both.behind.as_ref().unwrap().mask, PICTURE), "A");
    }

    #[test]
    fn a_part_says_how_far_it_is_off_its_plane() {
        let picture = [
            "aaaa........",
            "aaaa........",
            "aaaa........",
            "aaaa........",
            "............",
            "........bbb.",
            "............",
            "............",
        ];
        let mut maps = maps(picture, |_| 0.0);
        maps.mask =
            maps.albedo.iter().enumerate().map(|(i, _)| picture[i % 8].as_bytes()[i / 8] != b'.').collect();
        for i in 0..96 {
            let (x, y) = (i / 8, i % 8);
            // A tilted plane with a ripple that no plane explains, and a tilted line.
            let ripple = if (x + y) % 2 == 0 { 0.01 } else { -0.01 };
            maps.depth[i] = 1.0 + 0.02 * x as f32 - 0.03 * y as f32 + if y < 5 { ripple } else { 0.0 };
            maps.albedo[i] = if y < 5 && x % 2 == 0 { 3.0 } else { 1.0 };
        }
        let [large, line] = maps.parts()[..] else { panic!("two parts") };
        assert_eq!([large.pixels, line.pixels], [16, 3]);
        assert!((large.off_plane - 0.01).abs() < 1e-6 && line.off_plane < 1e-6, "{large:?} {line:?}");
        assert!((large.albedo_spread - 0.5).abs() < 1e-9 && line.albedo_spread == 0.0);
    }
}
