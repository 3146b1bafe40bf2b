//! Fits that judge laws with their numbers, and the one minimiser of numbers.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::correction::{Law, LawScan, Proposed};
use super::decide::{EvidenceGate, both};
use super::estimate;
use super::job::Job;
use super::trial::{FitBegin, Fitted, From, Trial, fit_all, for_fits};
use crate::Result;
use crate::capture::Pulse;
use crate::engine::{Doing, Progress, TracePoint, Watch};
use crate::gpu::Gpu;
use crate::surface::{Left, Starts};

/// A law that leaves this many times as much where it begins is not tried elsewhere: one laser in the middle of a confocal scan 3.7 to 8.6.
const HOPELESS: f64 = 2.0;
/// Fits of a search, as its progress expects them.
const USUAL: usize = 80;

/// A law with numbers for fits to begin with.
#[derive(Debug, Clone)]
pub struct Proposal {
    pub law: &'static Law,
    pub starts: Vec<Vec<f64>>,
    /// Whether it changes the picture by more than fits follow: the network looks at the capture without it first.
    pub is_far: bool,
}

/// A law with numbers that a fit judged.
#[derive(Clone)]
pub struct TriedLaw {
    pub law: &'static Law,
    pub numbers: Vec<f64>,
    /// Of the pairs that both hold out: what is left once it is undone, and as the capture is.
    pub left: [Left; 2],
    pub fitted: Fitted,
    /// What the fit began with.
    pub begun: FitBegin,
    /// Whether that is what the network sees once these numbers are undone.
    is_seen: bool,
}

impl TriedLaw {
    /// What is left once it is undone, over what is left as the capture is, of the same pairs.
    pub fn share_left(&self) -> f64 {
        self.left[0].excess() / self.left[1].excess().max(f64::MIN_POSITIVE)
    }

    fn is_of(&self, law: &Law, numbers: &[f64]) -> bool {
        self.law.name == law.name && self.numbers == numbers
    }

    /// By what is left.
    pub fn compared(&self, other: &TriedLaw) -> Ordering {
        self.share_left().total_cmp(&other.share_left())
    }

    pub fn passes(&self, gate: EvidenceGate) -> bool {
        let law = self.law;
        let is_far = law.least == 0.0 || self.numbers.iter().any(|n| n.abs() >= law.least);
        let is_inside = self.numbers.iter().zip(law.steps).all(|(n, [_, far])| n.abs() < 0.98 * far);
        // A number at its bound is no minimum.
        is_far
            && (is_inside || law.steps[0][0] == 0.0)
            && !(law.is_other)(&self.numbers)
            && gate.passes(&self.left)
    }
}

/// Fits that judge corrections of a capture.
pub struct Trials<'j> {
    pub job: &'j Job<'j>,
    pub trial: Trial<'j>,
    pulse: Option<Pulse>,
    pub scan: LawScan,
    /// The surface of the capture as it is.
    pub base: Fitted,
    pub gpu: &'j Gpu,
    pub hear: &'j mut dyn FnMut(&Progress) -> ControlFlow<()>,
    /// What fits begin with: brief ones until laws are fitted whole.
    pub from: From<'static>,
    /// All trials so far: a minimiser comes back to the same numbers.
    pub tried: Vec<TriedLaw>,
    /// Whether a step of a law that others resemble leaves less.
    pub is_scaled: bool,
    /// Fits so far.
    done: usize,
}

