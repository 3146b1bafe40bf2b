//! The search for a correction: proposals from the surface at hand, one minimiser for the numbers of every law, and trials that begin with
//! what the network sees of the capture as it is. The network looks again once, at the numbers that were found.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::correction::{Correction, Law, LawScan, Proposed};
use super::decide::{Gate, both};
use super::estimate::{self, for_fits};
use super::finding::{Finding, Source};
use super::gains;
use super::given::figures_of;
use super::job::Job;
use super::propose::{self, Proposal};
use super::trial::{Fitted, From, Trial, fit_all};
use crate::Result;
use crate::capture::Pulse;
use crate::engine::{Doing, Progress, TracePoint, Watch};
use crate::gpu::Gpu;
use crate::surface::{Left, Starts};

/// Constants of the search. Evidence: benches/NOTES.md, "Causes" and "Search".
mod bounds {
    use crate::judge::decide::Gate;

    /// Corrections of one capture at most.
    pub const CORRECTIONS: usize = 2;
    /// Share that is certainly left of held-out pairs, with the estimated impulse response, from which anything is tried: proper captures
    /// of simulated light leave less.
    pub const SUSPICIOUS: f64 = 0.03;
    /// What brief fits must reach for a law to be fitted whole.
    pub const PROMISING: Gate = Gate { factor: 0.85, errors: 2.0 };
    /// Fits of a search, as its progress expects them.
    pub const USUAL: usize = 80;
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

/// A law with numbers that a fit judged.
#[derive(Clone)]
pub struct Tried {
    pub law: &'static Law,
    pub numbers: Vec<f64>,
    /// Of the pairs that both hold out: what is left once it is undone, and as the capture is.
    pub left: [Left; 2],
    pub fitted: Fitted,
}

impl Tried {
    /// What is left once it is undone.
    pub fn excess(&self) -> f64 {
        self.left[0].excess()
    }

