//! The search for a correction: proposals from the surface at hand, brief fits for the numbers of every law, whole ones for those that pass,
//! and numbers that are refined by the estimates of the capture without it.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::Instant;

use glam::{DMat3, DVec3};
use thirdbounce_base::minimise::simplex;

use super::correction::{LAWS, Law, LawScan, Proposed};
use super::decide::{CaptureFinding, EvidenceGate, FindingSource};
use super::estimates::Estimates;
use super::job::Job;
use super::physics::estimate;
use super::trial::{From, Proposal, Trials, TriedLaw};
use super::{gains, propose};
use crate::Result;
use crate::engine::{Doing, OnProgress, Progress};
use crate::gpu::Gpu;

/// Constants of the search. Evidence: benches/NOTES.md, "Causes" and "Search".
mod bounds {
    /// Corrections of one capture at most.
    pub const CORRECTIONS: usize = 2;
    /// Share that is certainly left of held-out pairs, with the estimated impulse response, from which anything is tried: proper captures
    /// of simulated light leave less.
    pub const SUSPICIOUS: f64 = 0.03;
    /// Corrections that are refined.
    pub const FINALISTS: usize = 2;
    /// Fits of a law at most, with one number and for each further one.
    pub const FITS: [usize; 2] = [7, 4];
    /// Steps of whole fits over those of brief ones.
    pub const REFINED: f64 = 0.75;
    /// Fits of a simplex end where its corners differ by this share: fits of one capture scatter by as much.
    pub const ALIKE: f64 = 0.03;
    /// Moves of the parabola's middle at most.
    pub const MOVES: usize = 3;
    /// Rivals leave at most this many times as much as the best one: fits of one capture scatter by more than pairs do.
    pub const RIVAL: f64 = 1.5;
    /// Closed-form steps of gains and of delays of lines: a surface that was fitted with a fault hides a part of it, so that each must leave
    /// less by this factor.
    pub const ROUNDS: usize = 4;
    pub const LESS: f64 = 0.97;
    /// If the opposite leaves less by this factor, fits from anywhere else do: the surface was a poor one, and the instrument is proper.
    pub const OPPOSITE: f64 = 0.95;
}

impl<'j> Trials<'j> {
    /// The numbers of a law that leave least, by brief fits that begin with what the proposal's do.
    fn minimised(&mut self, proposal: &Proposal) -> Result<Option<TriedLaw>> {
        let law = proposal.law;
        if law.is_closed_form() {
            return self.stepped(law, &proposal.starts[0]);
        }
        let begin = self.begun(proposal)?.filter(|begin| begin.share_left() < 1.0);
        let Some(begin) = begin else { return Ok(None) };
        let [first, each] = bounds::FITS;
        let fits = first + each * (law.steps.len() - 1);
        let steps = law.steps_at(&begin.numbers, 1.0);
        let least = (begin.share_left(), begin.numbers.clone());
        self.beginning_with(begin.begun, |trials| {
            let mut cost =
                |n: &[f64]| Ok(trials.judged(law, n)?.map_or(f64::INFINITY, |tried| tried.share_left()));
            let (_, numbers) = simplex(&mut cost, least, &steps, fits, bounds::ALIKE)?;
            trials.judged(law, &numbers)
        })
    }

    /// What a whole fit leaves without a law that brief fits found.
    fn whole(&mut self, TriedLaw { law, numbers, .. }: &TriedLaw) -> Result<Option<TriedLaw>> {
        match law.is_closed_form() {
            true => self.stepped(law, numbers),
            false => self.looked_at(law, numbers),
        }
    }

    /// Numbers of a law refined by whole fits, each of which begins with what the network sees once its numbers are undone: fits that begin
    /// with another picture prefer the numbers of that.
    fn refined(&mut self, TriedLaw { law, numbers, .. }: &TriedLaw) -> Result<Option<TriedLaw>> {
        let steps = law.steps_at(numbers, bounds::REFINED);
        let mut cost =
            |n: &[f64]| Ok(self.looked_at(law, n)?.map_or(f64::INFINITY, |tried| tried.share_left()));
        let least = cost(numbers)?;
        let numbers = match steps[..] {
            [[step, far]] => {
                vertex(&mut |n| cost(&[n]), numbers[0], least, step)?.map(|n| vec![n.clamp(-far, far)])
            }
            _ => {
                let fits = bounds::FITS[1] * law.steps.len();
                Some(simplex(&mut cost, (least, numbers.clone()), &steps, fits, bounds::ALIKE)?.1)
            }
        };
        numbers.map_or(Ok(None), |numbers| self.looked_at(law, &numbers))
    }

