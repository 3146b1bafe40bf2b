//! Causes: what an instrument does to all pairs at once, as laws of few numbers. Gains are found from what a surface shows of held-out
//! pairs; delays and places, which a surface hides, by fits with small changes and then larger ones along what leaves less. A cause is
//! right if a surface that is fitted without it explains more of the held-out pairs, beyond chance.

mod laws;
mod probe;
mod sense;

use std::borrow::Cow;
use std::ops::ControlFlow;

use glam::{DMat3, DVec3};
use laws::{Kind, LAWS, Law, Setting};
pub(super) use probe::{Suspects, suspected};
pub(super) use sense::Sense;

use super::device::is_clear;
use super::estimate;
use super::found::{Estimates, Shown};
use super::job::Job;
use crate::Result;
use crate::capture::Capture;
use crate::engine::Progress;
use crate::gpu::Gpu;
use crate::settings::DevicePosition;
use crate::surface::{HeldOut, Left};

/// Constants of the causes. Evidence: benches/NOTES.md, "Causes".
mod bands {
    /// A law of gains is tried if its numbers are predicted to explain this share of what is left beyond noise, by these standard errors.
    pub const WORTH: f64 = 0.15;
    pub const BEYOND: f64 = 3.0;
    /// Laws of delays and places that are searched along at most.
    pub const TRIED: usize = 2;
    /// Fits of a law at most.
    pub const ROUNDS: usize = 7;
    /// Factor of the steps of gains.
    pub const LONGER: f64 = 1.4;
    /// Fits end where the first one, or a later one, leaves less by a smaller factor.
    pub const FIRST: f64 = 0.95;
    pub const LESS: f64 = 0.99;
    /// What is tried near the best value leaves less than this many times as much; fits that differ by this factor are alike.
    pub const NEAR: f64 = 2.0;
    pub const ALIKE: f64 = 1.05;
    /// Factor by which, and standard errors beyond which, less is left: for other laws to be tried, and to be undone.
    pub const SUSPECT: [f64; 2] = [0.9, 3.0];
    pub const CLEAR: [f64; 2] = [0.8, 4.0];
    /// The same of gains, whose pairs weigh unequally, with the pairs weighed both ways.
    pub const CLEAR_GAINS: [f64; 2] = [0.7, 2.0];
    /// Causes are told apart if one leaves this many times as much: fits of one capture scatter by more than pairs do.
    pub const RIVAL: f64 = 1.3;
    /// Least share by which points are moved.
    pub const LEAST_SCALE: f64 = 0.02;
}

/// A law with its numbers.
#[derive(Debug, Clone)]
pub struct Guess {
    pub law: &'static Law,
    pub numbers: Vec<f64>,
    /// Share of what is left that it is predicted to explain, and by how many standard errors.
    predicted: [f64; 2],
}

/// A cause that a fit judged.
#[derive(Clone)]
pub struct Judged {
    pub law: &'static Law,
    pub numbers: Vec<f64>,
    /// Of the pairs that both hold out: what is left without the cause, and as the capture is.
    pub left: [Left; 2],
}

