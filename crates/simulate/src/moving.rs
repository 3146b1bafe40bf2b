//! Sequences: the frames of a scene that rests, moves, or whose last object appears or vanishes.

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

/// How a scene changes from frame to frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Motion {
    /// Number of frames.
    pub frames: usize,
    /// Distance that the things move along a circle from one frame to the next, metres; the room rests.
    pub step: f64,
    /// Radius of the circle, metres; `None`: 0.12 of the wall's side.
    pub circle: Option<f64>,
    /// The last thing is absent from earlier frames than this one, from 0.
    pub appears: Option<usize>,
    /// The last thing is absent from this frame, from 0, and from later ones.
    pub vanishes: Option<usize>,
}

impl Scene {
    /// The scenes of a sequence. All have the same bins: enough for each of them.
    ///
    /// # Errors
    /// The step is no length, there are more than 10,000 frames, the last object is the only one and is absent, or
    /// [`Scene::check`] refuses a scene.
    pub fn sequence(&self, motion: &Motion) -> Result<Vec<Scene>> {
        let Motion { frames, step, circle, appears, vanishes } = *motion;
        if !(step.is_finite() && step >= 0.0) {
            return Err(Error::options(format!("{step} m from frame to frame"), "give a length in metres"));
        }
        if frames > MOST {
            return Err(Error::options(
                format!("{frames} frames of a moving scene"),
                format!("give at most {MOST}: the scene comes round again"),
            ));
        }
        let comes_or_goes = appears.is_some() || vanishes.is_some();
        if comes_or_goes && self.objects.len() < 2 {
            return Err(Error::options(
                format!("the only object of the scene {} is to appear or to vanish", self.name),
                "choose a scene of several objects: spheres, plates or letters:AB",
            ));
        }
        let things = self.things();
        if comes_or_goes && things == 0 {
            return Err(Error::options(
                format!("all of the scene {} is its room, which neither appears nor vanishes", self.name),
                "choose a scene with an object",
            ));
        }
        let radius = circle.unwrap_or(RADIUS * self.wall);
        if !(radius.is_finite() && radius > 0.0) {
            return Err(Error::options(
                format!("the radius of the circle is {radius} m"),
                "give a length above 0",
            ));
        }
        let at = |frame: usize| {
            let angle = (step / radius * frame as f64) % TAU;
            radius * dvec3(angle.cos(), angle.sin(), LEAN * angle.sin())
        };
        let mut all: Vec<Scene> = (0..frames).map(|frame| self.moved(at(frame))).collect();
        all.iter().try_for_each(Scene::check)?;
        let most = all.iter().map(Scene::bin_count).max();
        for (frame, scene) in all.iter_mut().enumerate() {
            scene.bins = most;
            // Noise differs from frame to frame.
            scene.seed = scene.seed.wrapping_add(frame as u64);
            if appears.is_some_and(|first| frame < first) || vanishes.is_some_and(|first| frame >= first) {
                scene.objects.remove(things - 1);
            }
        }
        Ok(all)
    }

    /// The scene with all things moved.
    fn moved(&self, by: DVec3) -> Scene {
        let (things, room) = self.objects.split_at(self.things());
        let moved = things.iter().map(|o| Object { mesh: o.mesh.clone().translated(by), ..o.clone() });
        Scene { objects: moved.chain(room.iter().cloned()).collect(), ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_move_by_their_step_and_the_last_one_comes_and_goes() {
        let scene = Scene { scan: 4, ..Scene::named("spheres").unwrap() };
        let motion = Motion { frames: 5, step: 0.02, circle: None, appears: Some(1), vanishes: Some(3) };
        let frames = scene.sequence(&motion).unwrap();
        let low = |s: &Scene| s.objects[0].mesh.bounds().unwrap().0;
        for two in frames.windows(2) {
            let way = low(&two[1]) - low(&two[0]);
            assert!((way.truncate().length() - 0.02).abs() < 1e-3, "{way}");
        }
        assert_eq!(frames.iter().map(|s| s.objects.len()).collect::<Vec<_>>(), [1, 2, 2, 1, 1]);
        assert!(frames.iter().all(|s| s.bins == frames[0].bins && s.bins.is_some()));
        assert_ne!(frames[0].seed, frames[1].seed);
        // A room rests, and the figure before it is what comes and goes.
        let room = Scene { scan: 4, ..Scene::named("beyond").unwrap() };
        let frames = room.sequence(&motion).unwrap();
        let last = |s: &Scene| s.objects.last().unwrap().mesh.bounds().unwrap();
        assert!(frames.iter().all(|s| last(s) == last(&room) && s.room == 2));
        assert!(low(&frames[0]) != low(&frames[1]) && frames[0].objects.len() + 1 == frames[1].objects.len());
        let one = Scene::named("sphere").unwrap();
        let wide = Motion { circle: Some(0.5), ..motion };
        let turned = scene.sequence(&wide).unwrap();
        assert!((low(&turned[0]) - low(&scene)).distance(dvec3(0.5, 0.0, 0.0)) < 1e-9);
        for wrong in [
            Motion { circle: Some(0.0), ..motion },
            Motion { step: f64::NAN, ..motion },
            Motion { frames: usize::MAX, ..motion },
        ] {
            assert!(scene.sequence(&wrong).is_err(), "{wrong:?}");
        }
        assert!(
            one.sequence(&motion).is_err()
                && one.sequence(&Motion { frames: 2, ..Motion::default() }).is_ok()
        );
    }
}
