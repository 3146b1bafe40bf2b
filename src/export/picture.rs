//! Pictures in memory: the orientation of maps, colours, and a tiny font for figures.

use crate::maps::Maps;

/// What stands where there is nothing.
pub const BACKGROUND: [u8; 3] = [20, 20, 26];
/// Text and frames.
pub const INK: [u8; 3] = [230, 230, 230];
/// Pictures are enlarged by a whole factor to about this many pixels on the longer side.
pub const SIDE: usize = 512;

/// Viridis at ten even steps, reversed: near is bright, far is dark blue.
const VIRIDIS: [[u8; 3]; 10] = [
    [253, 231, 37],
    [181, 222, 43],
    [110, 206, 88],
    [53, 183, 121],
    [31, 158, 137],
    [38, 130, 142],
    [49, 104, 142],
    [62, 73, 137],
    [72, 40, 120],
    [68, 1, 84],
];

/// An RGB picture, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<u8>,
}

/// Map indices in picture order: rows from the largest y down, within a row from the smallest x up.
pub fn rows(maps: &Maps) -> Vec<usize> {
    (0..maps.ny).rev().flat_map(|iy| (0..maps.nx).map(move |ix| ix * maps.ny + iy)).collect()
}

/// The whole factor by which a map is enlarged.
pub fn enlargement(maps: &Maps) -> usize {
    ((SIDE as f64 / maps.nx.max(maps.ny) as f64).round() as usize).max(1)
}

/// The colour of a share from 0 (near, yellow) to 1 (far, purple).
pub fn colour(share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let (low, part) =
        ((at as usize).min(VIRIDIS.len() - 2), at - (at as usize).min(VIRIDIS.len() - 2) as f64);
    [0, 1, 2].map(|c| {
        let (a, b) = (f64::from(VIRIDIS[low][c]), f64::from(VIRIDIS[low + 1][c]));
        (a + part * (b - a)).round() as u8
    })
}

impl Picture {
    /// A picture of the background only.
    pub fn new(width: usize, height: usize) -> Picture {
        Picture { width, height, rgb: BACKGROUND.repeat(width * height) }
    }

    /// The maps' pixels, each as a square of `factor`, coloured by `colour` of the map index.
    pub fn of_maps(maps: &Maps, factor: usize, colour: impl Fn(usize) -> [u8; 3]) -> Picture {
        let mut picture = Picture::new(maps.nx * factor, maps.ny * factor);
        for (at, &pixel) in rows(maps).iter().enumerate() {
            let (column, row) = (at % maps.nx, at / maps.nx);
            picture.fill(column * factor, row * factor, factor, factor, colour(pixel));
        }
        picture
    }

    /// Fills a rectangle; what lies outside the picture is left out.
    pub fn fill(&mut self, x: usize, y: usize, width: usize, height: usize, colour: [u8; 3]) {
        for row in y.min(self.height)..(y + height).min(self.height) {
            for column in x.min(self.width)..(x + width).min(self.width) {
                let at = 3 * (row * self.width + column);
                self.rgb[at..at + 3].copy_from_slice(&colour);
            }
        }
    }

    /// Copies another picture in at (x, y); what lies outside is left out.
    pub fn paste(&mut self, other: &Picture, x: usize, y: usize) {
        for (at, pixel) in other.rgb.chunks_exact(3).enumerate() {
            let (column, row) = (at % other.width, at / other.width);
            self.fill(x + column, y + row, 1, 1, [pixel[0], pixel[1], pixel[2]]);
        }
    }

    /// Writes text (digits, `.`, `-`, `m`, blank; anything else is blank) with its upper left corner at
    /// (x, y), each dot of the font a square of `dot` pixels.
    pub fn text(&mut self, text: &str, x: usize, y: usize, dot: usize) {
        self.text_by(glyph, text, x, y, dot);
    }

    /// The same in a font of the caller's: a glyph of 5 x 7 dots per character, one number per row.
    pub fn text_by(&mut self, glyph: fn(char) -> [u8; 7], text: &str, x: usize, y: usize, dot: usize) {
        for (at, character) in text.chars().enumerate() {
            for (row, line) in glyph(character).iter().enumerate() {
                for column in (0..5).filter(|c| line >> (4 - c) & 1 == 1) {
                    self.fill(x + (6 * at + column) * dot, y + row * dot, dot, dot, INK);
                }
            }
        }
    }
}

/// A glyph of 5 x 7 dots, one number per row.
fn glyph(character: char) -> [u8; 7] {
    match character {
        '0' => [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111],
        '3' => [0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
        '.' => [0, 0, 0, 0, 0, 0b01100, 0b01100],
        '-' => [0, 0, 0, 0b11111, 0, 0, 0],
        'm' => [0, 0, 0b11010, 0b10101, 0b10101, 0b10101, 0b10101],
        _ => [0; 7],
    }
}
