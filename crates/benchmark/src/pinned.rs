//! A pinned solve: whether stored tables are of this build.

use std::hash::Hasher;

use serde::{Deserialize, Serialize};
use thirdbounce::{Error, Gpu, GpuOptions, Maps, Result, Settings, reconstruct};
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

/// Largest relative difference of a quantity where vectors differ, which round sums in another order.
const MOST: f64 = 1e-3;

/// What a solve with default options gives, repeatably.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pinned {
    /// Vectors of the host: with the same ones, the bits are the same.
    vectors: String,
    /// Hash of the maps.
    bits: String,
    /// Mean albedo, mean depth in metres and number of pixels of the mask.
    figures: [f64; 3],
}

impl Pinned {
    /// Solves 8 × 8 scan points of the figure on the host.
    ///
    /// # Errors
    /// Those of a reconstruction.
    pub fn solved() -> Result<Pinned> {
        let scene = Scene { scan: 8, bin_width: 0.02, ..Scene::named("figure")? };
        let capture = simulate(&scene, &RenderOptions { noise: 0.05, ..RenderOptions::default() })?.capture;
        let gpu = Gpu::open(&GpuOptions { device: Some("host".into()), ..GpuOptions::default() })?;
        let settings = Settings::from_texts([("deterministic", "true"), ("lateral", "64")])?;
        let maps = reconstruct(&gpu, &capture, &settings)?.maps;
        let masked = || (0..maps.mask.len()).filter(|p| maps.mask[*p]);
        let count = masked().count() as f64;
        let mean = |values: &[f32]| masked().map(|p| f64::from(values[p])).sum::<f64>() / count;
        // "AVX-512, 2 threads": their number does not change bits.
        let vectors = gpu.info.driver.split(',').next().unwrap_or_default().to_string();
        Ok(Pinned { vectors, bits: hash(&maps), figures: [mean(&maps.albedo), mean(&maps.depth), count] })
    }

    /// Checks that stored tables are of a build with the same results.
    ///
    /// # Errors
    /// Other results, with the command that renews the tables.
    pub fn check(&self, stored: &Pinned) -> Result<()> {
        let near = |(a, b): (&f64, &f64)| (a - b).abs() <= MOST * b.abs();
        let is_same = match self.vectors == stored.vectors {
            true => self.bits == stored.bits,
            false => self.figures.iter().zip(&stored.figures).all(near),
        };
        if is_same {
            return Ok(());
        }
        Err(Error::input(
            format!(
                "the stored tables are of another build: its pinned solve gave {stored:?}, this one {self:?}"
            ),
            "renew them: make bench-page",
        ))
    }
}

/// A hash of albedo, depth, normals and mask, the same on all machines.
fn hash(maps: &Maps) -> String {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    let values = maps.albedo.iter().chain(&maps.depth).chain(maps.normal.as_flattened());
    values.for_each(|value| hash.write(&value.to_bits().to_le_bytes()));
    maps.mask.iter().for_each(|inside| hash.write(&[u8::from(*inside)]));
    format!("{:016x}", hash.finish())
}

/// FNV-1a: the hash of the standard library may change with the compiler.
struct Fnv(u64);

impl Hasher for Fnv {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.0 = (self.0 ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3));
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_bits_are_seen_and_other_vectors_forgiven() {
        let stored = Pinned { vectors: "AVX2".into(), bits: "1".into(), figures: [0.5, 1.0, 300.0] };
        assert!(stored.check(&stored).is_ok());
        let other = Pinned { bits: "2".into(), ..stored.clone() };
        assert!(other.check(&stored).is_err());
        let elsewhere = Pinned { vectors: "AVX-512".into(), ..other };
        assert!(elsewhere.check(&stored).is_ok());
        let changed = Pinned { figures: [0.5, 1.002, 300.0], ..elsewhere };
        assert!(changed.check(&stored).is_err());
    }
}
