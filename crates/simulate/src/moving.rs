//! Moving scenes: the same objects, frame by frame on a circle.

use std::f64::consts::TAU;

use glam::{DVec3, dvec3};

use super::{Object, Scene};
use crate::{Error, Result};

/// Radius of the circle, as a share of the wall's side, which keeps a letter in front of the wall.
const RADIUS: f64 = 0.12;

/// Depth amplitude of the circle, as a share of the radius.
const LEAN: f64 = 0.4;

/// Maximum number of frames; all scenes are in memory before rendering.
const MOST: usize = 10_000;

impl Scene {
    /// `frames` scenes in which all objects move on a circle by `step` metres per frame, with a common number of bins
    /// sufficient for all.
    ///
    /// # Errors
    /// A step that is not a length, more than 10,000 frames, or a scene refused by [`Scene::check`].
    pub fn moving(&self, frames: usize, step: f64) -> Result<Vec<Scene>> {
        if !(step.is_finite() && step >= 0.0) {
            return Err(Error::options(format!("{step} m from frame to frame"), "give a length in metres"));
        }
        if frames > MOST {
            return Err(Error::options(
                format!("{frames} frames of a moving scene"),
                format!("give at most {MOST}: the scene comes round again"),
            ));
        }
        let radius = RADIUS * self.wall;
        let at = |frame: usize| {
            let angle = (step / radius * frame as f64) % TAU;
            radius * dvec3(angle.cos(), angle.sin(), LEAN * angle.sin())
        };
        let mut all: Vec<Scene> = (0..frames).map(|frame| self.moved(at(frame))).collect();
        all.iter().try_for_each(Scene::check)?;
        let most = all.iter().map(Scene::bin_count).max();
        all.iter_mut().for_each(|scene| scene.bins = most);
        Ok(all)
    }

    /// The scene with all objects moved.
    fn moved(&self, by: DVec3) -> Scene {
        let object = |o: &Object| Object { mesh: o.mesh.clone().translated(by), ..o.clone() };
        Scene { objects: self.objects.iter().map(object).collect(), ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_letter_moves_by_its_step_and_keeps_its_bins() {
        let scene = Scene { scan: 4, ..Scene::named("letter:T").unwrap() };
        let frames = scene.moving(5, 0.02).unwrap();
        let low = |s: &Scene| s.objects[0].mesh.bounds().unwrap().0;
        for two in frames.windows(2) {
            let way = low(&two[1]) - low(&two[0]);
            assert!((way.truncate().length() - 0.02).abs() < 1e-3, "{way}");
        }
        assert!(frames.iter().all(|s| s.bins == frames[0].bins && s.bins.is_some()));
        assert!(scene.moving(2, f64::NAN).is_err() && scene.moving(usize::MAX, 0.02).is_err());
    }
}
