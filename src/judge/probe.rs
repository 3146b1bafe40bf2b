//! Fits that go on from a surface with a small change of the instrument: what a few hundredths of a second say of causes.

use super::found::Shown;
use super::laws::{Changes, LAWS, LawScan};
use super::sense::Sense;
use super::suspects::{Suspects, both, suggested};
use crate::Result;
use crate::judge::search::{Search, trial_of};
use crate::judge::trial::Fitted;
use crate::surface::Left;
use crate::transport::Reflectance;

/// Iterations of a fit with a change.
const ITERATIONS: usize = 20;

/// A change of the scale must leave less by this share, and by these standard errors.
const LESS: f64 = 0.02;
const BEYOND: f64 = 1.5;

/// What a surface suggests.
///
/// # Errors
/// The device fails, or the caller cancels.
fn suspected(search: &mut Search<'_>, reflectance: Reflectance, fitted: &Fitted) -> Result<Suspects> {
    let layers = &fitted.surface.layers;
    let trial = trial_of(&search.trials, reflectance).clone();
    let scan = LawScan::of(trial.capture());
    let scale = LAWS.iter().find(|law| law.kind == Changes::Place).expect("a law of places");
    let step = scale.steps[0][0];
    let gains = Sense::of(&trial, layers)?.and_then(|sense| suggested(&sense, &scan));
    let without = |step: f64| trial.with_capture(scale.undone(trial.capture(), &scan, &[step]));
    let trials = [trial.clone(), without(step), without(-step)];
    let fits = search.fit_variants(&trials, layers, ITERATIONS, fitted.surface.step)?;
    let mut fits = fits.into_iter().map(|fitted| fitted.map(|fitted| fitted.held));
    let Some(base) = fits.next().flatten() else { return Ok(Suspects::default()) };
    // What is left over what is left without the change, and by how many standard errors it is less.
    let judged: Vec<[f64; 2]> = fits
        .map(|held| {
            held.map_or([1.0, 0.0], |held| {
                let left = both(&held, &base);
                let [after, before] = left.each_ref().map(Left::excess);
                [after / before, left[0].errors_below(&left[1])]
            })
        })
        .collect();
    let is_less = |of: &[f64; 2]| of[0] < 1.0 - LESS && of[1] > BEYOND;
    let sides = [(step, judged[0]), (-step, judged[1])];
    let side = sides.into_iter().filter(|(_, of)| is_less(of)).min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    Ok(Suspects { gains, scale: side.map(|(step, _)| (scale, step)) })
}

/// Share that is certainly left beyond noise, from which the residual of all pairs may show a cause.
const DOUBTFUL: f64 = 0.08;
/// The same, from which changes of the instrument are fitted.
const SUSPICIOUS: f64 = 0.03;

/// What a fit is asked beside its pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ask {
    /// Nothing.
    Nothing,
    /// What it shows of gains.
    Gains,
    /// Which causes it suggests.
    Causes,
}

/// What a fit of a search shows.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn shown_of(
    search: &mut Search<'_>,
    reflectance: Reflectance,
    fitted: Fitted,
    ask: Ask,
) -> Result<Shown> {
    let certain = fitted.held.left().certain();
    let trial = trial_of(&search.trials, reflectance);
    let all = if certain > DOUBTFUL { trial.all(&fitted.surface.layers)? } else { None };
    let sense = if ask == Ask::Gains { Sense::of(trial, &fitted.surface.layers)? } else { None };
    let suspects = match ask {
        Ask::Causes if certain > SUSPICIOUS => suspected(search, reflectance, &fitted)?,
        _ => Suspects::default(),
    };
    Ok(Shown { held: fitted.held, all, sense, suspects })
}
