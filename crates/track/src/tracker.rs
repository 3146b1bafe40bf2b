//! Positions over frames: a filter of constant velocity for each object (Kalman 1960), and which position is whose (Bar-Shalom 1988).

use glam::{DMat3, DVec3};

use crate::locate::Position;

/// A position belongs to a track if its squared distance, in covariances of both, is at most this: 99.9 % of three normal numbers.
const GATE: f64 = 16.3;
/// Frames without a position after which a track ends.
const MISSED: usize = 10;
/// Standard deviation of a coordinate of the speed of a new object, metres a second.
const SPEED: f64 = 2.0;

/// Follows objects from frame to frame.
#[derive(Debug, Clone)]
pub struct Tracker {
    /// Seconds from frame to frame.
    frame_time: f64,
    /// Standard deviation of a coordinate of the acceleration, metres per second squared.
    acceleration: f64,
    tracks: Vec<FilteredTrack>,
    begun: usize,
}

/// State and covariance of one object.
#[derive(Debug, Clone)]
struct FilteredTrack {
    number: usize,
    at: DVec3,
    velocity: DVec3,
    /// Covariance of position, of position with velocity, and of velocity.
    covariance: [DMat3; 3],
    missed: usize,
}

/// An object in a frame.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct TrackState {
    /// Number of the object, from 0.
    pub track: usize,
    /// The position of the frame that belongs to it; `None`: none does, the place is predicted.
    pub position: Option<usize>,
    /// Filtered position, metres.
    pub at: DVec3,
    /// Its covariance, squared metres, with what frames have in common.
    pub covariance: DMat3,
    /// Velocity, metres a second.
    pub velocity: DVec3,
}

impl Tracker {
    /// No object yet. `frame_time`: seconds from frame to frame. `acceleration`: standard deviation of a coordinate, metres per second
    /// squared.
    pub fn new(frame_time: f64, acceleration: f64) -> Tracker {
        Tracker { frame_time, acceleration, tracks: vec![], begun: 0 }
    }

    /// Takes the seconds from the last frame to the next.
    pub fn set_frame_time(&mut self, seconds: f64) {
        self.frame_time = seconds;
    }

    /// Where objects are expected in the next frame, metres.
    pub fn expected(&self) -> Vec<DVec3> {
        self.tracks.iter().map(|track| track.at + track.velocity * self.frame_time).collect()
    }

    /// Takes the positions of the next frame. Returns the objects, in the order in which they appeared.
    pub fn step(&mut self, positions: &[Position]) -> Vec<TrackState> {
        for track in &mut self.tracks {
            track.predict(self.frame_time, self.acceleration);
        }
        let mut distances: Vec<(f64, usize, usize)> = vec![];
        for (t, track) in self.tracks.iter().enumerate() {
            for (p, position) in positions.iter().enumerate() {
                let off = position.at - track.at;
                let sum = track.covariance[0] + position.covariance;
                distances.push((off.dot(sum.inverse() * off), t, p));
            }
        }
        distances.retain(|(distance, ..)| *distance <= GATE);
        distances.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut owner: Vec<Option<usize>> = vec![None; positions.len()];
        let mut own: Vec<Option<usize>> = vec![None; self.tracks.len()];
        for (_, t, p) in distances {
            if owner[p].is_none() && own[t].is_none() {
                (owner[p], own[t]) = (Some(t), Some(p));
            }
        }
        for (track, position) in self.tracks.iter_mut().zip(&own) {
            match position {
                Some(p) => track.update(&positions[*p]),
                None => track.missed += 1,
            }
        }
        for (p, position) in positions.iter().enumerate().filter(|(p, _)| owner[*p].is_none()) {
            self.tracks.push(FilteredTrack::begin(self.begun, position));
            own.push(Some(p));
            self.begun += 1;
        }
        let states = self.tracks.iter().zip(&own).map(|(track, position)| {
            // Shape and what a blob does not describe are the same from frame to frame: no filter removes them.
            let common = position.map(|p| positions[p].covariance - positions[p].counted);
            TrackState {
                track: track.number,
                position: *position,
                at: track.at,
                covariance: track.covariance[0] + common.unwrap_or(DMat3::ZERO),
                velocity: track.velocity,
            }
        });
        let states = states.collect();
        self.tracks.retain(|track| track.missed <= MISSED);
        states
    }
}

