//! Pictures in memory: the orientation of maps, colours, captions.

use super::text;
use crate::maps::Maps;

/// Colour of pixels without content.
pub const BACKGROUND: [u8; 3] = [20, 20, 26];
/// Text and frames.
pub const INK: [u8; 3] = [230, 230, 230];
/// Pictures are enlarged by a whole factor to about this many pixels on the longer side.
pub const SIDE: usize = 512;

/// Size of text, in pixels per em.
const EM: f32 = 15.0;
/// Height of a capital letter of [`Picture::text`], in pixels.
pub const CAPITAL: usize = 11;
/// Width of a colour bar, and the gap between it and its labels.
const BAR: usize = 18;
const BESIDE: usize = 8;

/// An RGB picture, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue of every pixel: 3 · width · height bytes.
    pub rgb: Vec<u8>,
}

/// Map indices in picture order, as seen from the wall: rows from the largest y down, within a row from the largest x
/// down.
pub fn rows(maps: &Maps) -> Vec<usize> {
    (0..maps.ny).rev().flat_map(|iy| (0..maps.nx).rev().map(move |ix| ix * maps.ny + iy)).collect()
}

/// Integer factor by which a map is enlarged.
pub fn enlargement(maps: &Maps) -> usize {
    ((SIDE as f64 / maps.nx.max(maps.ny) as f64).round() as usize).max(1)
}

/// Colour of a unit normal in the convention of normal maps: red for right in the picture (-x), green for up, light
/// blue for facing the wall. `None` if the normal is unknown.
pub fn normal_colour(normal: [f32; 3]) -> Option<[u8; 3]> {
    let [x, y, z] = normal;
    let part = |v: f32| (255.0 * ((v + 1.0) / 2.0).clamp(0.0, 1.0)).round() as u8;
    normal.iter().all(|v| v.is_finite()).then(|| [-x, y, -z].map(part))
}

/// Colour of a share from 0 (near, yellow) to 1 (far, purple): viridis, reversed.
pub fn colour(share: f64) -> [u8; 3] {
    colorous::VIRIDIS.eval_continuous(1.0 - share.clamp(0.0, 1.0)).as_array()
}

impl Picture {
    /// A picture of the background only.
    pub fn new(width: usize, height: usize) -> Picture {
        Picture { width, height, rgb: BACKGROUND.repeat(width * height) }
    }

    /// The maps' pixels as squares of `factor` pixels, coloured by map index.
    pub fn of_maps(maps: &Maps, factor: usize, colour: impl Fn(usize) -> [u8; 3]) -> Picture {
        let mut picture = Picture::new(maps.nx * factor, maps.ny * factor);
        for (at, &pixel) in rows(maps).iter().enumerate() {
            let (column, row) = (at % maps.nx, at / maps.nx);
            picture.fill(column * factor, row * factor, factor, factor, colour(pixel));
        }
        picture
    }

    /// Fills a rectangle, clipped to the picture.
    pub fn fill(&mut self, x: usize, y: usize, width: usize, height: usize, colour: [u8; 3]) {
        for row in y.min(self.height)..(y + height).min(self.height) {
            for column in x.min(self.width)..(x + width).min(self.width) {
                let at = 3 * (row * self.width + column);
                self.rgb[at..at + 3].copy_from_slice(&colour);
            }
        }
    }

    /// Copies another picture to (x, y), clipped.
    pub fn paste(&mut self, other: &Picture, x: usize, y: usize) {
        for (at, pixel) in other.rgb.chunks_exact(3).enumerate() {
            let (column, row) = (at % other.width, at / other.width);
            self.fill(x + column, y + row, 1, 1, [pixel[0], pixel[1], pixel[2]]);
        }
    }

    /// Copies another picture, stretched to left, top, width and height.
    pub fn stretch(&mut self, other: &Picture, [x, y, width, height]: [usize; 4]) {
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let at = 3 * (row * other.height / height * other.width + column * other.width / width);
            self.fill(x + column, y + row, 1, 1, [other.rgb[at], other.rgb[at + 1], other.rgb[at + 2]]);
        }
    }

    /// Blends `colour` into the pixel `[column, row]`, if inside. `cover` is the weight of `colour`, from 0 to 1.
    pub fn blend(&mut self, [column, row]: [i32; 2], colour: [u8; 3], cover: f64) {
        let within = (0..self.width as i32).contains(&column) && (0..self.height as i32).contains(&row);
        if !within {
            return;
        }
        let at = 3 * (row as usize * self.width + column as usize);
        for (channel, ink) in self.rgb[at..at + 3].iter_mut().zip(colour) {
            *channel = (f64::from(*channel) * (1.0 - cover) + f64::from(ink) * cover).round() as u8;
        }
    }

    /// The picture reduced by `factor`: each pixel is the mean of a square of pixels.
    pub fn shrunk(&self, factor: usize) -> Picture {
        let (width, height) = (self.width / factor, self.height / factor);
        let mean = |at: usize| {
            let (column, row, channel) = (at / 3 % width, at / 3 / width, at % 3);
            let rows = (row * factor..(row + 1) * factor).map(|y| y * self.width + column * factor);
            let sum: usize = rows
                .flat_map(|from| from..from + factor)
                .map(|p| usize::from(self.rgb[3 * p + channel]))
                .sum();
            ((sum + factor * factor / 2) / (factor * factor)) as u8
        };
        Picture { width, height, rgb: (0..3 * width * height).map(mean).collect() }
    }

    /// Writes a line of text from `[x, y]` on the base line, at `em` pixels per em, clipped.
    pub fn write(&mut self, words: &str, at: [f32; 2], em: f32, colour: [u8; 3]) {
        text::write(words, at, em, |pixel, cover| self.blend(pixel, colour, cover));
    }

    /// Writes a line of text from `[x, y]` on the base line.
    pub fn text(&mut self, words: &str, [x, y]: [usize; 2]) {
        self.write(words, [x as f32, y as f32], EM, INK);
    }

    /// Draws a colour bar from row `top` to row `bottom`, with evenly spaced labels from top to bottom. Its colours
    /// are those of the shares from `first` at the top to `1 - first` at the bottom.
    pub fn colour_bar(
        &mut self,
        x: usize,
        [top, bottom]: [usize; 2],
        first: f64,
        labels: &[String],
        ink: [u8; 3],
    ) {
        self.fill(x - 1, top - 1, BAR + 2, bottom - top + 2, ink);
        for row in top..bottom {
            let down = (row - top) as f64 / (bottom - top - 1).max(1) as f64;
            self.fill(x, row, BAR, 1, colour(first + (1.0 - 2.0 * first) * down));
        }
        let steps = (labels.len() - 1).max(1);
        for (at, label) in labels.iter().enumerate() {
            let base = top + CAPITAL + (bottom - top - CAPITAL) * at / steps;
            self.write(label, [(x + BAR + BESIDE) as f32, base as f32], EM, ink);
        }
    }

    /// Width of a colour bar and its labels, in pixels.
    pub fn bar_width(labels: &[String]) -> usize {
        BAR + BESIDE + labels.iter().map(|l| text_width(l)).max().unwrap_or(0)
    }
}

/// Length of a line of [`Picture::text`], in pixels.
pub fn text_width(words: &str) -> usize {
    text::width(words, EM).ceil() as usize
}