    fn passes(&self, gate: Gate) -> bool {
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
    job: &'j Job<'j>,
    pub trial: Trial<'j>,
    pulse: Option<Pulse>,
    pub scan: LawScan,
    /// The surface of the capture as it is.
    pub base: Fitted,
    gpu: &'j Gpu,
    hear: &'j mut dyn FnMut(&Progress) -> ControlFlow<()>,
    /// Fits are brief until the network looks again.
    from: From<'static>,
    /// All trials so far: a minimiser comes back to the same numbers.
    judged: Vec<Tried>,
    /// Fits so far.
    done: usize,
}

impl<'j> Trials<'j> {
    /// `None` if no surface is found.
    fn new(
        job: &'j Job<'j>,
        starts: Arc<Starts>,
        gpu: &'j Gpu,
        hear: &'j mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Option<Trials<'j>>> {
        let (solver, pulse) = job.estimates.settle(&job.solver, &job.models)?;
        let pulse = pulse.or(job.capture.pulse.clone());
        let (mut whole, grid, options) = for_fits(job, &job.capture, &solver)?;
        if pulse.is_some() {
            whole.to_mut().pulse.clone_from(&pulse);
        }
        let scan = LawScan::of(&whole);
        let trial = Trial::new(gpu, Arc::new(whole), grid, options, starts, job.settings.memory);
        let mut quiet = |_: &Progress| ControlFlow::Continue(());
        let mut watch = Watch { hear: &mut quiet, maps_every: None, maps_at: &[] };
        let base = fit_all(&[&trial], pulse.as_ref(), From::Brief, 1.0, &mut watch)?.pop().flatten();
        Ok(base.map(|base| Trials {
            job,
            trial,
            pulse,
            scan,
            base,
            gpu,
            hear,
            from: From::Brief,
            judged: vec![],
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
                iterations: bounds::USUAL.max(iteration),
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

    /// What is left as the capture is.
    pub fn before(&self) -> f64 {
        self.base.held.left().excess()
    }

    /// What a fit leaves once these numbers of a law are undone; `None` without a surface.
    pub fn judged(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<Tried>> {
        if let Some(same) = self.judged.iter().find(|of| of.law.name == law.name && of.numbers == numbers) {
            return Ok(Some(same.clone()));
        }
        let undone = self.trial.with_capture(law.undone(self.trial.capture(), &self.scan, numbers));
        let Some(fitted) = self.fits(&[undone], self.from, 1.0)?.pop().flatten() else { return Ok(None) };
        let gains = (law.proposed == Proposed::ByProducts).then(|| law.gains(&self.scan, numbers));
        let left = both(&fitted.held, &self.base.held, gains.as_deref());
        let tried = Tried { law, numbers: numbers.to_vec(), left, fitted };
        self.judged.push(tried.clone());
        Ok(Some(tried))
    }

    /// The numbers of a law that leave least, from a proposal, by the `look`th look of the network, which halves the steps.
    fn minimised(&mut self, Proposal { law, starts }: Proposal, look: usize) -> Result<Option<Tried>> {
        match law.proposed {
            Proposed::ByLines | Proposed::ByProducts => return self.stepped(law, starts),
            _ => {}
        }
        let mut begin: Option<Tried> = None;
        for start in starts {
            let tried = self.judged(law, &start)?;
            begin = tried.into_iter().chain(begin).min_by(|a, b| a.excess().total_cmp(&b.excess()));
        }
        let Some(begin) = begin.filter(|begin| begin.excess() < self.before()) else { return Ok(None) };
        let [first, each] = bounds::FITS[look];
        let share = 0.5f64.powi(look as i32);
        let fits = first + each * (law.steps.len() - 1);
        let steps: Vec<[f64; 2]> = law.steps.iter().map(|[step, far]| [share * step, *far]).collect();
        let mut cost =
            |numbers: &[f64]| Ok(self.judged(law, numbers)?.map_or(f64::INFINITY, |tried| tried.excess()));
        let (_, numbers) =
            minimised(&mut cost, (begin.excess(), begin.numbers), &steps, fits, bounds::ALIKE)?;
        self.judged(law, &numbers)
    }

    /// The same by closed-form steps from what is left once earlier ones are undone.
    fn stepped(&mut self, law: &'static Law, starts: Vec<Vec<f64>>) -> Result<Option<Tried>> {
        let (mut best, mut next): (Option<Tried>, _) = (None, starts.into_iter().next());
        for _ in 0..bounds::ROUNDS {
            let Some(tried) = next.map_or(Ok(None), |numbers| self.judged(law, &numbers))? else { break };
            if tried.excess() > bounds::LESS * best.as_ref().map_or(self.before(), Tried::excess) {
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
        (self.from, self.judged) = (From::Start, vec![]);
        let trial = self.trial.clone();
        let base = self.fits(std::slice::from_ref(&trial), From::Start, 1.0)?.pop().flatten();
        let is_found = base.is_some();
        self.base = base.unwrap_or_else(|| self.base.clone());
        Ok(is_found)
    }

    /// The correction by trials that begin with what the network sees once it is undone, with its numbers refined.
    fn looked_at_again(&mut self, found: &Tried) -> Result<Option<Tried>> {
        let Tried { law, numbers, .. } = found;
        let undone = self.job.with_capture(Cow::Owned(law.undone(&self.job.capture, &self.scan, numbers)));
        let starts = estimate::starts_of(&undone, self.gpu, self.hear)?;
        self.trial.set_starts(&starts);
        self.judged.clear();
        self.minimised(Proposal { law, starts: vec![numbers.clone()] }, 1)
    }

    /// Whether the opposite leaves less, too.
    fn leaves_less_both_ways(&mut self, best: &Tried) -> Result<bool> {
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
        let clock = Instant::now();
        let found = searched(&job, gpu, hear)?;
        let seconds = clock.elapsed().as_secs_f64();
        let Some(found) = found else {
            job.estimates.add_search(seconds);
            break;
        };
        let frame = LawScan::of(&job.capture).frame;
        let correction = Correction { law: found.law, numbers: found.numbers.clone(), frame };
        let mut finding = Finding::new(Source::Searched, correction.what(&job.capture), found.law.hint);
        let figures = |left: &Left| Some(figures_of(left));
        finding.left =
            vec![("none".into(), figures(&found.left[1])), (found.law.name.into(), figures(&found.left[0]))];
        finding.law = Some(found.law.name.into());
        finding.is_used = found.passes(Gate::of(Source::Searched));
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
) -> Result<Option<Tried>> {
    let Some(at_hand) = job.estimates.at_hand.as_ref().filter(|_| job.calibrates()) else { return Ok(None) };
    if at_hand.held.left().certain() <= bounds::SUSPICIOUS || job.estimates.has_samples() {
        return Ok(None);
    }
    let Some(mut trials) = Trials::new(job, at_hand.starts.clone(), gpu, hear)? else { return Ok(None) };
    if trials.base.held.left().certain() <= bounds::SUSPICIOUS {
        return Ok(None);
    }
    let mut found: Vec<Tried> = vec![];
    for proposals in [propose::closed_form, propose::by_steps, propose::as_scale] {
        for proposal in proposals(&mut trials, &found)? {
            found.extend(trials.minimised(proposal, 0)?.filter(|tried| tried.passes(bounds::PROMISING)));
        }
        found.sort_by(|a, b| a.excess().total_cmp(&b.excess()));
        if found
            .first()
            .is_some_and(|best| !(best.law.has_rivals)(&best.numbers) && best.passes(Gate::SEARCHED))
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
        finalists.extend(trials.looked_at_again(of)?);
    }
    finalists.retain(|tried| tried.passes(Gate::DOUBT));
    Ok(finalists.into_iter().min_by(|a, b| a.excess().total_cmp(&b.excess())))
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
