//! Gains of held-out pairs by one surface: sums of products of its rendering, of those of smooth changes of the surface, and of what is
//! measured. What the gains of any law leave with the best of these surfaces follows from them, without another rendering.

use std::convert::Infallible;

use thirdbounce_base::equations::solve_symmetric;
use thirdbounce_base::minimise::simplex;

use super::correction::{LAWS, Law, LawScan, Proposed};
use super::trial::{Proposal, Trial, Trials, TriedLaw};
use crate::Result;
use crate::maps::Maps;
use crate::surface::{HeldOut, mean_and_error};

/// Gains are proposed if they are predicted to explain this share of what is left beyond noise, by these standard errors. Evidence:
/// benches/NOTES.md, "Causes".
const WORTH: [f64; 2] = [0.15, 3.0];
/// Evaluations of sums for the numbers of a law, and the difference at which they end.
const EVALUATIONS: usize = 160;
const ALIKE: f64 = 1e-7;
/// Factor of further steps: the surface hides a part of the gains.
const LONGER: f64 = 1.4;

/// Smooth changes of a surface, which hide gains: albedos, and depths, by polynomials of the place.
const OF_ALBEDOS: usize = 6;
const MODES: usize = OF_ALBEDOS + 7;
/// Columns of the surface, of which the first one is its rendering, and that of what is measured.
const OF_SURFACE: usize = MODES + 1;
const MEASURED: usize = OF_SURFACE;
const COLUMNS: usize = OF_SURFACE + 1;

/// Steps of the changes: of albedos as a share, of depths in bins.
const STEPS: [f64; 2] = [0.2, 0.5];

/// Share of the square of a change below which nothing determines it beside the others.
const LEAST: f64 = 1e-9;

/// Sums of products of rows of the held-out pairs, as the objective weighs them.
#[derive(Debug, Clone)]
struct Sense {
    /// The pair of the capture for each row.
    pairs: Vec<usize>,
    products: Vec<[[f64; COLUMNS]; COLUMNS]>,
    /// Photon noise in the squares of all pairs.
    noise: f64,
}

impl Sense {
    /// Of the layers of a trial; `None` if they show no light.
    ///
    /// # Errors
    /// The device fails.
    fn of(trial: &Trial<'_>, layers: &[Maps]) -> Result<Option<Sense>> {
        let as_is = std::iter::once(layers.to_vec());
        let versions: Vec<Vec<Maps>> =
            as_is.chain((0..MODES).map(|mode| changed(layers, mode, trial.capture().bin_width))).collect();
        let Some(all) = trial.renderings(&versions)?.into_iter().collect::<Option<Vec<HeldOut>>>() else {
            return Ok(None);
        };
        let held = &all[0];
        let [rendered, measured] = held.sides();
        let changes = all[1..].iter().map(|of| {
            let [changed, _] = of.sides();
            changed.iter().zip(&rendered).map(|(c, r)| c - r).collect::<Vec<f64>>()
        });
        let mut columns: Vec<Vec<f64>> = changes.collect();
        columns.insert(0, rendered);
        columns.push(measured);
        let bins = held.bins();
        let of_pair = |pair: usize| {
            let row = |column: usize| &columns[column][pair * bins..(pair + 1) * bins];
            let product = |a: usize, b: usize| row(a).iter().zip(row(b)).map(|(a, b)| a * b).sum::<f64>();
            let half: [[f64; COLUMNS]; COLUMNS] =
                std::array::from_fn(|a| std::array::from_fn(|b| if b <= a { product(a, b) } else { 0.0 }));
            std::array::from_fn(|a| std::array::from_fn(|b| half[a.max(b)][a.min(b)]))
        };
        let products = (0..held.pairs.len()).map(of_pair).collect();
        Ok(Some(Sense { noise: held.left().noise, pairs: held.pairs.clone(), products }))
    }

    /// Squares of each pair that are left with gains of these logarithms (none: empty), with the surface that suits them.
    fn left(&self, logs: &[f64]) -> Vec<f64> {
        let gain = |pair: usize| logs.get(pair).map_or(1.0, |log| log.exp());
        let mut sums = [[0.0; OF_SURFACE]; OF_SURFACE];
        let mut sides = [0.0; OF_SURFACE];
        for (pair, products) in self.products.iter().enumerate() {
            let gain = gain(pair);
            for a in 0..OF_SURFACE {
                sides[a] += gain * products[a][MEASURED];
                (0..=a).for_each(|b| sums[a][b] += gain * gain * products[a][b]);
            }
        }
        solve_symmetric(&mut sums, &mut sides, LEAST);
        let of_pair = |(pair, products): (usize, &[[f64; COLUMNS]; COLUMNS])| {
            let gain = gain(pair);
            let of = |a: usize| sides.iter().enumerate().map(|(b, f)| f * products[a][b]).sum::<f64>();
            let [cross, own] = sides.iter().enumerate().fold([0.0; 2], |[cross, own], (a, factor)| {
                [cross + factor * products[a][MEASURED], own + factor * of(a)]
            });
            products[MEASURED][MEASURED] - 2.0 * gain * cross + gain * gain * own
        };
        self.products.iter().enumerate().map(of_pair).collect()
    }

