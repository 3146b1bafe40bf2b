//! The pixels that a surface has.

use crate::maps::Maps;

/// The albedo that counts as white in all layers.
pub fn white(layers: &[Maps]) -> f32 {
    layers.iter().map(|m| Maps::white(&m.albedo)).fold(0.0, f32::max)
}

/// Place of a lateral position along a Morton curve: the bits of both numbers in turns.
fn along_curve(x: u32, y: u32) -> u64 {
    // Moves the bits of each half of every word apart, then of each quarter.
    let apart = |v: u32| {
        [(16, 0x0000_ffff_0000_ffff), (8, 0x00ff_00ff_00ff_00ff), (4, 0x0f0f_0f0f_0f0f_0f0f)]
            .into_iter()
            .chain([(2, 0x3333_3333_3333_3333), (1, 0x5555_5555_5555_5555)])
            .fold(u64::from(v), |v, (by, mask): (u32, u64)| (v | v << by) & mask)
    };
    apart(x) << 1 | apart(y)
}

/// Pixels of a surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Pixels {
    /// Index of each among the maps' pixels, along a Morton curve: pixels that lie near each other in the list lie near
    /// each other in the maps, so their paths fall into the same bins (docs/devices.md). Indices of the second layer, and its
    /// pixels in the list, follow after all of the first.
    pub columns: Vec<u32>,
    /// Albedo of each.
    pub albedo: Vec<f32>,
    /// Depth of each, metres.
    pub depth: Vec<f32>,
}

impl Pixels {
    /// Those of the layers that have a depth and are lit, the brightest if there are more than `most`.
    pub fn of(layers: &[Maps], most: usize) -> Pixels {
        let albedo: Vec<f32> = layers.iter().flat_map(|m| &m.albedo).copied().collect();
        let depth: Vec<f32> = layers.iter().flat_map(|m| &m.depth).copied().collect();
        let is_lit = |c: &u32| albedo[*c as usize] > 0.0 && depth[*c as usize].is_finite();
        let mut columns: Vec<u32> = Vec::with_capacity(albedo.len());
        columns.extend((0..albedo.len() as u32).filter(is_lit));
        if columns.len() > most {
            columns.sort_by(|a, b| albedo[*b as usize].total_cmp(&albedo[*a as usize]));
            columns.truncate(most);
        }
        columns.sort_by_cached_key(|c| {
            let (nx, ny) = (layers[0].nx as u32, layers[0].ny as u32);
            let of_layer = c % (nx * ny);
            (c / (nx * ny), along_curve(of_layer / ny, of_layer % ny))
        });
        let of = |from: &[f32]| columns.iter().map(|c| from[*c as usize]).collect();
        Pixels { albedo: of(&albedo), depth: of(&depth), columns }
    }

    /// How many each layer has, for maps of `maps` pixels.
    pub fn of_layers(&self, maps: usize) -> [usize; 2] {
        let first = self.columns.partition_point(|c| (*c as usize) < maps);
        [first, self.len() - first]
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// The buffer `pixel_of`, for maps of `maps` pixels; without the second layer if that is empty.
    pub fn places(&self, maps: usize) -> Vec<u32> {
        let layers = if self.of_layers(maps)[1] == 0 { 1 } else { 2 };
        let mut all = vec![u32::MAX; layers * maps];
        for (pixel, c) in self.columns.iter().enumerate() {
            all[*c as usize] = pixel as u32;
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::along_curve;

    #[test]
    fn bits_of_both_numbers_take_turns() {
        assert_eq!(along_curve(0b101, 0b011), 0b10_01_11);
        assert_eq!(along_curve(u32::MAX, 0), 0xaaaa_aaaa_aaaa_aaaa);
        assert_eq!(along_curve(0, u32::MAX), 0x5555_5555_5555_5555);
    }
}