impl<'j> Trials<'j> {
    /// Trials by fits that begin so. `None` if no surface is found.
    pub fn new(
        job: &'j Job<'j>,
        starts: Arc<Starts>,
        from: From<'static>,
        gpu: &'j Gpu,
        hear: &'j mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Option<Trials<'j>>> {
        let (solver, pulse) = job.estimates.settle(&job.solver, &job.models)?;
        let pulse = pulse.or(job.capture.pulse.clone());
        let (mut whole, grid, options) =
            for_fits(&job.settings, job.solver.common().lateral, &job.capture, &solver)?;
        if pulse.is_some() {
            whole.to_mut().pulse.clone_from(&pulse);
        }
        let scan = LawScan::of(&whole);
        let begin = FitBegin { grid, starts, delays: vec![] };
        let trial = Trial::new(gpu, Arc::new(whole), options, begin, job.settings.memory);
        let mut quiet = |_: &Progress| ControlFlow::Continue(());
        let mut watch = Watch { hear: &mut quiet, maps_every: None, maps_at: &[] };
        let base = fit_all(&[&trial], pulse.as_ref(), from, 1.0, &mut watch)?.pop().flatten();
        Ok(base.map(|base| Trials {
            job,
            trial,
            pulse,
            scan,
            base,
            gpu,
            hear,
            from,
            tried: vec![],
            is_scaled: false,
            done: 0,
        }))
    }

    /// Fits of other versions of the capture.
    pub fn fits(&mut self, trials: &[Trial<'_>], from: From<'_>, step: f64) -> Result<Vec<Option<Fitted>>> {
        let Trials { hear, done, .. } = self;
        let iteration = *done;
        *done += trials.len();
        let mut reported = |progress: &Progress| {
            let point = TracePoint { iteration, ..progress.point };
            let progress = Progress {
                doing: Doing::Search,
                point,
                iterations: USUAL.max(iteration),
                remaining: None,
                maps: None,
            };
            hear(&progress)
        };
        let mut watch = Watch { hear: &mut reported, maps_every: None, maps_at: &[] };
        fit_all(&trials.iter().collect::<Vec<_>>(), self.pulse.as_ref(), from, step, &mut watch)
    }

    /// The job, and the device.
    pub fn of(&self) -> (&'j Job<'j>, &'j Gpu) {
        (self.job, self.gpu)
    }

    /// What a fit leaves once these numbers of a law are undone, which begins with the surface at hand, moved by its delays; `None` without a
    /// surface.
    pub fn judged(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<TriedLaw>> {
        if let Some(same) = self.tried.iter().find(|of| of.is_of(law, numbers)) {
            return Ok(Some(same.clone()));
        }
        let mut undone = self.trial.with_capture(law.undone(self.trial.capture(), &self.scan, numbers));
        let delays = law.effect_on_all(&self.scan, numbers).delays;
        let middle = |pair: usize| self.scan.laser[pair].midpoint(self.scan.sensor[pair]);
        undone.begin = self.trial.begin.moved(&delays, middle);
        let Some(fitted) = self.fits(&[undone], self.from, 1.0)?.pop().flatten() else { return Ok(None) };
        let gains = (law.proposed == Proposed::ByProducts).then(|| law.gains(&self.scan, numbers));
        let left = both(&fitted.held, &self.base.held, gains.as_deref());
        let begun = self.trial.begin.clone();
        let tried = TriedLaw { law, numbers: numbers.to_vec(), left, fitted, begun, is_seen: false };
        self.tried.push(tried.clone());
        Ok(Some(tried))
    }

    /// The start of a proposal that leaves least.
    pub fn begun(&mut self, Proposal { law, starts, is_far }: &Proposal) -> Result<Option<TriedLaw>> {
        let mut best: Option<TriedLaw> = None;
        for start in starts {
            let tried = if *is_far { self.looked_at(law, start)? } else { self.judged(law, start)? };
            best = best.into_iter().chain(tried).min_by(TriedLaw::compared);
            // Looks take most of the time of a fit.
            if *is_far && best.as_ref().is_none_or(|best| best.share_left() > HOPELESS) {
                break;
            }
        }
        Ok(best)
    }

    /// The same as [`Self::judged`] by a fit that begins with what the network sees once these numbers are undone.
    pub fn looked_at(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<TriedLaw>> {
        if let Some(same) = self.tried.iter().find(|of| of.is_seen && of.is_of(law, numbers)) {
            return Ok(Some(same.clone()));
        }
        let undone = self.job.with_capture(Cow::Owned(law.undone(&self.job.capture, &self.scan, numbers)));
        let delays = law.effect_on_all(&self.scan, numbers).delays;
        let begin = FitBegin { delays, ..estimate::begin_of(&undone, self.gpu, self.hear)? };
        self.tried.retain(|of| !of.is_of(law, numbers));
        let seen = self.beginning_with(begin, |trials| trials.judged(law, numbers))?;
        if let Some(last) = self.tried.last_mut().filter(|_| seen.is_some()) {
            last.is_seen = true;
        }
        Ok(seen)
    }

    /// What this does with fits that begin so.
    pub fn beginning_with<T>(&mut self, begin: FitBegin, does: impl FnOnce(&mut Self) -> T) -> T {
        let own = std::mem::replace(&mut self.trial.begin, begin);
        let done = does(self);
        self.trial.begin = own;
        done
    }
}

/// The least cost near a start, by at most this number of evaluations of a simplex (Nelder and Mead, 1965), and its numbers. `steps`: first
/// step of each number, 0: it stays; and how far it may be from 0. Ends where the corners differ by the share `alike` of the least cost.
pub fn minimised(
    cost: &mut dyn FnMut(&[f64]) -> Result<f64>,
    (least, start): (f64, Vec<f64>),
    steps: &[[f64; 2]],
    evaluations: usize,
    alike: f64,
) -> Result<(f64, Vec<f64>)> {
    let within = |mut numbers: Vec<f64>| {
        numbers.iter_mut().zip(steps).for_each(|(n, [_, far])| *n = n.clamp(-far, *far));
        numbers
    };
    let mut left = evaluations;
    let mut of = |numbers: Vec<f64>| {
        let numbers = within(numbers);
        left = left.saturating_sub(1);
        Ok::<_, crate::Error>((cost(&numbers)?, numbers, left))
    };
    let mut corners = vec![(least, start.clone())];
    let mut more = evaluations;
    for (at, [step, _]) in steps.iter().enumerate().filter(|(_, s)| s[0] > 0.0) {
        let mut numbers = start.clone();
        numbers[at] += step;
        let (value, numbers, left) = of(numbers)?;
        (more, _) = (left, corners.push((value, numbers)));
    }
    while more > 0 && corners.len() > 1 {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let worst = corners.len() - 1;
        if corners[worst].0 - corners[0].0 <= alike * corners[0].0.abs() {
            break;
        }
        let mean = |i: usize| corners[..worst].iter().map(|(_, n)| n[i]).sum::<f64>() / worst as f64;
        let middle: Vec<f64> = (0..start.len()).map(mean).collect();
        let last = corners[worst].1.clone();
        let at = |by: f64| middle.iter().zip(&last).map(|(m, n)| m + by * (n - m)).collect::<Vec<f64>>();
        let (value, numbers, left) = of(at(-1.0))?;
        more = left;
        let reflected = (value, numbers);
        let second = corners[worst.saturating_sub(1)].0;
        let next = if reflected.0 < corners[0].0 {
            let (value, numbers, left) = of(at(-2.0))?;
            more = left;
            if value < reflected.0 { (value, numbers) } else { reflected }
        } else if reflected.0 < second {
            reflected
        } else {
            let (value, numbers, left) = of(at(if reflected.0 < corners[worst].0 { -0.5 } else { 0.5 }))?;
            more = left;
            (value, numbers)
        };
        if next.0 < corners[worst].0 {
            corners[worst] = next;
            continue;
        }
        let best = corners[0].1.clone();
        for corner in &mut corners[1..] {
            let halved = corner.1.iter().zip(&best).map(|(n, b)| 0.5 * (n + b)).collect();
            let (value, numbers, left) = of(halved)?;
            (more, *corner) = (left, (value, numbers));
        }
    }
    Ok(corners.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("a start"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simplex_finds_the_least_within_its_bounds() {
        let mut count = 0;
        let mut cost = |n: &[f64]| {
            count += 1;
            Ok((n[0] - 0.3).powi(2) + 4.0 * (n[1] + 0.2 - 0.5 * n[0]).powi(2) + 1.0)
        };
        let begin = (cost(&[0.0, 0.0]).unwrap(), vec![0.0; 2]);
        let (least, found) = minimised(&mut cost, begin.clone(), &[[0.1, 1.0]; 2], 160, 1e-7).unwrap();
        assert!(
            least < 1.0 + 1e-4 && (found[0] - 0.3).abs() < 1e-2 && (found[1] + 0.05).abs() < 1e-2,
            "{found:?}"
        );
        let (_, found) = minimised(&mut cost, begin.clone(), &[[0.1, 0.2]; 2], 160, 1e-7).unwrap();
        assert!(found[0] <= 0.2, "{found:?}");
        count = 0;
        let mut cost = |n: &[f64]| {
            count += 1;
            Ok((n[0] - 0.3).powi(2) + 1.0)
        };
        let (_, found) = minimised(&mut cost, (1.09, vec![0.0]), &[[0.05, 1.0]], 12, 1e-4).unwrap();
        assert!((found[0] - 0.3).abs() < 0.05, "{found:?}");
        assert!(count <= 13, "{count}");
    }
}
