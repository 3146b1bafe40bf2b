//! Steps between a capture as recorded and one that a solver takes, each capture → capture with a note.
//!
//! [`AS_RECORDED`] and [`FOR_A_SOLVE`] are the lists, in order. Steps that need no counts also run on the outline of a
//! capture whose counts are still in its file, so that only the pairs and bins that are kept have to be read.

pub(crate) mod background;
pub(crate) mod choose;
mod clipped;
pub(crate) mod empty;
mod faults;
pub(crate) mod frame;
pub mod gate;
mod hot;
mod keep;
#[cfg(feature = "formats")]
pub mod legs;
mod low_rank;
mod mean;
pub mod negative;
mod normals;
mod pile_up;
mod recorded;
mod shared;
mod sum;
mod turn;
mod units;
pub(crate) mod warnings;

pub use background::Background;
pub use empty::{RoomGain, RoomLight};
pub use gate::{AutoGate, Gate, auto_gate, light_gate, published_gate};
pub use keep::Keep;
pub use recorded::recorded_gate;
pub use turn::{Flip, Turn};

use crate::data::{Capture, Pulse};
use crate::error::{Error, Result};
use choose::PairOrder;
use mean::MeanOnce;

/// What the steps are to do; by default a gate is found automatically, and the rest is as the capture holds it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Conditioning {
    /// How to mirror and rotate the scan.
    pub turn: Turn,
    /// Distance of the outermost scan points along the longer side, metres: points are scaled to it.
    pub wall: Option<f64>,
    /// Metres that waves travel in a second, for captures whose bins are seconds.
    pub speed: Option<f64>,
    /// Pairs and bins to keep.
    pub keep: Keep,
    /// Keep pairs without any count, although their neighbours have many.
    pub keep_empty: bool,
    /// Do not look for a gate where [`Keep::gate`] is `None`: use every path.
    pub no_auto_gate: bool,
    /// Whether the counts were measured, so that bins without light of the scene are left out; `None`: as they look.
    pub is_captured: Option<bool>,
    /// Leave them out by the gate of the paper's code.
    pub has_published_gate: bool,
    /// The impulse response in place of the capture's; `Some(None)`: none.
    pub pulse: Option<Option<Pulse>>,
    /// Spots of laser and sensor in place of the capture's: full widths at half maximum, metres, 0 for points.
    pub spots: Option<[f64; 2]>,
}

/// A capture after some steps.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Conditioned {
    /// The capture.
    pub capture: Capture,
    /// The gate in force, given or found.
    pub gate: Option<Gate>,
    /// Pairs that were left out because they were not measured.
    pub dropped: usize,
    /// Whether wall normals were estimated from neighbouring points.
    pub normals_estimated: bool,
    /// What was done, one sentence per step that changed or assumed something.
    pub notes: Vec<String>,
    /// What looks wrong and was not corrected.
    pub warnings: Vec<String>,
    /// What is wrong for certain and cannot be undone; `warnings` holds it, too.
    pub faults: Vec<String>,
    /// The pair of the capture before these steps, for each pair.
    pub(crate) pairs: Vec<usize>,
    /// The first bin that is kept, of those before these steps.
    pub(crate) first_bin: usize,
    mean: MeanOnce,
}

impl Conditioned {
    /// A capture before any step.
    pub(crate) fn begin(capture: Capture, dropped: usize, notes: Vec<String>) -> Conditioned {
        Conditioned {
            pairs: (0..capture.pair_count()).collect(),
            first_bin: 0,
            mean: MeanOnce::default(),
            capture,
            gate: None,
            dropped,
            normals_estimated: false,
            notes,
            warnings: vec![],
            faults: vec![],
        }
    }

    fn take(&mut self, order: Option<PairOrder>) {
        if let Some(PairOrder { pairs, scan }) = order {
            self.capture = self.capture.keep(&pairs, scan);
            self.pairs = pairs.iter().map(|pair| self.pairs[*pair]).collect();
        }
    }

    /// With what is wrong for certain.
    pub(crate) fn with_faults(mut self, faults: Vec<String>) -> Conditioned {
        self.warnings.extend(faults.iter().cloned());
        self.faults.extend(faults);
        self
    }

    fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    /// Runs steps in order.
    ///
    /// # Errors
    /// The first error of a step.
    pub(crate) fn through(mut self, steps: &[ConditioningStep], how: &Conditioning) -> Result<Conditioned> {
        for step in steps {
            (step.run)(&mut self, how)?;
        }
        Ok(self)
    }
}

/// One step.
pub struct ConditioningStep {
    /// A short name.
    pub name: &'static str,
    /// Whether the step needs counts. Steps without counts come first.
    pub counts: bool,
    run: fn(&mut Conditioned, &Conditioning) -> Result<()>,
}

const fn step(
    name: &'static str,
    run: fn(&mut Conditioned, &Conditioning) -> Result<()>,
) -> ConditioningStep {
    ConditioningStep { name, counts: false, run }
}

