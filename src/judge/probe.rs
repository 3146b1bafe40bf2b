//! Fits that go on from a surface with a small change of the instrument: what a few hundredths of a second say of causes.

use super::constants::OF_CHANGE;
use super::found::Shown;
use super::laws::{Law, LawScan, named};
use super::moved;
use super::sense::Sense;
use super::suspects::{Suggested, Suspects, both, suggested};
use crate::Result;
use crate::judge::search::{Search, trial_of};
use crate::judge::trial::{Fitted, From, Trial};
use crate::surface::Left;
use crate::transport::Reflectance;

/// A step must leave less by this share, and by these standard errors.
const LESS: f64 = 0.02;
const BEYOND: f64 = 1.5;
/// The laws of places of which steps are tried: the scale, and others, each with how many steps of the scale its step is as long as,
/// of which a fit then tries [`LONGER`] steps.
const STEPPED: [(&str, i32); 5] = [("scale", 1), ("keystone", 1), ("shear", 1), ("sides", 1), (RADIAL, 2)];
const RADIAL: &str = "radial";
const LONGER: f64 = 2.4;

/// The first steps of a law's numbers, each way.
fn steps_of(law: &'static Law) -> Vec<(&'static Law, Vec<f64>)> {
    let count = law.steps.len();
    let along = |at: usize, by: f64| (law, (0..count).map(|i| if i == at { by } else { 0.0 }).collect());
    (0..count).flat_map(|at| [law.steps[at][0], -law.steps[at][0]].map(|by| along(at, by))).collect()
}

/// A change by numbers of a law, and what it leaves over what is left without it.
type Judged = ((&'static Law, Vec<f64>), f64);

/// What a surface suggests.
///
/// # Errors
/// The device fails, or the caller cancels.
fn suspected(search: &mut Search<'_>, reflectance: Reflectance, fitted: &Fitted) -> Result<Suspects> {
    let layers = &fitted.surface.layers;
    let trial = trial_of(&search.trials, reflectance).clone();
    let scan = LawScan::of(trial.capture());
    let gains = Sense::of(&trial, layers)?.and_then(|sense| suggested(&sense, &scan));
    let changes: Vec<(&'static Law, Vec<f64>)> =
        STEPPED.into_iter().flat_map(|(name, _)| steps_of(named(name))).collect();
    let changed =
        changes.iter().map(|(law, numbers)| trial.with_capture(law.undone(trial.capture(), &scan, numbers)));
    let trials: Vec<Trial<'_>> = std::iter::once(trial.clone()).chain(changed).collect();
    let fits = search.fit_variants(&trials, From::Fit(layers, OF_CHANGE), fitted.surface.step)?;
    let mut fits = fits.into_iter().map(|fitted| fitted.map(|fitted| fitted.held));
    let Some(base) = fits.next().flatten() else { return Ok(Suspects::default()) };
    // What is left over what is left without the change, where that is less by these standard errors.
    let judged = changes.into_iter().zip(fits).filter_map(|(change, held)| {
        let left = both(&held?, &base);
        let [after, before] = left.each_ref().map(Left::excess);
        (left[0].errors_below(&left[1]) > BEYOND).then_some((change, after / before))
    });
    let (scales, others): (Vec<Judged>, Vec<Judged>) =
        judged.filter(|(_, share)| *share < 1.0 - LESS).partition(|((law, _), _)| law.name == STEPPED[0].0);
    // Steps of both sides the same way are the scale.
    let sides = |sign: f64| {
        others
            .iter()
            .filter(|((law, n), _)| law.name == "sides" && n.iter().sum::<f64>() * sign > 0.0)
            .count()
    };
    let is_scale = sides(1.0) == 2 || sides(-1.0) == 2;
    let least = |all: Vec<Judged>| all.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let scale = least(scales);
    // Others are tried first that leave less than the scale by steps as long. What is radial is like a scale of both sides.
    let of_scale = scale.as_ref().map_or(f64::INFINITY, |(_, share)| *share);
    let is_first = |(law, _): &(&Law, Vec<f64>), share: f64| {
        let steps = STEPPED.iter().find(|(name, _)| *name == law.name).map_or(1, |(_, steps)| *steps);
        share < of_scale.powi(steps) && (scale.is_none() || !is_scale || law.name == RADIAL)
    };
    let first = others.into_iter().filter(|(change, share)| is_first(change, *share)).collect();
    let place = least(first).map(|((law, numbers), _)| Suggested {
        law,
        starts: vec![numbers.iter().map(|n| LONGER * n).collect()],
    });
    let scale = scale.map(|((law, numbers), _)| (law, numbers[0]));
    let is_moved = gains.is_none() && base.left().certain() > DOUBTFUL;
    let moved = if is_moved { moved::suggested(search, &trial, fitted)? } else { None };
    Ok(Suspects { gains, scale, place, moved })
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
    /// Nothing, but by a fit of more pixels.
    Fine,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_both_ways_along_every_number() {
        let steps: Vec<Vec<f64>> =
            steps_of(named("keystone")).into_iter().map(|(_, numbers)| numbers).collect();
        assert_eq!(steps, [[0.05, 0.0], [-0.05, 0.0], [0.0, 0.05], [0.0, -0.05]]);
        assert!(STEPPED.iter().all(|(name, _)| !steps_of(named(name)).is_empty()));
    }
}
