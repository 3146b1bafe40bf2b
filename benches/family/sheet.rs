//! A contact sheet: a row of pictures for each case, +x to the left and +y up.

use std::path::Path;

use thirdbounce::export::picture::{BACKGROUND, Picture, colour};
use thirdbounce::export::png::{self, albedo_of, normal_of};
use thirdbounce::maps::{Maps, Truth, percentile};

/// Pictures of some 512 pixels are shrunk by this factor.
const SHRUNK: usize = 3;

/// Pixels from picture to picture, and lines for the words above a row.
const STEP: usize = 180;
const WORDS: usize = 18;

#[derive(Default)]
pub struct Sheet {
    rows: Vec<(String, Vec<Picture>)>,
}

impl Sheet {
    /// Albedo, mask, depth and normals of a result; depth and normals of the truth. Depths share their colours.
    pub fn judged(&mut self, words: &str, maps: Option<&Maps>, truth: &Truth, iou: f64) {
        let real = Maps {
            albedo: truth.mask.iter().map(|m| f32::from(u8::from(*m))).collect(),
            depth: truth.depth.clone(),
            normal: truth.normal.clone(),
            mask: truth.mask.clone(),
            ..Maps::empty([truth.nx, truth.ny], truth.extent)
        };
        let ends = ends(&real);
        let mut pictures =
            maps.map_or(vec![], |m| vec![albedo_of(m), mask_of(m), depth_of(m, ends), normal_of(m)]);
        pictures.resize(4, Picture::new(STEP * SHRUNK, STEP * SHRUNK));
        pictures.extend([mask_of(&real), depth_of(&real, ends), normal_of(&real)]);
        let legend = "albedo, mask, depth, normals; true mask, depth, normals";
        self.add(format!("{words}   IoU {iou:.2}   [{legend}]"), &pictures);
    }

    /// Albedo, mask and depth of a result; the albedo of other methods.
    pub fn captured(&mut self, words: &str, maps: Option<&Maps>, names: &[&str], others: &[Option<&Maps>]) {
        let mut pictures = maps.map_or(vec![], |m| vec![albedo_of(m), mask_of(m), depth_of(m, ends(m))]);
        pictures.resize(3, Picture::new(STEP * SHRUNK, STEP * SHRUNK));
        pictures.extend(others.iter().map(|m| m.map_or(Picture::new(STEP, STEP), albedo_of)));
        self.add(format!("{words}   [albedo, mask, depth; {}]", names.join(", ")), &pictures);
    }

    fn add(&mut self, words: String, pictures: &[Picture]) {
        self.rows.push((words, pictures.iter().map(|p| p.shrunk(SHRUNK)).collect()));
    }

    pub fn write(&self, file: &Path) {
        let columns = self.rows.iter().map(|r| r.1.len()).max().unwrap_or(0);
        let mut sheet = Picture::new(columns * STEP, self.rows.len() * (STEP + WORDS));
        for (row, (words, pictures)) in self.rows.iter().enumerate() {
            let top = row * (STEP + WORDS);
            sheet.text(words, [4, top + WORDS - 5]);
            pictures.iter().enumerate().for_each(|(k, p)| sheet.paste(p, k * STEP, top + WORDS));
        }
        png::write(file, &sheet).expect("a file");
    }
}

/// Depths of the masked pixels: the 2nd and the 98th percentile.
fn ends(maps: &Maps) -> [f32; 2] {
    let depths: Vec<f32> = maps.depth.iter().zip(&maps.mask).filter(|d| *d.1).map(|d| *d.0).collect();
    [2.0, 98.0].map(|p| percentile(&depths, p).unwrap_or(0.0))
}

fn depth_of(maps: &Maps, [near, far]: [f32; 2]) -> Picture {
    let share = |depth: f32| f64::from((depth - near) / (far - near).max(f32::MIN_POSITIVE));
    drawn(maps, |p| {
        if maps.mask[p] && maps.depth[p].is_finite() { colour(share(maps.depth[p])) } else { BACKGROUND }
    })
}

fn mask_of(maps: &Maps) -> Picture {
    drawn(maps, |p| if maps.mask[p] { [255; 3] } else { BACKGROUND })
}

fn drawn(maps: &Maps, colour: impl Fn(usize) -> [u8; 3]) -> Picture {
    Picture::of_maps(maps, thirdbounce::export::picture::enlargement(maps), colour)
}
