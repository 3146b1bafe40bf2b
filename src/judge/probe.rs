//! Fits that go on from a surface with a small change of the instrument: what a few hundredths of a second say of causes.

use super::found::Shown;
use super::laws::{LAWS, LawScan};
use super::sense::Sense;
use super::suspects::{Suspects, both, suggested};
use crate::Result;
use crate::judge::search::{Search, trial_of};
use crate::judge::trial::{Fitted, Trial};
use crate::surface::Left;
use crate::transport::Reflectance;

/// Iterations of a fit with a change.
const ITERATIONS: usize = 20;

/// A change of the scale must leave less by this share, and by these standard errors.
const LESS: f64 = 0.02;
const BEYOND: f64 = 1.5;
/// What a step of the keystone leaves at most, of what is left without it, for a fit to try this many times as much.
const KEYSTONE: f64 = 0.97;
const LONGER: f64 = 2.4;

/// What a surface suggests.
///
/// # Errors
/// The device fails, or the caller cancels.
fn suspected(search: &mut Search<'_>, reflectance: Reflectance, fitted: &Fitted) -> Result<Suspects> {
    let layers = &fitted.surface.layers;
    let trial = trial_of(&search.trials, reflectance).clone();
    let scan = LawScan::of(trial.capture());
    let named = |name: &str| LAWS.iter().find(|law| law.name == name).expect("a law");
    let [scale, keystone] = ["scale", "keystone"].map(named);
    let gains = Sense::of(&trial, layers)?.and_then(|sense| suggested(&sense, &scan));
    let [step, slant] = [scale, keystone].map(|law| law.steps[0][0]);
    let slants = [[slant, 0.0], [-slant, 0.0], [0.0, slant], [0.0, -slant]];
    let scales = [step, -step].map(|step| (scale, vec![step]));
    let changes = scales.into_iter().chain(slants.map(|numbers| (keystone, numbers.to_vec())));
    let changed =
        changes.map(|(law, numbers)| trial.with_capture(law.undone(trial.capture(), &scan, &numbers)));
    let trials: Vec<Trial<'_>> = std::iter::once(trial.clone()).chain(changed).collect();
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
    let slants = slants.into_iter().zip(&judged[2..]).filter(|(_, of)| of[0] < KEYSTONE);
    let slanted = slants.min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let keystone = slanted.map(|(numbers, _)| (keystone, numbers.map(|n| LONGER * n).to_vec()));
    Ok(Suspects { gains, scale: side.map(|(step, _)| (scale, step)), keystone })
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