const fn step_of_counts(
    name: &'static str,
    run: fn(&mut Conditioned, &Conditioning) -> Result<()>,
) -> ConditioningStep {
    ConditioningStep { name, counts: true, run }
}

/// The steps of a capture that is read or converted: counts and points stay as recorded.
pub const AS_RECORDED: &[ConditioningStep] = &[
    step("speed", timed),
    step("turn", turned),
    step("stride", thinned),
    step("subset", drawn),
    step("gate", gated),
    step_of_counts("negative counts", negative),
];

/// The steps of a capture that is reconstructed. Normals and the wall's size come before the stride, as they need all points;
/// pile-up comes before the gate, as it comes from all earlier counts; units come before automatic gates, which would hide them.
pub const FOR_A_SOLVE: &[ConditioningStep] = &[
    step("speed", timed),
    step("turn", turned),
    step("pile-up", without_pile_up),
    step("normals", with_normals),
    step("wall size", scaled),
    step("stride", thinned),
    step("subset", drawn),
    step("gate", gated),
    step_of_counts("faults", faults_found),
    step_of_counts("negative counts", negative),
    step_of_counts("units", units_checked),
    step_of_counts("automatic gate", automatically_gated),
    step_of_counts("impulse response", with_pulse),
    step_of_counts("spots", with_spots),
    step_of_counts("check", checked),
    step_of_counts("background", background_noted),
];

/// Makes a capture that is in memory ready for a solve: leaves out pairs that were not measured, checks the rest, and runs
/// [`FOR_A_SOLVE`].
///
/// # Errors
/// Those of [`Capture::check`]; `Kind::Options` for a wall size, stride, subset or gate that does not fit the capture.
pub fn prepare(capture: Capture, how: &Conditioning) -> Result<Conditioned> {
    measured(capture, how.keep_empty)?.through(FOR_A_SOLVE, how)
}

/// Refuses a capture whose times and lengths cannot belong together, with or without counts. Returns a warning where they are unlikely
/// to.
///
/// # Errors
/// `Kind::Input`, with the likely unit.
pub fn check_units(capture: &Capture) -> Result<Option<String>> {
    units::check(capture)
}

/// Leaves out pairs that were not measured, checks the rest, and rotates a wall that clearly does not face +z.
///
/// # Errors
/// Those of [`Capture::check`].
pub fn measured(capture: Capture, keep_empty: bool) -> Result<Conditioned> {
    let (capture, dropped, [mut notes, faults], seen) = capture.without_missing_seen(keep_empty)?;
    match seen {
        Some(seen) if capture.histograms.len() == seen.len() * capture.bins => {
            capture.check_scan().and_then(|()| capture.check_seen(seen.into_iter()))?
        }
        _ => capture.check()?,
    }
    let capture = frame::roughly_facing_z(capture, &mut notes);
    Ok(Conditioned::begin(capture, dropped, notes).with_faults(faults))
}

fn timed(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    let Some(speed) = how.speed else { return Ok(()) };
    if !(speed.is_finite() && speed > 0.0) {
        return Err(Error::options(
            format!("the speed is {speed} m/s"),
            "give a speed above 0, such as 343 for sound in air",
        ));
    }
    state.capture.bin_width *= speed;
    state.capture.t_start *= speed;
    state.note(format!("bins are read as seconds, in which waves travel {speed} m/s"));
    Ok(())
}

fn turned(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    state.notes.extend(how.turn.note());
    state.capture.turn_points(how.turn);
    let order = state.capture.turned_order(how.turn);
    state.take(order);
    Ok(())
}

fn without_pile_up(state: &mut Conditioned, _: &Conditioning) -> Result<()> {
    let note = state.capture.take_pile_up_out()?;
    state.notes.extend(note);
    Ok(())
}

/// Models of reflectance without a cosine need no normals; the others report the error.
fn with_normals(state: &mut Conditioned, _: &Conditioning) -> Result<()> {
    match state.capture.set_normals() {
        Ok(note) => {
            state.normals_estimated = note.is_some();
            state.notes.extend(note);
        }
        Err(e) => state.note(format!("wall normals are unknown: {}", e.what)),
    }
    Ok(())
}

fn scaled(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    if let Some(size) = how.wall {
        state.capture.set_wall(size)?;
        state.note(format!(
            "the wall is scaled so that its outermost scan points are {} m apart",
            (1e6 * size).round() / 1e6
        ));
    }
    Ok(())
}

fn thinned(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    let Some(n) = how.keep.stride.filter(|n| *n != 1) else { return Ok(()) };
    let before = state.capture.outline();
    let order = state.capture.stride_order(n)?;
    state.take(order);
    state.note(keep::stride_note(n, &before, &state.capture));
    Ok(())
}

fn drawn(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    let Some(n) = how.keep.subset else { return Ok(()) };
    let all = state.capture.pair_count();
    let order = state.capture.subset_order(n, how.keep.subset_seed)?;
    state.take(order);
    state.note(format!("{n} of {all} pairs, drawn at random, are used"));
    Ok(())
}

