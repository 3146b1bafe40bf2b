//! The light of an empty room in captures of its scan.

use super::noise::variance_per_count;
use crate::capture::{Capture, RoomGain, RoomLight};

/// What serves all captures of the scan of one that holds counts of the empty room; `None` without these.
pub fn room_light(capture: &Capture) -> Option<RoomLight> {
    capture.empty.as_ref()?;
    capture.room_light(variance_per_count(&capture.emptied()))
}

/// The capture less the empty room that it holds, and the gain of that; `None` if no gain fits.
pub fn without_room(capture: &Capture, light: &RoomLight) -> Option<(RoomGain, Capture)> {
    let per_count = variance_per_count(capture);
    let gain = capture.room_gain(light, per_count)?;
    let left = capture.without_room(light, &gain, per_count);
    Some((gain, left))
}
