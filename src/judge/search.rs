//! The search for a correction: proposals from the surface at hand, one minimiser for the numbers of every law, and trials that begin with
//! what the network sees of the capture as it is. The network looks again once, at the numbers that were found.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::Instant;

use super::correction::{Law, LawCorrection, LawScan, Proposed};
use super::decide::EvidenceGate;
use super::finding::{CaptureFinding, FindingSource};
use super::given::figures_of;
use super::job::Job;
use super::trial::From;
use super::trials::{Proposal, Trials, TriedLaw, minimised};
use super::{estimate, gains, propose};
use crate::Result;
use crate::engine::{Doing, Progress};
use crate::gpu::Gpu;
use crate::surface::Left;

/// Constants of the search. Evidence: benches/NOTES.md, "Causes" and "Search".
mod bounds {
    use crate::judge::decide::EvidenceGate;

    /// Corrections of one capture at most.
    pub const CORRECTIONS: usize = 2;
    /// Share that is certainly left of held-out pairs, with the estimated impulse response, from which anything is tried: proper captures
    /// of simulated light leave less.
    pub const SUSPICIOUS: f64 = 0.03;
    /// What brief fits must reach for a law to be fitted whole.
    pub const PROMISING: EvidenceGate = EvidenceGate { factor: 0.93, errors: 2.0 };
    /// Corrections with which the network looks again.
    pub const FINALISTS: usize = 2;
    /// Fits of a law at most, with one number and for each further one: by the first look of the network, and by its second one.
    pub const FITS: [[usize; 2]; 2] = [[7, 4], [9, 5]];
    /// Fits of a simplex end where its corners differ by this share: fits of one capture scatter by as much.
    pub const ALIKE: f64 = 0.03;
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
    /// The numbers of a law that leave least, from a proposal, by the `look`th look of the network, which halves the steps.
    fn minimised(&mut self, proposal: &Proposal, look: usize) -> Result<Option<TriedLaw>> {
        let law = proposal.law;
        if matches!(law.proposed, Proposed::ByLines | Proposed::ByProducts) {
            return self.stepped(law, &proposal.starts);
        }
        let begin = self.begun(proposal)?.filter(|begin| begin.excess() < self.before());
        let Some(begin) = begin else { return Ok(None) };
        let [first, each] = bounds::FITS[look];
        let share = 0.5f64.powi(look as i32) * (law.unit)(&begin.numbers);
        let fits = first + each * (law.steps.len() - 1);
        let steps: Vec<[f64; 2]> = law.steps.iter().map(|[step, far]| [share * step, *far]).collect();
        let least = (begin.excess(), begin.numbers.clone());
        self.beginning_with(&begin.begun, |trials| {
            let mut cost =
                |n: &[f64]| Ok(trials.judged(law, n)?.map_or(f64::INFINITY, |tried| tried.excess()));
            let (_, numbers) = minimised(&mut cost, least, &steps, fits, bounds::ALIKE)?;
            trials.judged(law, &numbers)
        })
    }