fn gated(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    if let Some(gate) = how.keep.gate {
        state.first_bin = state.capture.bins_of(gate)?.start;
        state.capture.set_gate(gate)?;
        state.gate = Some(gate);
    }
    Ok(())
}

fn faults_found(state: &mut Conditioned, _: &Conditioning) -> Result<()> {
    let room = state.capture.empty.is_some().then(|| state.capture.emptied());
    let faults::Found { notes, faults, warnings, dropped, has_moved } =
        faults::undo(&mut state.capture, &mut state.mean)?;
    // One instrument makes the same fault in both.
    if let Some(mut room) = room.filter(|_| has_moved) {
        let of_room = faults::undo(&mut room, &mut MeanOnce::default())?;
        let is_alike = room.bins == state.capture.bins && room.laser == state.capture.laser;
        if !(of_room.has_moved && is_alike) {
            return Err(Error::input(
                format!("the empty capture does not have the faults of the capture: {}", notes.join("; ")),
                "export both alike, or leave the empty capture out",
            ));
        }
        state.capture.empty = Some(room.histograms);
    }
    state.notes.extend(notes);
    state.warnings.extend(warnings.into_iter().chain(faults.iter().cloned()));
    state.faults.extend(faults);
    state.dropped += dropped;
    Ok(())
}

fn negative(state: &mut Conditioned, _: &Conditioning) -> Result<()> {
    state.notes.extend(state.capture.negative_note());
    Ok(())
}

/// The gate of the instrument first, as it fills what the others are found by; then direct light; then the end of the light.
fn automatically_gated(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    if state.gate.is_some() || how.no_auto_gate {
        return Ok(());
    }
    let is_captured = how.is_captured.unwrap_or_else(|| state.capture.is_measured());
    let recorded = recorded::gate(&mut state.capture, &mut state.mean).map(|(found, filled)| {
        if filled > 0 {
            state.notes.push(format!(
                "{filled} pairs were not recorded, or not as long as the others: the mean of their neighbours in the scan \
                 takes their place"
            ));
        }
        found
    });
    let mean = state.mean.of(&state.capture);
    let direct = gate::direct(&state.capture, mean);
    let after = direct.as_ref().map(|d| d.gate.from);
    let lit = match (is_captured, how.has_published_gate) {
        (false, _) => None,
        (true, false) => gate::lit(&state.capture, mean, after),
        (true, true) => Some(published_gate(&state.capture, after)),
    };
    // It may hold more than was recorded.
    let lit = lit.filter(|lit| recorded.as_ref().is_none_or(|r| !lit.gate.holds(r.gate)));
    for found in recorded.into_iter().chain(direct).chain(lit) {
        state
            .notes
            .push(format!("automatic gate: {} (turn the automatic gate off to use all)", found.reason));
        state.gate = Some(state.gate.map_or(found.gate, |before| before.within(found.gate)));
    }
    let Some(gate) = state.gate else { return Ok(()) };
    state.mean.keep(state.capture.bins_of(gate)?);
    state.capture.set_gate(gate)
}

fn with_pulse(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    if let Some(pulse) = &how.pulse {
        state.capture.set_pulse(pulse.clone())?;
    }
    Ok(())
}

fn with_spots(state: &mut Conditioned, how: &Conditioning) -> Result<()> {
    if let Some(spots) = how.spots {
        [state.capture.laser_spot, state.capture.sensor_spot] = spots.map(Some);
    }
    Ok(())
}

/// Refuses a capture whose times and lengths cannot belong together, and warns where they are unlikely to.
///
/// # Errors
/// `Kind::Input`, with the likely unit.
fn units_checked(state: &mut Conditioned, _: &Conditioning) -> Result<()> {
    state.warnings.extend(units::check(&state.capture)?);
    Ok(())
}

fn checked(state: &mut Conditioned, _: &Conditioning) -> Result<()> {
    state.capture.check()?;
    state.warnings.extend(state.capture.clipped_note());
    state.warnings.extend(state.capture.warnings());
    state.notes.extend(state.capture.offset_note());
    state.notes.extend(state.capture.normalised_note());
    state.notes.extend(state.capture.repeated_note());
    Ok(())
}

fn background_noted(state: &mut Conditioned, _: &Conditioning) -> Result<()> {
    let mean = state.mean.of(&state.capture);
    if let Some([low, high]) = state.capture.background_by(mean).range() {
        state.note(format!(
            "the background differs from pair to pair: {low:.2} to {high:.2} counts in a bin; all methods but paper take \
             off that of each pair"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_without_counts_come_first_and_both_lists_agree() {
        for steps in [AS_RECORDED, FOR_A_SOLVE] {
            assert!(steps.is_sorted_by_key(|step| step.counts));
        }
        let mut of_a_solve = FOR_A_SOLVE.iter();
        for step in AS_RECORDED {
            assert!(of_a_solve.any(|other| other.name == step.name), "{}", step.name);
        }
    }
}
