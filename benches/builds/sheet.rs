//! A contact sheet: a row of pictures for each case, +x to the left and +y up.

use std::path::Path;

use thirdbounce::export::picture::{BACKGROUND, Picture, colour, enlargement};
use thirdbounce::export::png::{self, albedo_of, normal_of};
use thirdbounce::maps::{Maps, Truth, percentile};

/// Pictures of some 512 pixels are shrunk by this factor.
const SHRUNK: usize = 3;

/// Pixels from picture to picture, and lines for the words above a row.
const STEP: usize = 180;
const WORDS: usize = 18;

#[derive(Default)]
pub struct Sheet {
    rows: Vec<(String, Vec<Option<Picture>>)>,
}

impl Sheet {
    /// Mask, depth and normals of the truth, then albedo, depth and normals of each build. Depths share their colours.
    pub fn judged(&mut self, words: &str, truth: &Truth, builds: &[Option<&Maps>]) {
        let real = Maps {
            albedo: truth.mask.iter().map(|m| f32::from(u8::from(*m))).collect(),
            depth: truth.depth.clone(),
            normal: truth.normal.clone(),
            mask: truth.mask.clone(),
            ..Maps::empty([truth.nx, truth.ny], truth.extent)
        };
        let ends = ends(&real);
        let mut pictures = vec![Some(mask_of(&real)), Some(depth_of(&real, ends)), Some(normal_of(&real))];
        pictures.extend(builds.iter().flat_map(|maps| of_build(*maps, ends)));
        self.add(format!("{words}   [truth: mask, depth, normals; {}]", legend(builds.len())), pictures);
    }

    /// The albedo of three other methods in place of the truth, albedo, depth and normals of each build, then the albedo of the
    /// rest. Depths share the colours of the first build.
    pub fn captured(&mut self, words: &str, builds: &[Option<&Maps>], others: &[(&str, Option<&Maps>)]) {
        let ends = builds.iter().flatten().next().map_or([0.0; 2], |maps| ends(maps));
        let (first, rest) = others.split_at(others.len().min(3));
        let albedo = |(_, maps): &(&str, Option<&Maps>)| maps.map(albedo_of);
        let names = |all: &[(&str, Option<&Maps>)]| all.iter().map(|o| o.0).collect::<Vec<_>>().join(", ");
        let mut pictures: Vec<_> = first.iter().map(albedo).collect();
        pictures.resize(3, None);
        pictures.extend(builds.iter().flat_map(|maps| of_build(*maps, ends)));
        pictures.extend(rest.iter().map(albedo));
        let legend = [names(first), legend(builds.len()).into(), names(rest)].join("; ");
        self.add(format!("{words}   [{legend}]"), pictures);
    }

    fn add(&mut self, words: String, pictures: Vec<Option<Picture>>) {
        let shrunk = pictures.into_iter().map(|p| p.map(|p| p.shrunk(SHRUNK))).collect();
        self.rows.push((words, shrunk));
    }

    /// Writes the sheet, unless it has no rows.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, file: &Path) -> thirdbounce::Result<()> {
        if self.rows.is_empty() {
            return Ok(());
        }
        let columns = self.rows.iter().map(|r| r.1.len()).max().unwrap_or(0);
        let mut sheet = Picture::new(columns * STEP, self.rows.len() * (STEP + WORDS));
        for (row, (words, pictures)) in self.rows.iter().enumerate() {
            let top = row * (STEP + WORDS);
            sheet.text(words, [4, top + WORDS - 5]);
            for (k, picture) in pictures.iter().enumerate() {
                if let Some(picture) = picture {
                    sheet.paste(picture, k * STEP, top + WORDS);
                }
            }
        }
        png::write(file, &sheet)
    }
}

fn legend(builds: usize) -> &'static str {
    if builds > 1 { "a: albedo, depth, normals; b: the same" } else { "albedo, depth, normals" }
}

fn of_build(maps: Option<&Maps>, ends: [f32; 2]) -> [Option<Picture>; 3] {
    maps.map_or([None, None, None], |m| [Some(albedo_of(m)), Some(depth_of(m, ends)), Some(normal_of(m))])
}

/// Depths of the masked pixels: the 2nd and the 98th percentile, at least a twentieth of the width apart.
fn ends(maps: &Maps) -> [f32; 2] {
    let depths: Vec<f32> = maps.depth.iter().zip(&maps.mask).filter(|d| *d.1).map(|d| *d.0).collect();
    let [near, far] = [2.0, 98.0].map(|p| percentile(&depths, p).unwrap_or(0.0));
    let lacking = (0.05 * (maps.extent[1] - maps.extent[0]) as f32 - (far - near)).max(0.0);
    [near - 0.5 * lacking, far + 0.5 * lacking]
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
    Picture::of_maps(maps, enlargement(maps), colour)
}