impl FilteredTrack {
    fn begin(number: usize, position: &Position) -> FilteredTrack {
        let velocity = DMat3::from_diagonal(DVec3::splat(SPEED * SPEED));
        let covariance = [position.covariance, DMat3::ZERO, velocity];
        FilteredTrack { number, at: position.at, velocity: DVec3::ZERO, covariance, missed: 0 }
    }

    fn predict(&mut self, time: f64, acceleration: f64) {
        let [place, both, velocity] = self.covariance;
        let noise = DMat3::IDENTITY * (acceleration * acceleration);
        self.at += self.velocity * time;
        self.covariance = [
            place
                + (both + both.transpose()) * time
                + velocity * (time * time)
                + noise * (time.powi(4) / 4.0),
            both + velocity * time + noise * (time.powi(3) / 2.0),
            velocity + noise * (time * time),
        ];
    }

    fn update(&mut self, position: &Position) {
        let [place, both, velocity] = self.covariance;
        let inverse = (place + position.covariance).inverse();
        let off = inverse * (position.at - self.at);
        self.at += place * off;
        self.velocity += both.transpose() * off;
        self.covariance = [
            place - place * inverse * place,
            both - place * inverse * both,
            velocity - both.transpose() * inverse * both,
        ];
        self.missed = 0;
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    fn seen(at: DVec3, deviation: f64) -> Position {
        let covariance = DMat3::from_diagonal(DVec3::splat(deviation * deviation));
        Position {
            at,
            covariance,
            counted: covariance,
            distance: [1.0, deviation],
            light: [1.0, 0.1],
            extent: [0.1, 0.1],
            share: 1.0,
            unmeasured: None,
        }
    }

    #[test]
    fn objects_that_cross_keep_their_numbers_and_errors_are_those_of_the_truth() {
        let mut random = Pcg64::seed_from_u64(7);
        let mut normal = move || {
            let all: f64 = (0..12).map(|_| random.random::<f64>()).sum();
            all - 6.0
        };
        let (step, deviation) = (0.1, 0.03);
        let truth = |object: usize, frame: usize| {
            let time = frame as f64 * step;
            match object {
                0 => DVec3::new(-0.5 + 0.2 * time, 0.1, 0.8),
                _ => DVec3::new(0.5 - 0.2 * time, -0.1, 0.9),
            }
        };
        let mut tracker = Tracker::new(step, 0.3);
        let (mut squares, mut count) = (0.0, 0.0);
        for frame in 0..50 {
            let mut noise = || DVec3::new(normal(), normal(), normal()) * deviation;
            let mut positions: Vec<Position> =
                (0..2).map(|object| seen(truth(object, frame) + noise(), deviation)).collect();
            // Association does not depend on the order, and rejects an outlier.
            positions.reverse();
            if frame == 20 {
                positions[0].at += DVec3::new(0.0, 0.0, 0.6);
            }
            let states = tracker.step(&positions);
            let ours = states.iter().filter(|state| state.track < 2);
            for state in ours.filter(|_| frame > 10) {
                let object = 1 - state.track;
                let off = state.at - truth(object, frame);
                squares += off.dot(state.covariance.inverse() * off);
                count += 3.0;
                assert!(off.length() < 5.0 * deviation, "{frame} {state:?}");
                let variance = state.covariance.col(0)[0];
                assert!(
                    (20..26).contains(&frame) || variance < 0.6 * deviation * deviation,
                    "{frame}: filtering helps"
                );
            }
            if frame == 20 {
                assert_eq!(
                    (states.len(), states[0].position),
                    (3, None),
                    "the outlier begins a track of its own"
                );
            }
            if frame > 40 {
                assert_eq!(states.len(), 2, "which ends");
            }
        }
        let mean = squares / count;
        assert!((0.5..1.4).contains(&mean), "{mean}");
    }
}
