//! Causes: what an instrument does to all pairs at once, as laws of few numbers. Gains are found from what a surface shows of held-out
//! pairs; delays and places, which a surface hides, by fits with small changes and then larger ones along what leaves less. A cause is
//! right if a surface that is fitted without it explains more of the held-out pairs, beyond chance.

use std::borrow::Cow;
use std::ops::ControlFlow;

use glam::{DMat3, DVec3};

use super::calibration::Undone;
use super::device::is_clear;
use super::estimate;
use super::found::{Estimates, Shown};
use super::job::Job;
use super::laws::{Changes, LAWS, Law, LawScan, named};
use super::probe::Ask;
use super::suspects::{Suggested, Suggestion, Suspects, both, suited};
use crate::Result;
use crate::engine::Progress;
use crate::gpu::Gpu;
use crate::settings::DevicePosition;
use crate::surface::{HeldOut, Left};
use crate::transport::Reflectance;

/// Constants of the causes. Evidence: benches/NOTES.md, "Causes".
mod bands {
    /// Laws of delays and places that are searched along at most.
    pub const TRIED: usize = 2;
    /// Fits of a law at most.
    pub const ROUNDS: usize = 7;
    /// Passes over the numbers of a law at most.
    pub const PASSES: usize = 2;
    /// Factor of the steps of gains.
    pub const LONGER: f64 = 1.4;
    /// Fits end where the first one, or a later one, leaves less by a smaller factor.
    pub const FIRST: f64 = 0.95;
    pub const LESS: f64 = 0.99;
    /// What is tried near the best value leaves less than this many times as much; fits that differ by this factor are alike.
    pub const NEAR: f64 = 2.0;
    pub const ALIKE: f64 = 1.05;
    /// Factor by which, and standard errors beyond which, less is left: for other laws to be tried, and to be undone.
    pub const SUSPECT: [f64; 2] = [0.93, 2.0];
    pub const CLEAR: [f64; 2] = [0.6, 4.0];
    /// The same, for nothing else to be tried.
    pub const ALONE: [f64; 2] = [0.45, 4.0];
    /// The same of gains, whose pairs weigh unequally, with the pairs weighed midway between both counts.
    pub const CLEAR_GAINS: [f64; 2] = [0.7, 2.0];
    /// The same, for a cause to be named as a doubt: the pixels of the fits leave something of sharp captures whatever is undone.
    pub const DOUBT: [f64; 2] = [0.75, 4.0];
    /// Two causes are distinguished if one leaves this many times as much as the other: fits of one capture scatter by more than pairs do.
    pub const RIVAL: f64 = 1.3;
    /// Sides of a wall that are off by factors which differ by less are off by one.
    pub const ALIKE_SIDES: f64 = 0.05;
    /// Least share by which points are moved.
    pub const LEAST_SCALE: f64 = 0.02;
}

/// A cause that a fit judged.
#[derive(Clone)]
pub struct TriedCause {
    pub law: &'static Law,
    pub numbers: Vec<f64>,
    /// Of the pairs that both hold out: what is left without the cause, and as the capture is.
    pub left: [Left; 2],
}

/// Fits that judge causes of a capture.
struct CauseTrials<'j> {
    job: &'j Job<'j>,
    scan: LawScan,
    /// What fits take for the capture as it is.
    estimates: Cow<'j, Estimates>,
    /// The held-out pairs with a surface of the capture as it is.
    base: HeldOut,
    /// Whether fits have more pixels, as that of `base` has.
    is_fine: bool,
    gpu: &'j Gpu,
    hear: &'j mut dyn FnMut(&Progress) -> ControlFlow<()>,
    /// Values of a number that were tried, and what each left.
    tried: Vec<(f64, f64)>,
    /// All trials so far: searches come back to the same numbers.
    judged: Vec<TriedCause>,
}

