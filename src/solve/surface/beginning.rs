//! What a surface begins with, and how it goes on from that of the frame before.

use std::time::Instant;

use crate::maps::Maps;
use crate::transport::kernels::{SURFACE_ALBEDO_RATE, SURFACE_DEPTH_RATE, SURFACE_WEIGHTS};

/// A surface that goes on from the frame before takes steps of albedo this many times as long: a pixel that the scene has
/// left must become dark within few iterations.
const LIVELY: f32 = 3.0;

/// Steps have their full length if the volume's albedos changed by at least this share. Below it they are shorter in
/// proportion, down to `CALMEST`: a surface that has found its place stays there.
const MOVED: f64 = 0.1;
const CALMEST: f64 = 0.1;

/// What a surface begins with.
pub enum Beginning<'m> {
    /// The volume that was solved on the device before.
    Volume,
    /// That volume, and the surface of the frame before.
    Frame(Continuation<'m>),
    /// The maps of a volume that is not on the device: its first surfaces are those of the solve, these are the second ones.
    Kept(&'m Maps),
    /// Maps of another method, on the surface's own pixels.
    Maps,
}

/// How a surface goes on from that of the frame before.
pub struct Continuation<'m> {
    /// Its maps, on the plan's own pixels.
    pub maps: &'m Maps,
    /// The maps of the volume that it began with.
    pub volume: &'m Maps,
    /// Stop at this time.
    pub until: Option<Instant>,
}

impl Continuation<'_> {
    /// Moves the maps of a new volume by what the surface before changed on its volume's, where that volume was within
    /// `near` metres of this one. What did not move begins where it ended, and what moved a little keeps the correction.
    pub fn begin(&self, layer: &mut Maps, near: f64) {
        let (surface, volume) = (self.maps, self.volume.finer(layer.nx / self.volume.nx));
        if surface.depth.len() != layer.depth.len() || volume.depth.len() != layer.depth.len() {
            return;
        }
        for i in 0..layer.depth.len() {
            // No number is near.
            if f64::from((layer.depth[i] - volume.depth[i]).abs()) < near && surface.depth[i].is_finite() {
                layer.depth[i] += surface.depth[i] - volume.depth[i];
                let brighter = surface.albedo[i] / volume.albedo[i];
                layer.albedo[i] *= if brighter.is_finite() { brighter.clamp(0.5, 2.0) } else { 1.0 };
            }
        }
    }

    /// Lengthens or shortens the first steps, for a surface after the volume `now`.
    pub fn pace(&self, now: &Maps, weights: &mut [f32; SURFACE_WEIGHTS as usize]) {
        let both = now.albedo.iter().zip(&self.volume.albedo);
        let changed: f64 = both.map(|(a, b)| f64::from((a - b).abs())).sum();
        let all: f64 = now.albedo.iter().map(|a| f64::from(*a)).sum();
        let calm = (changed / (MOVED * all)).clamp(CALMEST, 1.0) as f32;
        weights[SURFACE_ALBEDO_RATE as usize] *= LIVELY * calm;
        weights[SURFACE_DEPTH_RATE as usize] *= calm;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_did_not_move_begins_where_it_ended() {
        let maps = |albedo: [f32; 3], depth: [f32; 3]| Maps {
            albedo: albedo.into(),
            depth: depth.into(),
            normal: vec![[0.0; 3]; 3],
            mask: vec![true; 3],
            ..Maps::empty([3, 1], [0.0, 3.0, 0.0, 1.0])
        };
        let volume = maps([1.0, 1.0, 1.0], [0.5, 0.5, f32::NAN]);
        let surface = maps([1.5, 9.0, 1.0], [0.51, 0.52, 0.6]);
        let on = Continuation { maps: &surface, volume: &volume, until: None };
        // The second moved by a little, and got brighter by more than may be taken over; the third is new.
        let mut layer = maps([1.0, 1.0, 1.0], [0.5, 0.51, 0.7]);
        on.begin(&mut layer, 0.015);
        assert_eq!((layer.albedo, layer.depth), (vec![1.5, 2.0, 1.0], vec![0.51, 0.53, 0.7]));
        // The nearer the new volume is to the one before, the shorter the steps.
        let depth_rate = |albedo: f32| {
            let mut weights = [1.0; SURFACE_WEIGHTS as usize];
            on.pace(&maps([1.0, 1.0, albedo], [0.5; 3]), &mut weights);
            weights[SURFACE_DEPTH_RATE as usize]
        };
        assert_eq!([1.0, 2.0].map(depth_rate), [0.1, 1.0]);
        assert!((depth_rate(1.16) - 0.5).abs() < 0.05);
        let mut far = maps([1.0; 3], [0.6; 3]);
        on.begin(&mut far, 0.015);
        assert_eq!(far.depth, [0.6; 3]);
    }
}