/// Of a law of gains, the numbers that suit what a surface shows best, beyond `base`, which is undone in it.
fn suited(sense: &Sense, setting: &Setting, law: &'static Law, base: Option<&[f64]>) -> Option<Guess> {
    let logs = |numbers: &[f64]| law.effect(setting, numbers, &sense.pairs).logs;
    let undone = base.map_or_else(|| vec![0.0; sense.pairs.len()], logs);
    let beyond = |numbers: &[f64]| -> Vec<f64> {
        logs(numbers).iter().zip(&undone).map(|(log, undone)| log - undone).collect()
    };
    let cost = |numbers: &[f64]| sense.left(&beyond(numbers)).iter().sum::<f64>();
    let mut starts = (law.starts)(setting);
    if let Some(base) = base {
        // A number without a step stays what it is at a start.
        starts.iter_mut().for_each(|start| {
            let stepped = start.iter_mut().zip(law.steps).zip(base).filter(|((_, step), _)| step[0] > 0.0);
            stepped.for_each(|((n, _), base)| *n = *base);
        });
        starts.push(base.to_vec());
    }
    let begin = starts.into_iter().map(|start| (cost(&start), start)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (least, numbers) = descended(&cost, begin, law.steps);
    let (none, after) = (sense.left(&[]), sense.left(&beyond(&numbers)));
    let squares: f64 = none.iter().sum();
    let differences: Vec<f64> = none.iter().zip(after).map(|(before, after)| before - after).collect();
    let count = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / count;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let errors = mean / (variance / count).sqrt().max(f64::MIN_POSITIVE);
    Some(Guess { law, numbers, predicted: [(squares - least) / sense.beyond_noise(squares), errors] })
}

/// The least cost near a start, by a simplex of Nelder and Mead (1965), and its numbers.
fn descended(
    cost: &dyn Fn(&[f64]) -> f64,
    (least, start): (f64, Vec<f64>),
    steps: &[[f64; 2]],
) -> (f64, Vec<f64>) {
    const MOST: usize = 160;
    let within = |mut numbers: Vec<f64>| {
        numbers.iter_mut().zip(steps).for_each(|(n, [_, far])| *n = n.clamp(-far, *far));
        numbers
    };
    let mut all = vec![(least, start.clone())];
    for (at, [step, _]) in steps.iter().enumerate().filter(|(_, s)| s[0] > 0.0) {
        let mut numbers = start.clone();
        numbers[at] += step;
        let numbers = within(numbers);
        all.push((cost(&numbers), numbers));
    }
    for _ in 0..MOST {
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let worst = all.len() - 1;
        if all[worst].0 - all[0].0 <= 1e-7 * all[0].0.abs() {
            break;
        }
        let mean = |i: usize| all[..worst].iter().map(|(_, n)| n[i]).sum::<f64>() / worst as f64;
        let middle: Vec<f64> = (0..start.len()).map(mean).collect();
        let at = |by: f64| {
            let numbers = middle.iter().zip(&all[worst].1).map(|(m, n)| m + by * (n - m)).collect();
            let numbers = within(numbers);
            (cost(&numbers), numbers)
        };
        let reflected = at(-1.0);
        let next = if reflected.0 < all[0].0 {
            let farther = at(-2.0);
            if farther.0 < reflected.0 { farther } else { reflected }
        } else if reflected.0 < all[worst - 1].0 {
            reflected
        } else {
            at(if reflected.0 < all[worst].0 { -0.5 } else { 0.5 })
        };
        if next.0 < all[worst].0 {
            all[worst] = next;
            continue;
        }
        let best = all[0].1.clone();
        for (value, numbers) in &mut all[1..] {
            numbers.iter_mut().zip(&best).for_each(|(n, b)| *n = 0.5 * (*n + b));
            *value = cost(numbers);
        }
    }
    all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("a start")
}

/// What two fits leave of the pairs that both hold out.
pub fn both(one: &HeldOut, other: &HeldOut) -> [Left; 2] {
    let [a, b] = [one.left(), other.left()];
    if one.pairs == other.pairs {
        return [a, b];
    }
    let row = |pair: &usize| other.pairs.iter().position(|p| p == pair);
    let common: Vec<[usize; 2]> =
        one.pairs.iter().enumerate().filter_map(|(at, pair)| Some([at, row(pair)?])).collect();
    let of = |left: Left, side: usize| {
        let share = common.len() as f64 / left.pairs.len().max(1) as f64;
        Left { pairs: common.iter().map(|rows| left.pairs[rows[side]]).collect(), noise: share * left.noise }
    };
    [of(a, 0), of(b, 1)]
}

/// The law of gains that suits what a surface shows best, if that is worth a fit.
fn suggested(sense: &Sense, setting: &Setting) -> Option<Guess> {
    let each = LAWS.iter().filter(|law| law.kind == Kind::Gain && (law.applies)(setting));
    let guesses: Vec<Guess> = each.filter_map(|law| suited(sense, setting, law, None)).collect();
    let is_worth = |guess: &Guess| guess.predicted[0] > bands::WORTH && guess.predicted[1] > bands::BEYOND;
    guesses.into_iter().filter(is_worth).max_by(|a, b| a.predicted[0].total_cmp(&b.predicted[0]))
}

/// Fits that judge causes of a capture.
struct Judge<'j> {
    job: &'j Job<'j>,
    setting: Setting,
    estimates: &'j Estimates,
    shown: &'j Shown,
    gpu: &'j Gpu,
    hear: &'j mut dyn FnMut(&Progress) -> ControlFlow<()>,
    /// Values of a number that were tried, and what each left.
    tried: Vec<(f64, f64)>,
}

