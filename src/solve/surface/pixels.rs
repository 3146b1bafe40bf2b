//! The pixels that a surface has.

use crate::maps::Maps;

/// Share of the map's white that a pixel's albedo must have.
const SUPPORT: f32 = 0.1;

/// Pixels of a surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Pixels {
    /// Index of each among the maps' pixels, ascending.
    pub columns: Vec<u32>,
    /// Albedo of each.
    pub albedo: Vec<f32>,
    /// Depth of each, metres.
    pub depth: Vec<f32>,
}

impl Pixels {
    /// Those of `maps` that are bright enough, the brightest if there are more than `most`.
    pub fn of(maps: &Maps, most: usize) -> Pixels {
        let threshold = SUPPORT * Maps::white(&maps.albedo);
        let mut columns: Vec<u32> = (0..maps.albedo.len() as u32)
            .filter(|c| maps.albedo[*c as usize] > threshold && maps.depth[*c as usize].is_finite())
            .collect();
        if columns.len() > most {
            columns.sort_by(|a, b| maps.albedo[*b as usize].total_cmp(&maps.albedo[*a as usize]));
            columns.truncate(most);
            columns.sort_unstable();
        }
        let of = |from: &[f32]| columns.iter().map(|c| from[*c as usize]).collect();
        Pixels { albedo: of(&maps.albedo), depth: of(&maps.depth), columns }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// The buffer `pixels`.
    pub fn words(&self) -> Vec<[u32; 4]> {
        let word = |(c, (a, z)): (&u32, (&f32, &f32))| [*c, a.to_bits(), z.to_bits(), 0];
        self.columns.iter().zip(self.albedo.iter().zip(&self.depth)).map(word).collect()
    }

    /// The buffer `pixel_of`, for maps of `maps` pixels.
    pub fn places(&self, maps: usize) -> Vec<u32> {
        let mut all = vec![u32::MAX; maps];
        for (pixel, c) in self.columns.iter().enumerate() {
            all[*c as usize] = pixel as u32;
        }
        all
    }
}
