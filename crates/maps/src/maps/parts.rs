//! Removal of small mask parts with uncertain depths.
//!
//! Unmodelled light produces fragments at the borders of the box and beside bright objects. They are as bright as dim
//! parts of a surface, so no threshold separates them, but their depths are rough and steep, and hence their expected
//! error is large. Figures: benches/NOTES.md.

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
}
