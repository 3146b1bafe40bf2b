//! What changes of the instrument a surface suggests: laws with numbers, before any fit judges them.

use super::laws::{Changes, LAWS, Law, LawScan};
use super::sense::Sense;
use crate::surface::{HeldOut, Left, mean_and_error};

/// A law of gains is tried if its numbers are predicted to explain this share of what is left beyond noise, by these standard errors.
/// Evidence: benches/NOTES.md, "Causes".
const WORTH: f64 = 0.15;
const BEYOND: f64 = 3.0;

/// What changes of the instrument suggest.
#[derive(Debug, Clone, Default)]
pub struct Suspects {
    /// Gains that suit what the surface shows.
    pub gains: Option<Suggestion>,
    /// The law of the scale with the step that leaves less: nearly every wrong delay or place changes the scale, too.
    pub scale: Option<(&'static Law, f64)>,
    /// A law of places that changes no scale, if a step that way leaves less.
    pub place: Option<Suggested>,
    /// A motion of the scene between the ends of the scan.
    pub moved: Option<Suggested>,
}

/// A law with numbers for fits to begin with.
#[derive(Debug, Clone)]
pub struct Suggested {
    pub law: &'static Law,
    pub starts: Vec<Vec<f64>>,
}

/// A law with its numbers.
#[derive(Debug, Clone)]
pub struct Suggestion {
    pub law: &'static Law,
    pub numbers: Vec<f64>,
    /// Share of what is left that it is predicted to explain, and by how many standard errors.
    pub predicted: [f64; 2],
}

/// Of a law of gains, the numbers that suit what a surface shows best, beyond `base`, which is undone in it.
pub fn suited(sense: &Sense, scan: &LawScan, law: &'static Law, base: Option<&[f64]>) -> Option<Suggestion> {
    let logs = |numbers: &[f64]| law.effect(scan, numbers, &sense.pairs).logs;
    let undone = base.map_or_else(|| vec![0.0; sense.pairs.len()], logs);
    let beyond = |numbers: &[f64]| -> Vec<f64> {
        logs(numbers).iter().zip(&undone).map(|(log, undone)| log - undone).collect()
    };
    let cost = |numbers: &[f64]| sense.left(&beyond(numbers)).iter().sum::<f64>();
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
    let (least, numbers) = descended(&cost, begin, law.steps);
    let (none, after) = (sense.left(&[]), sense.left(&beyond(&numbers)));
    let squares: f64 = none.iter().sum();
    let [mean, error] = mean_and_error(none.iter().zip(&after).map(|(before, after)| before - after));
    let errors = mean / error.max(f64::MIN_POSITIVE);
    Some(Suggestion { law, numbers, predicted: [(squares - least) / sense.beyond_noise(squares), errors] })
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
pub fn suggested(sense: &Sense, scan: &LawScan) -> Option<Suggestion> {
    let each = LAWS.iter().filter(|law| law.kind == Changes::Gain && (law.applies)(scan));
    let suggestions: Vec<Suggestion> = each.filter_map(|law| suited(sense, scan, law, None)).collect();
    let is_worth =
        |suggestion: &Suggestion| suggestion.predicted[0] > WORTH && suggestion.predicted[1] > BEYOND;
    suggestions.into_iter().filter(is_worth).max_by(|a, b| a.predicted[0].total_cmp(&b.predicted[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simplex_finds_the_least() {
        let cost = |n: &[f64]| (n[0] - 0.3).powi(2) + 4.0 * (n[1] + 0.2 - 0.5 * n[0]).powi(2) + 1.0;
        let (least, found) = descended(&cost, (cost(&[0.0, 0.0]), vec![0.0; 2]), &[[0.1, 1.0]; 2]);
        assert!(
            least < 1.0 + 1e-4 && (found[0] - 0.3).abs() < 1e-2 && (found[1] + 0.05).abs() < 1e-2,
            "{found:?}"
        );
        // Not beyond its reach.
        let (_, found) = descended(&cost, (cost(&[0.0, 0.0]), vec![0.0; 2]), &[[0.1, 0.2]; 2]);
        assert!(found[0] <= 0.2, "{found:?}");
    }
}
