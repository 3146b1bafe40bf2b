//! Minimisation without derivatives.

use std::cell::Cell;

/// The least cost near a start, by at most this number of evaluations of a simplex (Nelder and Mead, 1965), and its numbers. `steps`: first
/// step of each number, 0: it stays; and how far it may be from 0. Ends where the corners differ by the share `alike` of the least cost.
///
/// # Errors
/// Those of `cost`.
pub fn simplex<E>(
    cost: &mut dyn FnMut(&[f64]) -> Result<f64, E>,
    start: (f64, Vec<f64>),
    steps: &[[f64; 2]],
    evaluations: usize,
    alike: f64,
) -> Result<(f64, Vec<f64>), E> {
    let left = Cell::new(evaluations);
    let mut corner = |mut numbers: Vec<f64>| {
        numbers.iter_mut().zip(steps).for_each(|(n, [_, far])| *n = n.clamp(-far, *far));
        left.set(left.get().saturating_sub(1));
        Ok((cost(&numbers)?, numbers))
    };
    let mut corners = vec![start.clone()]; // bounded: one more than the numbers
    for (at, [step, _]) in steps.iter().enumerate().filter(|(_, [step, _])| *step > 0.0) {
        let mut numbers = start.1.clone();
        numbers[at] += step;
        corners.push(corner(numbers)?);
    }
    let last = corners.len() - 1;
    while left.get() > 0 && last > 0 {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (best, worst) = (corners[0].clone(), corners[last].clone());
        if worst.0 - best.0 <= alike * best.0.abs() {
            break;
        }
        let mean = |i: usize| corners[..last].iter().map(|(_, n)| n[i]).sum::<f64>() / last as f64;
        let middle: Vec<f64> = (0..worst.1.len()).map(mean).collect();
        let mut beyond =
            |by: f64| corner(middle.iter().zip(&worst.1).map(|(m, n)| m + by * (n - m)).collect());
        let reflected = beyond(-1.0)?;
        let next = if reflected.0 < best.0 {
            let expanded = beyond(-2.0)?;
            if expanded.0 < reflected.0 { expanded } else { reflected }
        } else if reflected.0 < corners[last - 1].0 {
            reflected
        } else {
            beyond(if reflected.0 < worst.0 { -0.5 } else { 0.5 })?
        };
        if next.0 < worst.0 {
            corners[last] = next;
            continue;
        }
        for other in &mut corners[1..] {
            *other = corner(other.1.iter().zip(&best.1).map(|(n, b)| 0.5 * (n + b)).collect())?;
        }
    }
    Ok(corners.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or(start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simplex_finds_the_least_within_its_bounds() {
        let mut cost =
            |n: &[f64]| Ok::<_, ()>((n[0] - 0.3).powi(2) + 4.0 * (n[1] + 0.2 - 0.5 * n[0]).powi(2) + 1.0);
        let begin = (cost(&[0.0, 0.0]).unwrap(), vec![0.0; 2]);
        let (least, found) = simplex(&mut cost, begin.clone(), &[[0.1, 1.0]; 2], 160, 1e-7).unwrap();
        assert!(
            least < 1.0 + 1e-4 && (found[0] - 0.3).abs() < 1e-2 && (found[1] + 0.05).abs() < 1e-2,
            "{found:?}"
        );
        let (_, found) = simplex(&mut cost, begin, &[[0.1, 0.2]; 2], 160, 1e-7).unwrap();
        assert!(found[0] <= 0.2, "{found:?}");
        let mut count = 0;
        let mut cost = |n: &[f64]| {
            count += 1;
            Ok::<_, ()>((n[0] - 0.3).powi(2) + 1.0)
        };
        let (_, found) = simplex(&mut cost, (1.09, vec![0.0]), &[[0.05, 1.0]], 12, 1e-4).unwrap();
        assert!((found[0] - 0.3).abs() < 0.05, "{found:?}");
        assert!(count <= 13, "{count}");
    }
}
