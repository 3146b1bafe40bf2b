//! Gains of held-out pairs by one surface: sums of products of its rendering, of those of smooth changes of the surface, and of what is
//! measured. What the gains of any law leave with the best of these surfaces follows from them, without another rendering.

use std::convert::Infallible;

use thirdbounce_base::equations::solve_symmetric;
use thirdbounce_base::minimise::simplex;

use super::correction::{LAWS, Law, LawScan, Proposed, line_of};
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
/// Gains of lines and surfaces that suit each other, by turns; a line that has less light than this share of their mean has a gain near 1;
/// and the largest logarithm.
const ALTERNATIONS: usize = 12;
const FEW: f64 = 0.02;
const FARTHEST: f64 = 2.0;

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

    /// What the surface that suits gains of these logarithms (none: empty) shows of each pair without them: its products with what is
    /// measured, and its squares.
    fn shown(&self, logs: &[f64]) -> Vec<[f64; 2]> {
        let mut sums = [[0.0; OF_SURFACE]; OF_SURFACE];
        let mut sides = [0.0; OF_SURFACE];
        for (pair, products) in self.products.iter().enumerate() {
            let gain = gain_of(logs, pair);
            for a in 0..OF_SURFACE {
                sides[a] += gain * products[a][MEASURED];
                (0..=a).for_each(|b| sums[a][b] += gain * gain * products[a][b]);
            }
        }
        solve_symmetric(&mut sums, &mut sides, LEAST);
        let of_pair = |products: &[[f64; COLUMNS]; COLUMNS]| {
            let of = |a: usize| sides.iter().enumerate().map(|(b, f)| f * products[a][b]).sum::<f64>();
            sides.iter().enumerate().fold([0.0; 2], |[cross, own], (a, factor)| {
                [cross + factor * products[a][MEASURED], own + factor * of(a)]
            })
        };
        self.products.iter().map(of_pair).collect()
    }

    /// Squares of each pair that are left with gains of these logarithms, with the surface that suits them.
    fn left(&self, logs: &[f64]) -> Vec<f64> {
        let shown = self.shown(logs).into_iter().zip(&self.products).enumerate();
        let of_pair = |(pair, ([cross, own], products)): (usize, ([f64; 2], &[[f64; COLUMNS]; COLUMNS]))| {
            let gain = gain_of(logs, pair);
            products[MEASURED][MEASURED] - 2.0 * gain * cross + gain * gain * own
        };
        shown.map(of_pair).collect()
    }

    /// Logarithms of gains of lines: those that suit the surface that suits them. Lines without pairs lie between those beside them.
    fn of_lines(&self, scan: &LawScan, axis: usize) -> Vec<f64> {
        let line = |row: usize| line_of(scan.scan, axis, self.pairs[row]);
        let mut logs = vec![0.0; scan.scan[axis]];
        for _ in 0..ALTERNATIONS {
            let of_pairs: Vec<f64> = (0..self.pairs.len()).map(|row| logs[line(row)]).collect();
            let mut sums = vec![[0.0; 2]; logs.len()];
            for (row, [cross, own]) in self.shown(&of_pairs).into_iter().enumerate() {
                let sum = &mut sums[line(row)];
                *sum = [sum[0] + cross, sum[1] + own];
            }
            let few = FEW * sums.iter().map(|[_, own]| own).sum::<f64>() / sums.len() as f64;
            let gain = |[cross, own]: &[f64; 2]| ((cross + few) / (own + few)).max(1e-9).ln();
            let lit = sums.iter().enumerate().filter(|(_, [_, own])| *own > 0.0);
            let known: Vec<(usize, f64)> =
                lit.map(|(line, sums)| (line, gain(sums).clamp(-FARTHEST, FARTHEST))).collect();
            logs = (0..logs.len()).map(|line| between(&known, line)).collect();
        }
        logs
    }

    /// Of these squares, those beyond photon noise.
    fn beyond_noise(&self, squares: f64) -> f64 {
        let measured: f64 = self.products.iter().map(|products| products[MEASURED][MEASURED]).sum();
        (squares - self.noise).max(1e-3 * (measured - self.noise))
    }
}

fn gain_of(logs: &[f64], pair: usize) -> f64 {
    logs.get(pair).map_or(1.0, |log| log.exp())
}

