//! The empty room: what a scan measures without the things.

use super::{Exposure, Scene};
use crate::capture::Capture;
use crate::{Error, Result};

/// Makes the photon noise of the empty room independent of the scene's.
const EMPTY: u64 = 0x0065_6d70_7479;

/// How the measurement of the empty room differs from that of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmptyRoom {
    /// Share of the photons, that is of the time.
    pub share: f64,
    /// How much stronger the laser is, as a share: 0.03 for 3 %.
    pub power: f64,
    /// Amplitude of a gain that changes smoothly over the wall.
    pub ripple: f64,
}

impl Default for EmptyRoom {
    fn default() -> EmptyRoom {
        EmptyRoom { share: 1.0, power: 0.0, ripple: 0.0 }
    }
}

impl EmptyRoom {
    /// Checks the ranges.
    ///
    /// # Errors
    /// A share that is not above 0 and up to 1000, a power or a ripple that is not within ±0.9.
    pub fn check(&self) -> Result<()> {
        if !(self.share > 0.0 && self.share <= 1e3) {
            return Err(Error::options(
                format!("the empty room is measured for {} times as long as the scene", self.share),
                "give a share of the photons above 0 and up to 1000",
            ));
        }
        if let Some(value) = [self.power, self.ripple].into_iter().find(|v| v.is_nan() || v.abs() > 0.9) {
            return Err(Error::options(
                format!("the light differs by {value} in the empty room"),
                "give shares from -0.9 to 0.9, such as 0.03",
            ));
        }
        Ok(())
    }

    /// What is measured of the light of a room, in an exposure of the scene's: with its own power, ripple and noise.
    #[must_use]
    pub fn measured(&self, mut room: Capture, exposure: Option<Exposure>, seed: u64) -> Capture {
        self.change(&mut room);
        match exposure {
            Some(exposure) => exposure.times(self.share).draw(&room, seed ^ EMPTY),
            None => room,
        }
    }

    fn change(&self, room: &mut Capture) {
        let half = room.sensor.iter().map(|p| p.truncate().abs().max_element()).fold(1e-9, f64::max);
        let bins = room.bins;
        for (pair, histogram) in room.histograms.chunks_exact_mut(bins).enumerate() {
            let at = room.sensor[pair] / half;
            let gain = (1.0 + self.power) * (1.0 + self.ripple * (1.6 * at.x - 0.9 * at.y).sin());
            histogram.iter_mut().for_each(|value| *value = (f64::from(*value) * gain) as f32);
        }
    }
}

impl Scene {
    /// Number of the things; the objects behind them are the room.
    pub(super) fn things(&self) -> usize {
        self.objects.len().saturating_sub(self.room)
    }

    /// The scene without its things: the last [`Scene::room`] objects.
    pub fn emptied(&self) -> Scene {
        Scene { objects: self.objects[self.things()..].to_vec(), ..self.clone() }
    }

    /// The things without their room.
    pub fn without_room(&self) -> Scene {
        Scene { objects: self.objects[..self.things()].to_vec(), room: 0, ..self.clone() }
    }
}