    /// The same by closed-form steps from what is left once earlier ones are undone.
    fn stepped(&mut self, law: &'static Law, starts: &[Vec<f64>]) -> Result<Option<TriedLaw>> {
        let (mut best, mut next): (Option<TriedLaw>, _) = (None, starts.first().cloned());
        for _ in 0..bounds::ROUNDS {
            let Some(tried) = next.map_or(Ok(None), |numbers| self.judged(law, &numbers))? else { break };
            if tried.excess() > bounds::LESS * best.as_ref().map_or(self.before(), TriedLaw::excess) {
                break;
            }
            let undone =
                self.trial.with_capture(law.undone(self.trial.capture(), &self.scan, &tried.numbers));
            next = match law.proposed {
                Proposed::ByLines => propose::delays(&undone, &tried, self.scan.scan)?,
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
        Ok(tried.is_some_and(|tried| tried.excess() < bounds::OPPOSITE * self.before()))
    }
}

/// Corrects a capture by what a search finds and held-out pairs confirm, by estimates anew; twice at most.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn corrected<'c>(
    mut job: Job<'c>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Job<'c>> {
    for _ in 0..bounds::CORRECTIONS {
        if job.estimates.at_hand.is_none() {
            break;
        }
        let clock = Instant::now();
        let found = searched(&job, gpu, hear)?;
        let seconds = clock.elapsed().as_secs_f64();
        let Some(found) = found else {
            job.estimates.add_search(seconds);
            break;
        };
        let frame = LawScan::of(&job.capture).frame;
        let correction = LawCorrection { law: found.law, numbers: found.numbers.clone(), frame };
        let mut finding =
            CaptureFinding::new(FindingSource::Searched, correction.what(&job.capture), found.law.hint);
        let figures = |left: &Left| Some(figures_of(left));
        finding.left =
            vec![("none".into(), figures(&found.left[1])), (found.law.name.into(), figures(&found.left[0]))];
        finding.law = Some(found.law.name.into());
        finding.is_used = found.passes(EvidenceGate::of(FindingSource::Searched));
        let is_used = finding.is_used;
        if is_used {
            finding.corrections = vec![correction.as_stored()];
        }
        job.estimates.findings.push(finding);
        job.estimates.add_search(seconds);
        if !is_used {
            break;
        }
        let undone = correction.undone(&job.capture);
        // A bar that does not begin again.
        let mut hear_search = |progress: &Progress| match progress.doing {
            Doing::Preview => ControlFlow::Continue(()),
            _ => hear(&Progress { doing: Doing::Search, maps: None, ..progress.clone() }),
        };
        job = estimate::estimate(job.again(Cow::Owned(undone)), gpu, &mut hear_search)?;
    }
    Ok(job)
}

/// The correction that leaves least, if it is at least doubtful that the capture is right without it.
fn searched(
    job: &Job<'_>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<TriedLaw>> {
    let Some(at_hand) = job.estimates.at_hand.as_ref().filter(|_| job.calibrates()) else { return Ok(None) };
    if at_hand.held.left().certain() <= bounds::SUSPICIOUS || job.estimates.has_samples() {
        return Ok(None);
    }
    let Some(mut trials) = Trials::new(job, at_hand.starts.clone(), gpu, hear)? else { return Ok(None) };
    if trials.base.held.left().certain() <= bounds::SUSPICIOUS {
        return Ok(None);
    }
    let mut found: Vec<TriedLaw> = vec![];
    for proposals in [propose::closed_form, propose::by_steps, propose::as_scale] {
        for proposal in proposals(&mut trials, &found)? {
            found.extend(trials.minimised(&proposal, 0)?.filter(|tried| tried.passes(bounds::PROMISING)));
        }
        found.sort_by(|a, b| a.excess().total_cmp(&b.excess()));
        if found
            .first()
            .is_some_and(|best| !(best.law.has_rivals)(&best.numbers) && best.passes(EvidenceGate::SEARCHED))
        {
            break;
        }
    }
    let Some(first) = found.first() else { return Ok(None) };
    if trials.leaves_less_both_ways(&first.clone())? {
        return Ok(None);
    }
    if !trials.fit_whole()? {
        return Ok(None);
    }
    let mut finalists = vec![];
    let near = bounds::RIVAL * first.excess();
    for of in found.iter().take(bounds::FINALISTS).filter(|of| of.excess() <= near) {
        // What the network sees once it is undone.
        let proposal = Proposal { law: of.law, starts: vec![of.numbers.clone()], is_far: true };
        finalists.extend(trials.minimised(&proposal, 1)?);
    }
    finalists.retain(|tried| tried.passes(EvidenceGate::DOUBT));
    Ok(finalists.into_iter().min_by(|a, b| a.excess().total_cmp(&b.excess())))
}