    /// The same by closed-form steps from what is left once earlier ones are undone.
    fn stepped(&mut self, law: &'static Law, start: &[f64]) -> Result<Option<TriedLaw>> {
        let (mut best, mut next): (Option<TriedLaw>, _) = (None, Some(start.to_vec()));
        for _ in 0..bounds::ROUNDS {
            let Some(tried) = next.map_or(Ok(None), |numbers| self.judged(law, &numbers))? else { break };
            if tried.share_left() > bounds::LESS * best.as_ref().map_or(1.0, TriedLaw::share_left) {
                break;
            }
            let undone =
                self.trial.with_capture(law.undone(self.trial.capture(), &self.scan, &tried.numbers));
            next = match law.proposed {
                Proposed::ByCorrelation => propose::delays(&undone, &tried, self.scan.scan)?,
                _ => gains::next(&undone, &tried, &self.scan)?,
            };
            best = Some(tried);
        }
        Ok(best)
    }

    /// From here on fits are whole, that of the capture as it is, too. Whether that has a surface.
    fn fit_whole(&mut self) -> Result<bool> {
        (self.from, self.tried) = (From::Start, vec![]);
        let trial = self.trial.clone();
        let base = self.fits(std::slice::from_ref(&trial), From::Start, 1.0)?.pop().flatten();
        let is_found = base.is_some();
        self.base = base.unwrap_or_else(|| self.base.clone());
        Ok(is_found)
    }

    /// Whether the opposite leaves less, too.
    fn leaves_less_both_ways(&mut self, best: &TriedLaw) -> Result<bool> {
        let opposite: Vec<f64> = best.numbers.iter().map(|n| -n).collect();
        let tried = if best.law.has_opposite { self.judged(best.law, &opposite)? } else { None };
        Ok(tried.is_some_and(|tried| tried.share_left() < bounds::OPPOSITE))
    }
}

/// A law that was found, refined with what is estimated of the capture without it: estimates of the wrong capture prefer wrong numbers.
fn refined_by(
    job: &Job<'_>,
    estimates: &Estimates,
    found: &TriedLaw,
    gpu: &Gpu,
    hear: &mut OnProgress<'_>,
) -> Result<Option<TriedLaw>> {
    let Some((_, starts)) = job.estimates.at_hand.as_ref().filter(|_| !found.law.is_closed_form()) else {
        return Ok(None);
    };
    let of = Job { estimates: estimates.clone(), ..job.with_capture(Cow::Borrowed(&job.capture)) };
    let trials = Trials::new(&of, starts.clone(), From::Start, gpu, hear)?;
    let better = trials.map_or(Ok(None), |mut trials| trials.refined(found))?;
    Ok(better.filter(|better| better.share_left() < found.share_left()))
}

/// The least cost near a number of this cost: the vertex of the parabola through the costs of five numbers, which scatter. `None` without
/// a least one between them.
fn vertex(
    cost: &mut dyn FnMut(f64) -> Result<f64>,
    start: f64,
    least: f64,
    step: f64,
) -> Result<Option<f64>> {
    let mut known = vec![(0i32, least)];
    let mut middle = 0;
    for _ in 0..bounds::MOVES {
        for at in [-2, -1, 1, 2].map(|by| middle + by) {
            if known.iter().all(|(other, _)| *other != at) {
                known.push((at, cost(start + f64::from(at) * step)?));
            }
        }
        let near = || known.iter().filter(|(at, cost)| (at - middle).abs() <= 2 && cost.is_finite());
        let best = near().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(middle, |(at, _)| *at);
        if (best - middle).abs() < 2 {
            let points: Vec<[f64; 2]> = near().map(|(at, cost)| [f64::from(*at), *cost]).collect();
            return Ok(parabola(&points)
                .map(|at| start + step * at.clamp(f64::from(middle) - 2.0, f64::from(middle) + 2.0)));
        }
        middle = best;
    }
    Ok(Some(start + step * f64::from(middle)))
}

/// The vertex of the parabola of least squares, if it is a minimum.
fn parabola(points: &[[f64; 2]]) -> Option<f64> {
    let sum = |of: &dyn Fn(f64) -> f64| points.iter().map(|[x, y]| of(*x) * y).sum::<f64>();
    let moment = |k: i32| points.iter().map(|[x, _]| x.powi(k)).sum::<f64>();
    let matrix = DMat3::from_cols(
        [0, 1, 2].map(&moment).into(),
        [1, 2, 3].map(&moment).into(),
        [2, 3, 4].map(moment).into(),
    );
    let of = matrix.inverse() * DVec3::new(sum(&|_| 1.0), sum(&|x| x), sum(&|x| x * x));
    (points.len() >= 3 && of.z > 0.0).then(|| -0.5 * of.y / of.z)
}