impl Judge<'_> {
    /// What a fit leaves once a cause is undone, and what it shows.
    fn trial(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<(Judged, Shown)>> {
        let Judge { job, setting, estimates, shown, gpu, hear, .. } = self;
        let undone = law.undone(&job.capture, setting, numbers);
        let tried = job.with_capture(Cow::Borrowed(&undone));
        let asks = law.kind == Kind::Gain;
        let Some(after) = estimate::shown(&tried, estimates, asks, gpu, *hear)? else { return Ok(None) };
        let judged = Judged { law, numbers: numbers.to_vec(), left: both(&after.held, &shown.held) };
        Ok(Some((judged, after)))
    }

    /// Gains that suit what a surface shows, refined by what fits without them show.
    fn gains(&mut self, mut guess: Guess) -> Result<Option<Judged>> {
        let mut best: Option<Judged> = None;
        for _ in 0..bands::ROUNDS {
            let Some((judged, shown)) = self.trial(guess.law, &guess.numbers)? else { break };
            let most = best.as_ref().map_or(bands::FIRST * self.before(), |best| bands::LESS * best.excess());
            if judged.excess() > most {
                break;
            }
            best = Some(judged);
            let Some(sense) = shown.sense else { break };
            let Some(next) = suited(&sense, &self.setting, guess.law, Some(&guess.numbers)) else { break };
            // The surface hides a part of what is left, so that steps are too short.
            let steps =
                guess.numbers.iter().zip(&next.numbers).map(|(from, to)| from + bands::LONGER * (to - from));
            let within = |(n, [_, far]): (f64, &[f64; 2])| n.clamp(-far, *far);
            guess.numbers = steps.zip(guess.law.steps).map(within).collect();
        }
        Ok(best)
    }

    fn before(&self) -> f64 {
        self.shown.held.left().excess()
    }

    /// Searches along a number of a law, from `best`, for what leaves least.
    fn along(
        &mut self,
        law: &'static Law,
        number: usize,
        step: f64,
        best: Option<Judged>,
    ) -> Result<Option<Judged>> {
        let numbers = best.as_ref().map_or_else(|| vec![0.0; law.steps.len()], |best| best.numbers.clone());
        let mut best = best;
        let mut tried = vec![(numbers[number], best.as_ref().map_or(self.before(), Judged::excess))];
        let mut at = numbers[number] + step;
        for _ in 0..bands::ROUNDS {
            let far = law.steps[number][1];
            let mut there = numbers.clone();
            there[number] = at.clamp(-far, far);
            if tried.iter().any(|(t, _)| (t - there[number]).abs() < 0.2 * step.abs()) {
                break;
            }
            let Some((judged, _)) = self.trial(law, &there)? else { break };
            tried.push((there[number], judged.excess()));
            if judged.excess() < best.as_ref().map_or(self.before(), Judged::excess) {
                best = Some(judged);
            }
            at = next_along(&mut tried, step);
        }
        self.tried.extend(tried);
        Ok(best)
    }

    /// A number at the vertex of the parabola through all that was tried near the best value: fits scatter.
    fn settled(&mut self, law: &'static Law, number: usize, best: Option<Judged>) -> Result<Option<Judged>> {
        let tried = std::mem::take(&mut self.tried);
        let Some(best) = best else { return Ok(None) };
        let Some(vertex) = vertex(&tried, best.numbers[number], best.excess()) else { return Ok(Some(best)) };
        let mut numbers = best.numbers.clone();
        numbers[number] = vertex;
        let Some((judged, _)) = self.trial(law, &numbers)? else { return Ok(Some(best)) };
        Ok(Some(if judged.excess() < bands::ALIKE * best.excess() { judged } else { best }))
    }

    /// The scale, and where that leaves less, the other laws of delays and places.
    fn places(&mut self, scale: &'static Law, step: f64) -> Result<Vec<Judged>> {
        let first = self.along(scale, 0, step, None)?;
        let Some(first) = self.settled(scale, 0, first)? else { return Ok(vec![]) };
        let is_suspect = first.is_less(bands::SUSPECT) && first.numbers[0].abs() >= bands::LEAST_SCALE;
        let mut all = vec![first.clone()];
        if !is_suspect {
            return Ok(all);
        }
        let setting = self.setting.clone();
        let others = LAWS.iter().filter(|law| law.kind != Kind::Gain && law.name != scale.name);
        for law in others.filter(|law| (law.applies)(&setting)) {
            let mut best: Option<Judged> = None;
            for start in (law.starts)(&setting) {
                let Some((judged, _)) = self.trial(law, &start)? else { continue };
                if judged.excess() < best.as_ref().map_or(self.before(), Judged::excess) {
                    best = Some(judged);
                }
            }
            all.extend(best);
        }
        all.sort_by(|a, b| a.excess().total_cmp(&b.excess()));
        all.truncate(bands::TRIED);
        // The scale stays a rival of whatever leaves less.
        all.retain(|found| found.law.name != scale.name);
        let mut refined = vec![first];
        for found in all {
            let mut best = Some(found.clone());
            for (number, [step, _]) in found.law.steps.iter().enumerate() {
                for side in [*step, -step] {
                    best = self.along(found.law, number, side, best)?;
                }
                best = self.settled(found.law, number, best)?;
            }
            refined.extend(best);
        }
        Ok(refined)
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

impl Judged {
    /// What is left without the cause.
    pub fn excess(&self) -> f64 {
        self.left[0].excess()
    }

    /// By how many standard errors less is left.
    fn errors(&self) -> f64 {
        self.left[0].errors_below(&self.left[1])
    }

    /// Whether less is left by this factor, and by these standard errors.
    fn is_less(&self, [factor, errors]: [f64; 2]) -> bool {
        self.excess() < factor * self.left[1].excess() && self.errors() > errors
    }
}

/// The cause that held-out pairs confirm, and those that leave about as little.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn confirmed(
    job: &Job<'_>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Vec<Confirmed>> {
    let (capture, estimates) = (&*job.capture, &job.estimates);
    let Some(shown) = &estimates.shown else { return Ok(vec![]) };
    let Suspects { gains, scale } = shown.suspects.clone();
    let keeps_gains = job.settings.device_at == Some(DevicePosition::None);
    let mut judge = Judge { job, setting: Setting::of(capture), estimates, shown, gpu, hear, tried: vec![] };
    let mut all = vec![];
    if let Some(guess) = gains.filter(|_| !keeps_gains) {
        all.extend(judge.gains(guess)?);
    }
    if let Some((law, step)) = scale {
        all.extend(judge.places(law, step)?);
    }
    let setting = judge.setting.clone();
    let is_confirmed = |judged: &Judged| {
        if judged.law.kind == Kind::Gain {
            let logs = judged.law.effect(&setting, &judged.numbers, &shown.held.pairs).logs;
            let gains: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
            return judged.is_less(bands::CLEAR_GAINS) && is_clear(&judged.left[0], &judged.left[1], &gains);
        }
        let is_far = judged.law.kind != Kind::Place || judged.numbers[0].abs() >= bands::LEAST_SCALE;
        is_far && judged.is_less(bands::CLEAR)
    };
    all.retain(is_confirmed);
    all.sort_by(|a, b| a.excess().total_cmp(&b.excess()));
    // Where the opposite leaves less, too, fits from anywhere else do: the surface was a poor one, the instrument is proper.
    if let Some(best) = all.first().filter(|best| best.law.kind != Kind::Gain) {
        let opposite: Vec<f64> = best.numbers.iter().map(|n| -n).collect();
        let trial = judge.trial(best.law, &opposite)?;
        if trial.is_some_and(|(judged, _)| judged.excess() < bands::FIRST * judged.left[1].excess()) {
            all.clear();
        }
    }
    let is_alone = all.get(1).is_none_or(|next| next.excess() > bands::RIVAL * all[0].excess());
    let confirmed = |judged: Judged| Confirmed {
        what: (judged.law.what)(&setting, &judged.numbers),
        hint: judged.law.hint,
        undone: is_alone.then(|| judged.law.undone(capture, &setting, &judged.numbers)),
        left: judged.left.each_ref().map(Left::excess),
    };
    let least = all.first().map_or(0.0, Judged::excess);
    all.retain(|judged| judged.excess() <= bands::RIVAL * least);
    Ok(all.into_iter().map(confirmed).collect())
}

/// A cause that held-out pairs confirm.
pub struct Confirmed {
    pub what: String,
    pub hint: &'static str,
    /// The capture without it, if no other cause leaves about as little.
    pub undone: Option<Capture>,
    /// What is left without the cause, and as the capture is.
    pub left: [f64; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simplex_and_a_parabola_find_the_least() {
        let cost = |n: &[f64]| (n[0] - 0.3).powi(2) + 4.0 * (n[1] + 0.2 - 0.5 * n[0]).powi(2) + 1.0;
        let (least, found) = descended(&cost, (cost(&[0.0, 0.0]), vec![0.0; 2]), &[[0.1, 1.0]; 2]);
        assert!(
            least < 1.0 + 1e-4 && (found[0] - 0.3).abs() < 1e-2 && (found[1] + 0.05).abs() < 1e-2,
            "{found:?}"
        );
        // Not beyond its reach.
        let (_, found) = descended(&cost, (cost(&[0.0, 0.0]), vec![0.0; 2]), &[[0.1, 0.2]; 2]);
        assert!(found[0] <= 0.2, "{found:?}");
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
        assert_eq!(next_along(&mut vec![(0.0, 1.0), (0.02, 2.0)], 0.02), 0.0);
    }
}