/// The number of a line on the polygon through those of other lines, which are in order; 0 without any.
fn between(known: &[(usize, f64)], line: usize) -> f64 {
    let at = known.partition_point(|(other, _)| *other < line);
    match (at.checked_sub(1).map(|at| known[at]), known.get(at)) {
        (Some((low, a)), Some(&(high, b))) => a + (b - a) * (line - low) as f64 / (high - low) as f64,
        (Some((_, end)), None) | (None, Some(&(_, end))) => end,
        (None, None) => 0.0,
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
    let numbers = match law.lines {
        Some(axis) => {
            let more = sense.of_lines(scan, axis).into_iter().enumerate();
            more.map(|(line, log)| base.map_or(0.0, |base| base[line]) + log).collect()
        }
        None => minimised(&cost, scan, law, base)?,
    };
    let (none, after) = (sense.left(&[]), left(&numbers));
    let squares: f64 = none.iter().sum();
    let [mean, error] = mean_and_error(none.iter().zip(&after).map(|(before, after)| before - after));
    let errors = mean / error.max(f64::MIN_POSITIVE);
    let less = squares - after.iter().sum::<f64>();
    Some((numbers, [less / sense.beyond_noise(squares), errors]))
}

/// The numbers of a law that cost least, from its starts and `base`.
fn minimised(
    cost: &dyn Fn(&[f64]) -> f64,
    scan: &LawScan,
    law: &'static Law,
    base: Option<&[f64]>,
) -> Option<Vec<f64>> {
    let starts = (law.starts)(scan).into_iter().chain(base.map(<[f64]>::to_vec));
    let begin = starts.map(|start| (cost(&start), start)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let of = &mut |numbers: &[f64]| Ok::<_, Infallible>(cost(numbers));
    let Ok((_, numbers)) = simplex(of, begin, law.steps, EVALUATIONS, ALIKE);
    Some(numbers)
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
    let far = |at: usize| law.steps.get(at).map_or(FARTHEST, |[_, far]| *far);
    let step =
        |(at, (from, to)): (usize, (&f64, &f64))| (from + LONGER * (to - from)).clamp(-far(at), far(at));
    Ok(Some(numbers.iter().zip(&next).enumerate().map(step).collect()))
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::capture::Capture;

    #[test]
    fn a_line_without_pairs_lies_between_those_beside_it() {
        let known = [(1, 2.0), (3, 4.0), (7, 0.0)];
        let all: Vec<f64> = (0..9).map(|line| between(&known, line)).collect();
        assert_eq!(all, [2.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0, 0.0]);
        assert_eq!(between(&[], 3), 0.0);
    }

    /// Pairs of every second column of 16 x 12, whose measured light is the rendered one and a half of one change of the surface, times a gain
    /// of its column.
    #[test]
    fn gains_of_lines_are_found_beside_a_changed_surface() {
        let [nx, ny] = [16, 12];
        let points = (0..nx * ny).map(|pair| dvec3((pair / ny) as f64, (pair % ny) as f64, 0.0));
        let points: Vec<_> = points.collect();
        let capture = Capture::new([nx, ny], points.clone(), points, 4, 0.01, vec![1.0; nx * ny * 4]);
        let scan = LawScan::of(&capture);
        let log = |line: usize| 0.3 * (0.9 * line as f64).sin();
        let pairs: Vec<usize> = (0..nx * ny).filter(|pair| pair / ny % 2 == 1).collect();
        let products = pairs.iter().map(|pair| {
            let noise = |at: usize| ((pair * 37 + at * 101) % 23) as f64 / 23.0;
            let mut columns = [[0.0; 5]; COLUMNS];
            for (bin, (rendered, change)) in (0..5).map(|bin| (bin, (1.0 + noise(bin), noise(bin + 7) - 0.5)))
            {
                columns[0][bin] = rendered;
                columns[3][bin] = change;
                columns[MEASURED][bin] = log(pair / ny).exp() * (rendered + 0.5 * change);
            }
            let product = |a: usize, b: usize| columns[a].iter().zip(&columns[b]).map(|(a, b)| a * b).sum();
            std::array::from_fn(|a| std::array::from_fn(|b| product(a, b)))
        });
        let sense = Sense { products: products.collect(), pairs, noise: 0.0 };
        let found = sense.of_lines(&scan, 0);
        // A common gain is the albedo's.
        let apart = |line: usize| found[line] - found[1] - log(line) + log(1);
        assert!((0..nx).filter(|line| line % 2 == 1).all(|line| apart(line).abs() < 0.02), "{found:.3?}");
        assert!((found[4] - 0.5 * (found[3] + found[5])).abs() < 1e-12);
        let [before, after]: [f64; 2] = [vec![], sense.pairs.iter().map(|pair| found[pair / ny]).collect()]
            .map(|logs| sense.left(&logs).iter().sum());
        assert!(after < 0.01 * before, "{before} {after}");
    }
}