impl CauseTrials<'_> {
    /// What a fit leaves once a cause is undone, and what it shows.
    fn trial(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<(TriedCause, Shown)>> {
        let CauseTrials { job, scan, estimates, base, is_fine, gpu, hear, .. } = self;
        let undone = law.undone(&job.capture, scan, numbers);
        let tried = job.with_capture(Cow::Borrowed(&undone));
        let ask = match law.kind {
            _ if *is_fine => Ask::Fine,
            Changes::Gain => Ask::Gains,
            _ => Ask::Nothing,
        };
        let Some(after) = estimate::shown(&tried, estimates, ask, gpu, *hear)? else { return Ok(None) };
        let judged = TriedCause { law, numbers: numbers.to_vec(), left: both(&after.held, base) };
        Ok(Some((judged, after)))
    }

    /// What a fit leaves once a cause is undone; the earlier result if these numbers were tried before.
    fn judged(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<TriedCause>> {
        if let Some(same) = self.judged.iter().find(|of| of.law.name == law.name && of.numbers == numbers) {
            return Ok(Some(same.clone()));
        }
        let judged = self.trial(law, numbers)?.map(|(judged, _)| judged);
        self.judged.extend(judged.clone());
        Ok(judged)
    }

    /// Gains that suit what a surface shows, refined by what fits without them show.
    fn gains(&mut self, mut suggestion: Suggestion) -> Result<Option<TriedCause>> {
        let mut best: Option<TriedCause> = None;
        for _ in 0..bands::ROUNDS {
            let Some((judged, shown)) = self.trial(suggestion.law, &suggestion.numbers)? else { break };
            let most = best.as_ref().map_or(bands::FIRST * self.before(), |best| bands::LESS * best.excess());
            if judged.excess() > most {
                break;
            }
            best = Some(judged);
            let Some(sense) = shown.sense else { break };
            let Some(next) = suited(&sense, &self.scan, suggestion.law, Some(&suggestion.numbers)) else {
                break;
            };
            // The surface hides a part of what is left, so that steps are too short.
            let steps = suggestion
                .numbers
                .iter()
                .zip(&next.numbers)
                .map(|(from, to)| from + bands::LONGER * (to - from));
            let within = |(n, [_, far]): (f64, &[f64; 2])| n.clamp(-far, *far);
            suggestion.numbers = steps.zip(suggestion.law.steps).map(within).collect();
        }
        Ok(best)
    }

    fn before(&self) -> f64 {
        self.base.left().excess()
    }

    /// Later fits have more pixels, by which the model and the high-pass are estimated again, if the capture as it is has a surface by these.
    fn refine(&mut self) -> Result<()> {
        let estimates = estimate::finely(self.job, self.gpu, self.hear)?;
        if let Some(shown) = &estimates.shown {
            (self.base, self.is_fine, self.judged) = (shown.held.clone(), true, vec![]);
            self.estimates = Cow::Owned(estimates);
        }
        Ok(())
    }

    /// Whether the opposite of a cause leaves less, too: then fits from anywhere else do, so that the surface was a poor one and the
    /// instrument is proper.
    fn leaves_less_both_ways(&mut self, best: &TriedCause) -> Result<bool> {
        if !best.law.has_opposite {
            return Ok(false);
        }
        let opposite: Vec<f64> = best.numbers.iter().map(|n| -n).collect();
        let trial = self.judged(best.law, &opposite)?;
        Ok(trial.is_some_and(|judged| judged.excess() < bands::FIRST * judged.left[1].excess()))
    }

    /// Searches along a number of a law, from `best`, for what leaves least.
    fn along(
        &mut self,
        law: &'static Law,
        number: usize,
        step: f64,
        best: Option<TriedCause>,
    ) -> Result<Option<TriedCause>> {
        let numbers = best.as_ref().map_or_else(|| vec![0.0; law.steps.len()], |best| best.numbers.clone());
        let mut best = best;
        let mut tried = vec![(numbers[number], best.as_ref().map_or(self.before(), TriedCause::excess))];
        let mut at = numbers[number] + step;
        for _ in 0..bands::ROUNDS {
            let far = law.steps[number][1];
            let mut there = numbers.clone();
            there[number] = at.clamp(-far, far);
            if tried.iter().any(|(t, _)| (t - there[number]).abs() < 0.2 * step.abs()) {
                break;
            }
            let Some(judged) = self.judged(law, &there)? else { break };
            tried.push((there[number], judged.excess()));
            if judged.excess() < best.as_ref().map_or(self.before(), TriedCause::excess) {
                best = Some(judged);
            }
            at = next_along(&mut tried, step);
        }
        self.tried.extend(tried);
        Ok(best)
    }

    /// A number at the vertex of the parabola through all that was tried near the best value: fits scatter.
    fn settled(
        &mut self,
        law: &'static Law,
        number: usize,
        best: Option<TriedCause>,
    ) -> Result<Option<TriedCause>> {
        let tried = std::mem::take(&mut self.tried);
        let Some(best) = best else { return Ok(None) };
        let Some(vertex) = vertex(&tried, best.numbers[number], best.excess()) else { return Ok(Some(best)) };
        let mut numbers = best.numbers.clone();
        numbers[number] = vertex;
        let Some(judged) = self.judged(law, &numbers)? else { return Ok(Some(best)) };
        Ok(Some(if judged.excess() < bands::ALIKE * best.excess() { judged } else { best }))
    }

    /// Whether the surface is a poor one: fits from anywhere else leave less, whatever is changed either way.
    fn is_poor_fit(&mut self) -> Result<bool> {
        let law = named("shear");
        for numbers in (law.starts)(&self.scan) {
            let trial = self.judged(law, &numbers)?;
            if !trial.is_some_and(|judged| judged.excess() < bands::FIRST * self.before()) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The scale, and where that leaves less, or these `found` do, the other laws of delays and places.
    fn places(
        &mut self,
        scale: Option<(&'static Law, f64)>,
        found: &[TriedCause],
    ) -> Result<Vec<TriedCause>> {
        let mut first = None;
        if let Some((law, step)) = scale {
            first = self.along(law, 0, step, None)?;
            first = self.settled(law, 0, first)?;
        }
        let is_wrong =
            |of: &TriedCause| of.is_less(bands::SUSPECT) && of.numbers[0].abs() >= bands::LEAST_SCALE;
        let mut all: Vec<TriedCause> = first.iter().cloned().collect();
        if found.is_empty() && !first.as_ref().is_some_and(is_wrong) {
            return Ok(all);
        }
        let scan = self.scan.clone();
        let is_tried =
            |law: &Law| law.name == "scale" || found.iter().any(|found| found.law.name == law.name);
        let is_other = |law: &&Law| !matches!(law.kind, Changes::Gain | Changes::Scene) && !is_tried(law);
        for law in LAWS.iter().filter(is_other).filter(|law| (law.applies)(&scan)) {
            let best = self.begun(law, (law.starts)(&scan))?;
            all.extend(best);
        }
        all.sort_by(|a, b| a.excess().total_cmp(&b.excess()));
        // Scale and time zero of a compact scene are alike: both stay rivals of whatever leaves less.
        let kept = all
            .into_iter()
            .enumerate()
            .filter(|(rank, of)| *rank < bands::TRIED || of.law.name == "time zero");
        let others: Vec<TriedCause> = kept.map(|(_, of)| of).filter(|of| of.law.name != "scale").collect();
        self.refine()?;
        let mut refined = vec![];
        for found in first.into_iter().chain(others) {
            refined.push(self.refined(found)?);
        }
        let least = refined.iter().map(TriedCause::excess).fold(f64::INFINITY, f64::min);
        for found in refined.iter_mut().filter(|found| found.excess() < bands::NEAR * least) {
            *found = self.with_other_models(found.clone())?;
        }
        // Both sides of the wall by one factor are the scale.
        refined.retain(|found| !found.is_scale());
        Ok(refined)
    }

    /// The numbers of a law near these that leave least, one after the other, and again while that leaves less.
    fn refined(&mut self, found: TriedCause) -> Result<TriedCause> {
        let law = found.law;
        let stepped = || (0..law.steps.len()).filter(|number| law.steps[*number][0] > 0.0);
        let mut best = self.judged(law, &found.numbers)?.unwrap_or(found);
        for _ in 0..bands::PASSES {
            let before = best.excess();
            for number in stepped() {
                let mut there = Some(best.clone());
                for side in [law.steps[number][0], -law.steps[number][0]] {
                    there = self.along(law, number, side, there)?;
                }
                best = self.settled(law, number, there)?.unwrap_or(best);
            }
            if stepped().count() < 3 || best.excess() > bands::FIRST * before {
                break;
            }
        }
        Ok(best)
    }

    /// A cause by the model of reflectance that leaves least with it: the fits without it may have chosen another one.
    fn with_other_models(&mut self, found: TriedCause) -> Result<TriedCause> {
        let mut best = found;
        let usual = self.estimates.clone();
        let models: Vec<Reflectance> =
            self.job.models.iter().map(|model| model.common().reflectance).collect();
        for reflectance in models {
            let Some(model) = self.estimates.to_mut().model.as_mut().filter(|m| m.reflectance != reflectance)
            else {
                continue;
            };
            model.reflectance = reflectance;
            self.judged.clear();
            let judged = self.judged(best.law, &best.numbers)?;
            if let Some(judged) = judged.filter(|judged| judged.excess() < bands::LESS * best.excess()) {
                best = self.refined(judged)?;
            }
        }
        self.judged.clear();
        self.estimates = usual;
        Ok(best)
    }

    /// Of these laws, each with numbers to begin with, what leaves less by its best numbers; alone what leaves so much less that nothing
    /// else is to be tried.
    fn suggested(&mut self, each: Vec<Suggested>) -> Result<Vec<TriedCause>> {
        let mut all = vec![];
        for Suggested { law, starts } in each {
            let Some(begin) = self.begun(law, starts)?.filter(|begin| begin.is_less(bands::SUSPECT)) else {
                continue;
            };
            if !self.leaves_less_both_ways(&begin)? {
                let found = self.refined(begin)?;
                if found.stands_alone() {
                    return Ok(vec![found]);
                }
                all.push(found);
            }
        }
        Ok(all)
    }

    /// What leaves least of these numbers of a law.
    fn begun(&mut self, law: &'static Law, starts: Vec<Vec<f64>>) -> Result<Option<TriedCause>> {
        let mut best: Option<TriedCause> = None;
        for start in starts {
            let Some(judged) = self.judged(law, &start)? else { continue };
            if judged.excess() < best.as_ref().map_or(self.before(), TriedCause::excess) {
                best = Some(judged);
            }
        }
        Ok(best)
    }
}

/// Where to try next: farther while less is left, then the vertex of the parabola through the least and its neighbours.
fn next_along(tried: &mut [(f64, f64)], step: f64) -> f64 {
    tried.sort_by(|a, b| (a.0 * step).total_cmp(&(b.0 * step)));
    let least = (0..tried.len()).min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1)).unwrap_or(0);
    match (least.checked_sub(1).map(|i| tried[i]), tried[least], tried.get(least + 1)) {
        (Some(before), here, None) => here.0 + 1.5 * (here.0 - before.0),
        // The search begins here: less lies on the other side, if at all.
        (None, here, _) => here.0,
        (Some(before), here, Some(after)) => {
            let [d, e] = [here.0 - before.0, after.0 - here.0];
            let [p, q] = [(here.1 - before.1) / d, (after.1 - here.1) / e];
            let vertex = 0.5 * (before.0 + here.0) - p * 0.5 * (d + e) / (q - p);
            if vertex.is_finite() { vertex } else { here.0 }
        }
    }
}

/// The vertex of the parabola through values and what each left, by least squares, of those that left little more than the best one.
/// `None` if these are too few, or have no least.
fn vertex(tried: &[(f64, f64)], best: f64, least: f64) -> Option<f64> {
    let near: Vec<[f64; 2]> =
        tried.iter().filter(|t| t.1 < bands::NEAR * least).map(|t| [t.0 - best, t.1 - least]).collect();
    let far = near.iter().fold(0.0f64, |far, [x, _]| far.max(x.abs()));
    if near.len() < 4 || far == 0.0 {
        return None;
    }
    // Normal equations of a + b x + c x^2.
    let sum = |power: i32, with: bool| -> f64 {
        near.iter().map(|[x, y]| (x / far).powi(power) * if with { *y } else { 1.0 }).sum()
    };
    let [s0, s1, s2, s3, s4] = [0, 1, 2, 3, 4].map(|power| sum(power, false));
    let matrix = DMat3::from_cols_array(&[s0, s1, s2, s1, s2, s3, s2, s3, s4]);
    if matrix.determinant().abs() < 1e-6 {
        return None;
    }
    let [_, b, c] =
        (matrix.inverse() * DVec3::from_array([0, 1, 2].map(|power| sum(power, true)))).to_array();
    let [low, high] = near.iter().fold([0.0f64; 2], |[low, high], [x, _]| [low.min(*x), high.max(*x)]);
    (c > 0.0).then(|| best + (-0.5 * far * b / c).clamp(low, high))
}

impl TriedCause {
    /// What is left without the cause.
    pub fn excess(&self) -> f64 {
        self.left[0].excess()
    }

    /// By how many standard errors less is left.
    fn errors(&self) -> f64 {
        self.left[0].errors_below(&self.left[1])
    }

    /// Whether both sides of the wall are off by one factor, as far as fits tell.
    fn is_scale(&self) -> bool {
        self.law.name == "sides" && (self.numbers[0] - self.numbers[1]).abs() < bands::ALIKE_SIDES
    }

    /// Whether nothing else is to be tried: the scale is like other laws.
    fn stands_alone(&self) -> bool {
        !self.is_scale() && self.is_less(bands::ALONE)
    }

    /// Whether points are moved by more than fits scatter by.
    fn is_far(&self) -> bool {
        self.law.kind != Changes::Place || self.numbers.iter().any(|n| n.abs() >= bands::LEAST_SCALE)
    }

    /// Whether it is named where nothing is undone. Gains are named by what suggests them.
    fn is_doubtful(&self) -> bool {
        self.law.kind != Changes::Gain && self.is_far() && self.is_less(bands::DOUBT)
    }

    /// Whether less is left by this factor, and by these standard errors.
    fn is_less(&self, [factor, errors]: [f64; 2]) -> bool {
        self.excess() < factor * self.left[1].excess() && self.errors() > errors
    }
}

/// What held-out pairs say of causes.
pub enum JudgedCauses {
    /// Causes between which they do not decide, of which the first one is undone.
    Confirmed(Box<Confirmed>),
    /// Sentences of what they suggest, and do not confirm; none if nothing is wrong.
    Doubts(Vec<String>),
}

/// The causes that held-out pairs confirm or suggest. `record`: metres of path by which a later record makes images sharper.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn judged(
    job: &Job<'_>,
    record: Option<f64>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<JudgedCauses> {
    let (capture, estimates) = (&*job.capture, &job.estimates);
    let Some(shown) = &estimates.shown else { return Ok(JudgedCauses::Doubts(vec![])) };
    let Suspects { gains, scale, place, moved } = shown.suspects.clone();
    let keeps_gains = job.settings.device_at == Some(DevicePosition::None);
    let mut trials = CauseTrials {
        job,
        scan: LawScan::of(capture),
        estimates: Cow::Borrowed(estimates),
        base: shown.held.clone(),
        is_fine: false,
        gpu,
        hear,
        tried: vec![],
        judged: vec![],
    };
    let mut all = vec![];
    let gains = gains.filter(|_| !keeps_gains);
    if let Some(suggestion) = &gains {
        all.extend(trials.gains(suggestion.clone())?);
    }
    let (mut scale, mut place) = (scale, place);
    if (scale.is_some() || place.is_some()) && trials.is_poor_fit()? {
        (scale, place) = (None, None);
    }
    let record = record.map(|later| Suggested { law: named("record"), starts: vec![vec![-later]] });
    let found = trials.suggested(record.into_iter().chain(place).chain(moved).collect())?;
    if !found.iter().any(TriedCause::stands_alone) && (scale.is_some() || !found.is_empty()) {
        all.extend(trials.places(scale, &found)?);
    }
    for found in found.into_iter().filter(|found| !found.is_scale()) {
        all.push(trials.judged(found.law, &found.numbers)?.unwrap_or(found));
    }
    let scan = trials.scan.clone();
    let is_confirmed = |judged: &TriedCause| {
        if judged.law.kind == Changes::Gain {
            let logs = judged.law.effect(&scan, &judged.numbers, &shown.held.pairs).logs;
            let gains: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
            return judged.is_less(bands::CLEAR_GAINS) && is_clear(&judged.left[0], &judged.left[1], &gains);
        }
        judged.is_far() && judged.is_less(bands::CLEAR)
    };
    all.sort_by(|a, b| a.excess().total_cmp(&b.excess()));
    let doubtful: Vec<TriedCause> = all.iter().filter(|judged| judged.is_doubtful()).cloned().collect();
    all.retain(is_confirmed);
    let first = all.first().or(doubtful.first()).cloned();
    let is_poor_fit = first.map_or(Ok(false), |best| trials.leaves_less_both_ways(&best))?;
    if is_poor_fit {
        all.clear();
    }
    let Some(best) = all.first() else {
        let least = doubtful.first().map_or(0.0, TriedCause::excess);
        let near = doubtful.iter().filter(|judged| !is_poor_fit && judged.excess() <= bands::RIVAL * least);
        let doubts = near.map(|judged| judged_doubt(judged, &scan));
        return Ok(JudgedCauses::Doubts(
            doubts.chain(gains.iter().map(|gains| suggested_doubt(gains, &scan))).collect(),
        ));
    };
    let least = best.excess();
    let undone = Undone {
        capture: best.law.undone(capture, &scan, &best.numbers),
        correction: best.law.correction(&best.numbers, scan.frame),
    };
    all.retain(|judged| judged.excess() <= bands::RIVAL * least);
    let cause = |(rank, judged): (usize, TriedCause)| {
        let [after, before] = judged.left.each_ref().map(Left::excess);
        let what = (judged.law.what)(&scan, &judged.numbers);
        Cause { what, hint: judged.law.hint.into(), left: [before, after], undone: rank == 0 }
    };
    let causes = all.into_iter().enumerate().map(cause).collect();
    Ok(JudgedCauses::Confirmed(Box::new(Confirmed { causes, undone })))
}

/// The law of gains that the surface suggests, as a sentence: what no fit confirms. Far pairs may have too few photons for a fit without
/// the law, and a surface that was fitted with it hides a part.
fn suggested_doubt(Suggestion { law, numbers, predicted }: &Suggestion, scan: &LawScan) -> String {
    format!(
        "perhaps {}: that would explain {:.0} % of what the surface leaves of held-out pairs beyond noise, but no fit without it confirms \
         it: {}",
        (law.what)(scan, numbers),
        100.0 * predicted[0],
        law.hint
    )
}

/// A law that leaves less, but not by enough to undo it, as a sentence.
fn judged_doubt(judged: &TriedCause, scan: &LawScan) -> String {
    let [after, before] = judged.left.each_ref().map(|left| 100.0 * left.excess());
    format!(
        "perhaps {} (of held-out pairs {before:.1} % is left beyond noise, {after:.1} % without it, which is too little a difference to undo \
         it): {}",
        (judged.law.what)(scan, &judged.numbers),
        judged.law.hint
    )
}

/// What is wrong with a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Cause {
    /// What it is.
    pub what: String,
    /// The option or edit that undoes it.
    pub hint: String,
    /// Shares of held-out pairs beyond noise, as the capture is and once the cause is undone.
    pub left: [f64; 2],
    /// Whether it is undone.
    pub undone: bool,
}

impl Cause {
    /// The cause as a sentence.
    pub fn sentence(&self) -> String {
        let [before, after] = self.left.map(|share| 100.0 * share);
        let done = if self.undone { "undone here; " } else { "" };
        format!(
            "{} (of held-out pairs {before:.0} % is left beyond noise, {after:.0} % once it is undone): {done}{}",
            self.what, self.hint
        )
    }
}

/// Causes between which held-out pairs do not decide.
pub struct Confirmed {
    /// The best one, which is undone, then the others.
    pub causes: Vec<Cause>,
    /// The capture without the best one.
    pub undone: Undone,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Capture;

    /// A law that was tried with this number, without which 64 pairs leave `after` of 100 each, give or take 1, and with it 10.
    fn tried(name: &str, number: f64, after: f64) -> TriedCause {
        let law = named(name);
        let left = |mean: f64, scatter: f64| Left {
            pairs: (0..64).map(|i| [mean + scatter * [1.0, -1.0][i % 2], 100.0]).collect(),
            noise: 0.0,
        };
        TriedCause { law, numbers: vec![number; law.steps.len()], left: [left(after, 1.0), left(10.0, 0.0)] }
    }

    #[test]
    fn what_leaves_clearly_less_is_a_doubt_and_what_leaves_much_less_a_cause() {
        let place = LAWS.iter().find(|law| law.kind == Changes::Place).expect("a law").name;
        let of = |after: f64| {
            let judged = tried("time zero", 0.1, after);
            (judged.is_doubtful(), judged.is_less(bands::CLEAR))
        };
        assert_eq!([8.0, 7.4, 5.9].map(of), [(false, false), (true, false), (true, true)]);
        assert!(tried(place, 0.05, 5.0).is_doubtful() && !tried(place, 0.01, 5.0).is_doubtful());
        assert!(!tried("walk", 0.1, 9.9).is_doubtful());
        let gain = LAWS.iter().find(|law| law.kind == Changes::Gain).expect("a law").name;
        assert!(!tried(gain, 0.1, 5.0).is_doubtful(), "gains are named by what suggests them");
    }

    #[test]
    fn doubts_name_the_law_its_numbers_and_what_mends_it() {
        let scan =
            LawScan::of(&Capture::new([1, 1], vec![DVec3::ZERO], vec![DVec3::ZERO], 2, 0.01, vec![1.0; 2]));
        let judged = tried("time zero", 0.1, 7.0);
        let doubt = judged_doubt(&judged, &scan);
        assert!(
            doubt.starts_with("perhaps all counts are 10.0 cm of path")
                && doubt.contains("10.0 % is left beyond noise, 7.0 % without it")
                && doubt.ends_with(judged.law.hint),
            "{doubt}"
        );
        let suggestion = Suggestion { law: judged.law, numbers: vec![0.1], predicted: [0.3, 5.0] };
        let doubt = suggested_doubt(&suggestion, &scan);
        assert!(doubt.starts_with("perhaps all counts") && doubt.contains("explain 30 %"), "{doubt}");
    }

    #[test]
    fn a_parabola_finds_the_least() {
        let tried = [0.0, 0.05, 0.1, 0.15].map(|x: f64| (x, 1.0 + 10.0 * (x - 0.08).powi(2)));
        assert!((vertex(&tried, 0.1, 1.004).unwrap() - 0.08).abs() < 1e-9);
        assert!(vertex(&tried[..3], 0.1, 1.004).is_none() && vertex(&[(0.0, 1.0); 5], 0.0, 1.0).is_none());
    }

    #[test]
    fn steps_grow_while_less_is_left() {
        let mut tried = vec![(0.0, 3.0), (-0.02, 2.0)];
        assert!((next_along(&mut tried, -0.02) + 0.05).abs() < 1e-12);
        tried.push((-0.05, 2.5));
        let next = next_along(&mut tried, -0.02);
        assert!((-0.05..-0.02).contains(&next), "{next}");
        // Nothing is better than the start.
        assert_eq!(next_along(&mut [(0.0, 1.0), (0.02, 2.0)], 0.02), 0.0);
    }
}