    /// Of these squares, those beyond photon noise.
    fn beyond_noise(&self, squares: f64) -> f64 {
        let measured: f64 = self.products.iter().map(|products| products[MEASURED][MEASURED]).sum();
        (squares - self.noise).max(1e-3 * (measured - self.noise))
    }
}

/// Layers changed by a mode.
fn changed(layers: &[Maps], mode: usize, bin_width: f64) -> Vec<Maps> {
    let mut changed = layers.to_vec();
    let finite = || layers.iter().flat_map(|maps| maps.depth.iter()).filter(|z| z.is_finite());
    let middle = finite().map(|z| f64::from(*z)).sum::<f64>() / finite().count().max(1) as f64;
    for maps in &mut changed {
        let [x0, x1, y0, y1] = maps.extent;
        for pixel in 0..maps.depth.len() {
            let z = f64::from(maps.depth[pixel]);
            if !z.is_finite() {
                continue;
            }
            let [ix, iy] = [pixel / maps.ny, pixel % maps.ny];
            let u = 2.0 * (ix as f64 + 0.5) / maps.nx as f64 - 1.0;
            let v = 2.0 * (iy as f64 + 0.5) / maps.ny as f64 - 1.0;
            let w = 4.0 * (z - middle) / (x1 - x0 + y1 - y0);
            let basis = [u, v, u * u, u * v, v * v, w, 1.0];
            if mode < OF_ALBEDOS {
                maps.albedo[pixel] *= (1.0 + STEPS[0] * basis[mode]).max(0.0) as f32;
            } else {
                maps.depth[pixel] += (STEPS[1] * bin_width * basis[mode - OF_ALBEDOS]) as f32;
            }
        }
    }
    changed
}

/// Of a law of gains, the numbers that suit what a surface shows best, beyond `base`, which is undone in it; and the share of what is left
/// that they are predicted to explain, with its standard errors.
fn suited(
    sense: &Sense,
    scan: &LawScan,
    law: &'static Law,
    base: Option<&[f64]>,
) -> Option<(Vec<f64>, [f64; 2])> {
    let logs = |numbers: &[f64]| law.logs(scan, numbers, &sense.pairs);
    let undone = base.map_or_else(|| vec![0.0; sense.pairs.len()], logs);
    let left = |numbers: &[f64]| {
        let beyond: Vec<f64> = logs(numbers).iter().zip(&undone).map(|(log, undone)| log - undone).collect();
        sense.left(&beyond)
    };
    let cost = |numbers: &[f64]| left(numbers).iter().sum::<f64>();
    let mut starts = (law.starts)(scan);
    if let Some(base) = base {
        // A number without a step stays what it is at a start.
        starts.iter_mut().for_each(|start| {
            let stepped = start.iter_mut().zip(law.steps).zip(base).filter(|((_, step), _)| step[0] > 0.0);
            stepped.for_each(|((n, _), base)| *n = *base);
        });
        starts.push(base.to_vec());
    }
    let begin = starts.into_iter().map(|start| (cost(&start), start)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let of = &mut |numbers: &[f64]| Ok::<_, Infallible>(cost(numbers));
    let Ok((least, numbers)) = simplex(of, begin, law.steps, EVALUATIONS, ALIKE);
    let (none, after) = (sense.left(&[]), left(&numbers));
    let squares: f64 = none.iter().sum();
    let [mean, error] = mean_and_error(none.iter().zip(&after).map(|(before, after)| before - after));
    let errors = mean / error.max(f64::MIN_POSITIVE);
    Some((numbers, [(squares - least) / sense.beyond_noise(squares), errors]))
}

/// The law of gains that suits a surface best, if that is worth a fit.
///
/// # Errors
/// The device fails.
pub fn proposed(trials: &Trials<'_>) -> Result<Option<Proposal>> {
    let Trials { trial, base, scan, .. } = trials;
    let Some(sense) = Sense::of(trial, &base.surface.layers)? else { return Ok(None) };
    let laws = LAWS.iter().filter(|law| law.proposed == Proposed::ByProducts && (law.applies)(scan));
    let each = laws.filter_map(|law| Some((law, suited(&sense, scan, law, None)?)));
    let worth = each.filter(|(_, (_, [share, errors]))| *share > WORTH[0] && *errors > WORTH[1]);
    let best = worth.max_by(|(_, (_, a)), (_, (_, b))| a[0].total_cmp(&b[0]));
    Ok(best.map(|(law, (numbers, _))| Proposal { law, starts: vec![numbers], is_far: false }))
}

/// Numbers beyond those of a trial, by what its surface shows of `undone`, the capture without them; `None` without light.
///
/// # Errors
/// The device fails.
pub fn next(undone: &Trial<'_>, tried: &TriedLaw, scan: &LawScan) -> Result<Option<Vec<f64>>> {
    let TriedLaw { law, numbers, fitted, .. } = tried;
    let Some(sense) = Sense::of(undone, &fitted.surface.layers)? else { return Ok(None) };
    let Some((next, _)) = suited(&sense, scan, law, Some(numbers)) else { return Ok(None) };
    let steps = numbers.iter().zip(&next).map(|(from, to)| from + LONGER * (to - from));
    Ok(Some(steps.zip(law.steps).map(|(n, [_, far])| n.clamp(-far, *far)).collect()))
}