/// Corrects a capture by what a search finds and held-out pairs confirm, by estimates anew; twice at most.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn corrected<'c>(mut job: Job<'c>, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Job<'c>> {
    for _ in 0..bounds::CORRECTIONS {
        if job.estimates.at_hand.is_none() {
            break;
        }
        let (clock, before) = (Instant::now(), job.estimates.seconds);
        let found = searched(&job, gpu, hear)?;
        job.estimates.add_search(clock.elapsed().as_secs_f64());
        let Some(mut found) = found else { break };
        let scan = LawScan::of(&job.capture);
        // A bar that does not begin again.
        let hear = &mut |progress: &Progress| match progress.doing {
            Doing::Preview => ControlFlow::Continue(()),
            _ => hear(&Progress { doing: Doing::Search, maps: None, ..progress.clone() }),
        };
        let again = |TriedLaw { law, numbers, .. }: &TriedLaw| {
            job.again(Cow::Owned(law.undone(&job.capture, &scan, numbers)))
        };
        let mut undone = estimate(again(&found), gpu, hear)?;
        if let Some(better) = refined_by(&job, &undone.estimates, &found, gpu, hear)? {
            found = better;
            undone = estimate(again(&found), gpu, hear)?;
        }
        let TriedLaw { law, numbers, left: [after, before_it], .. } = &found;
        let mut finding = CaptureFinding::new(FindingSource::Searched, (law.what)(&scan, numbers), law.hint);
        finding.left =
            vec![("none".into(), Some(before_it.figures())), (law.name.into(), Some(after.figures()))];
        finding.law = Some(law.name.into());
        finding.is_used = found.passes(law.gate);
        let is_used = finding.is_used;
        if is_used {
            finding.corrections = vec![law.as_stored(&scan, numbers)];
            job = undone;
        }
        job.estimates.findings.push(finding);
        job.estimates.add_search(clock.elapsed().as_secs_f64() + before - job.estimates.seconds);
        if !is_used {
            break;
        }
    }
    Ok(job)
}

/// The correction that leaves least, if it is at least doubtful that the capture is right without it.
fn searched(job: &Job<'_>, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Option<TriedLaw>> {
    let Some((held, starts)) = job.estimates.at_hand.as_ref().filter(|_| job.calibrates()) else {
        return Ok(None);
    };
    if held.left().certain() <= bounds::SUSPICIOUS || job.estimates.has_samples() {
        return Ok(None);
    }
    let Some(mut trials) = Trials::new(job, starts.clone(), From::Brief, gpu, hear)? else { return Ok(None) };
    if trials.base.left().certain() <= bounds::SUSPICIOUS || !trials.scan.fills_area() {
        return Ok(None);
    }
    let mut found: Vec<TriedLaw> = vec![];
    for proposals in [propose::closed_form, propose::by_steps, propose::as_scale] {
        for proposal in proposals(&mut trials)? {
            found.extend(trials.minimised(&proposal)?.filter(|tried| tried.passes(EvidenceGate::PROMISING)));
        }
        found.sort_by(TriedLaw::compared);
        let is_settled =
            |best: &TriedLaw| !(best.law.has_rivals)(&best.numbers) && best.passes(best.law.gate);
        if found.first().is_some_and(is_settled) {
            break;
        }
    }
    if found.first().is_some_and(|best| !best.passes(best.law.gate)) {
        for law in LAWS.iter().filter(|law| law.proposed == Proposed::Last) {
            let proposal = Proposal { law, starts: (law.starts)(&trials.scan), is_far: false };
            found.extend(trials.minimised(&proposal)?.filter(|tried| tried.passes(EvidenceGate::PROMISING)));
        }
        found.sort_by(TriedLaw::compared);
    }
    let Some(first) = found.first() else { return Ok(None) };
    if trials.leaves_less_both_ways(first)? || !trials.fit_whole()? {
        return Ok(None);
    }
    let mut finalists = vec![];
    let near = bounds::RIVAL * first.share_left();
    for of in found.iter().take(bounds::FINALISTS).filter(|of| of.share_left() <= near) {
        finalists.extend(trials.whole(of)?);
    }
    finalists.retain(|tried| tried.passes(EvidenceGate::DOUBT) || tried.passes(tried.law.gate));
    Ok(finalists.into_iter().min_by(TriedLaw::compared))
}
