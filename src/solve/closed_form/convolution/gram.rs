//! The Gram operator as a convolution, and its inverse.

use rayon::prelude::*;

use super::Prior;
use crate::solve::closed_form::fourier::{Complex, Volumes, fast_length};

/// What is asked of an inverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Weight of |ρ|², in units of the Gram operator's mean eigenvalue.
    pub noise: f64,
    /// What is known beforehand.
    pub prior: Prior,
    /// Iterations with a prior.
    pub iterations: usize,
    /// Weight of the total variation, as a share of the largest back-projected value.
    pub variation: f64,
}

/// Weight of the splits of ADMM (the penalty of Boyd and others 2011), in units of the Gram operator's mean eigenvalue.
static PENALTY_: std::sync::LazyLock<f64> = std::sync::LazyLock::new(|| knob("T_PEN", 0.3));
pub fn knob(name: &str, usual: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(usual)
}

/// The Gram operator of a grid. Its mean eigenvalue is 1.
pub struct Gram {
    /// Voxels of the grid, and of the transform.
    n: [usize; 3],
    padded: [usize; 3],
    transform: Volumes,
    /// Its eigenvalues, in the order of [`Volumes::spectrum`].
    eigenvalues: Vec<f32>,
    /// What the kernel was divided by.
    scale: f32,
}

/// A volume of the padded grid and memory for its transform.
struct Work {
    values: Vec<Complex>,
    spare: Vec<Complex>,
}

impl Gram {
    /// The operator whose kernel is `of_point`, `[(x * n[1] + y) * n[2] + z]`: the back-projection of a point at voxel `middle`.
    /// A Gram operator is symmetric, so the mean of both sides of the kernel is taken, and what is beyond the grid on one side
    /// is left out. `None` if the point is not seen.
    pub fn new(n: [usize; 3], middle: [usize; 3], of_point: &[f32]) -> Option<Gram> {
        let at = |c: [usize; 3]| of_point[(c[0] * n[1] + c[1]) * n[2] + c[2]];
        let scale = at(middle);
        if !(scale.is_finite() && scale > 0.0) {
            return None;
        }
        let padded = padded(n);
        let transform = Volumes::new(padded);
        let mut work = Work::new(padded);
        let place = |axis: usize, offset: isize| (offset.rem_euclid(padded[axis] as isize)) as usize;
        for i in 0..of_point.len() {
            let c = [i / (n[1] * n[2]), i / n[2] % n[1], i % n[2]];
            let offset = [0, 1, 2].map(|a| c[a] as isize - middle[a] as isize);
            let mirrored = [0, 1, 2].map(|a| middle[a] as isize - offset[a]);
            if (0..3).all(|a| (0..n[a] as isize).contains(&mirrored[a])) {
                let value = 0.5 * (at(c) + at(mirrored.map(|m| m as usize))) / scale;
                let taper = [0, 1, 2]
                    .map(|a| (offset[a] as f64 / middle[a] as f64).abs().min(1.0))
                    .map(|r| (0.5 + 0.5 * (std::f64::consts::PI * r).cos()).powf(knob("T_TAPER", 0.0)))
                    .iter()
                    .product::<f64>() as f32;
                let value = value * taper;
                let [x, y, z] = [0, 1, 2].map(|a| place(a, offset[a]));
                work.values[(x * padded[1] + y) * padded[2] + z] = Complex::from(value);
            }
        }
        transform.spectrum(&mut work.values, &mut work.spare);
        // No Gram operator has negative ones; that of a part of its kernel has some.
        let eigenvalues = work.values.iter().map(|v| v.re.max(0.0)).collect();
        Some(Gram { n, padded, transform, eigenvalues, scale })
    }

    /// Bytes of the arrays that [`Gram::solve`] holds at once.
    pub fn bytes(n: [usize; 3], wanted: Wanted) -> u64 {
        let [all, own]: [u64; 2] = [padded(n), n].map(|n| n.iter().product::<usize>() as u64);
        let of_prior = match wanted.prior {
            Prior::None => 0,
            Prior::Positive => 2,
            Prior::Tv => 8,
        };
        all * (16 + 4 + 4 * of_prior) + own * 8
    }

    /// The albedo whose Gram image is nearest to a back-projection `[(x * n[1] + y) * n[2] + z]`.
    pub fn solve(&self, projected: &[f32], wanted: Wanted) -> Vec<f32> {
        let mut right = vec![0.0f32; self.padded.iter().product()];
        let [_, py, pz] = self.padded;
        for (i, value) in projected.iter().enumerate() {
            let [x, y, z] = [i / (self.n[1] * self.n[2]), i / self.n[2] % self.n[1], i % self.n[2]];
            let share = knob("T_EDGE", 0.0);
            let edge: f64 = [x, y, z]
                .iter()
                .zip(self.n)
                .map(|(i, n)| {
                    let d = (*i as f64 + 0.5).min(n as f64 - 0.5 - *i as f64) / (share * n as f64);
                    if share > 0.0 && d < 1.0 { 0.5 - 0.5 * (std::f64::consts::PI * d).cos() } else { 1.0 }
                })
                .product();
            right[(x * py + y) * pz + z] = value * edge as f32 / self.scale;
        }
        let mut work = Work::new(self.padded);
        let all = match wanted.prior {
            Prior::None => self.inverse(&mut work, &right, wanted.noise, [0.0; 2]),
            Prior::Positive => self.positive(&mut work, &right, wanted),
            Prior::Tv => self.of_small_variation(&mut work, &right, wanted),
        };
        let voxel = |i: usize| {
            let [x, y, z] = [i / (self.n[1] * self.n[2]), i / self.n[2] % self.n[1], i % self.n[2]];
            all[(x * py + y) * pz + z]
        };
        (0..projected.len()).map(voxel).collect()
    }

    /// Solves (G + noise + split + of_slopes DᵀD) ρ = right, with the differences D of neighbours.
    fn inverse(&self, work: &mut Work, right: &[f32], noise: f64, [split, of_slopes]: [f64; 2]) -> Vec<f32> {
        let Work { values, spare } = work;
        values.par_iter_mut().zip(right).for_each(|(v, r)| *v = Complex::from(*r));
        self.transform.spectrum(values, spare);
        let [px, py, pz] = self.padded;
        let bend = |i: usize, n: usize| 2.0 - 2.0 * (std::f64::consts::TAU * i as f64 / n as f64).cos();
        let bends = self.padded.map(|n| (0..n).map(|i| bend(i, n)).collect::<Vec<f64>>());
        let scale = 1.0 / (px * py * pz) as f64;
        let rows = values.par_chunks_mut(px).zip(self.eigenvalues.par_chunks(px)).enumerate();
        rows.for_each(|(row, (values, eigenvalues))| {
            let across = bends[1][row / pz] + bends[2][row % pz];
            for ((value, g), of_x) in values.iter_mut().zip(eigenvalues).zip(&bends[0]) {
                let all = f64::from(*g) + noise + split + of_slopes * (across + of_x);
                *value *= (scale / all) as f32;
            }
        });
        self.transform.volume(values, spare);
        values.par_iter().map(|v| v.re).collect()
    }

    /// The minimum over albedos that are not negative, and zero beyond the grid.
    fn positive(&self, work: &mut Work, right: &[f32], wanted: Wanted) -> Vec<f32> {
        let mut kept = vec![0.0f32; right.len()];
        let mut dual = vec![0.0f32; right.len()];
        let mut asked = vec![0.0f32; right.len()];
        for _ in 0..wanted.iterations {
            let of = |((r, k), d): ((&f32, &f32), &f32)| r + *PENALTY_ as f32 * (k - d);
            asked
                .par_iter_mut()
                .zip(right.par_iter().zip(&kept).zip(&dual))
                .for_each(|(a, all)| *a = of(all));
            let found = self.inverse(work, &asked, wanted.noise, [*PENALTY_, 0.0]);
            self.keep_positive(&found, &mut kept, &mut dual);
        }
        kept
    }

    /// The part of ADMM that keeps albedos that are not negative, and lie within the grid.
    fn keep_positive(&self, found: &[f32], kept: &mut [f32], dual: &mut [f32]) {
        let [_, py, pz] = self.padded;
        let [nx, ny, nz] = self.n;
        let slabs =
            kept.par_chunks_mut(pz).zip(dual.par_chunks_mut(pz)).zip(found.par_chunks(pz)).enumerate();
        slabs.for_each(|(column, ((kept, dual), found))| {
            let inside = column / py < nx && column % py < ny;
            for (z, ((k, d), f)) in kept.iter_mut().zip(dual).zip(found).enumerate() {
                *k = if inside && z < nz { (f + *d).max(0.0) } else { 0.0 };
                *d += f - *k;
            }
        });
    }

    /// The same with a small total variation: isotropic, over neighbours along the three axes.
    fn of_small_variation(&self, work: &mut Work, right: &[f32], wanted: Wanted) -> Vec<f32> {
        let count = right.len();
        let most = right.iter().copied().fold(0.0, f32::max);
        let least = (wanted.variation / *PENALTY_) as f32 * most;
        let (mut kept, mut dual) = (vec![0.0f32; count], vec![0.0f32; count]);
        let (mut slopes, mut slope_duals) = (vec![[0.0f32; 3]; count], vec![[0.0f32; 3]; count]);
        for _ in 0..wanted.iterations {
            let wanted_slope = |i: usize, axis: usize| slopes[i][axis] - slope_duals[i][axis];
            let asked: Vec<f32> = (0..count)
                .into_par_iter()
                .map(|i| {
                    let fall =
                        |axis: usize| wanted_slope(self.beside(i, axis, false), axis) - wanted_slope(i, axis);
                    right[i] + *PENALTY_ as f32 * (kept[i] - dual[i] + fall(0) + fall(1) + fall(2))
                })
                .collect();
            let found = self.inverse(work, &asked, wanted.noise, [*PENALTY_; 2]);
            self.keep_positive(&found, &mut kept, &mut dual);
            let both = slopes.par_iter_mut().zip(&mut slope_duals).enumerate();
            both.for_each(|(i, (slope, dual))| {
                let rise = [0, 1, 2].map(|axis| found[self.beside(i, axis, true)] - found[i]);
                let sum = [0, 1, 2].map(|axis| rise[axis] + dual[axis]);
                let length = sum.iter().map(|v| v * v).sum::<f32>().sqrt();
                let share = if length > least { 1.0 - least / length } else { 0.0 };
                *slope = sum.map(|v| share * v);
                *dual = [0, 1, 2].map(|axis| sum[axis] - slope[axis]);
            });
        }
        kept
    }

    /// The next place along an axis, or the one before; the padded grid is periodic.
    fn beside(&self, i: usize, axis: usize, next: bool) -> usize {
        let [_, py, pz] = self.padded;
        let stride = [py * pz, pz, 1][axis];
        let (at, n) = (i / stride % self.padded[axis], self.padded[axis]);
        match next {
            true if at + 1 == n => i - at * stride,
            true => i + stride,
            false if at == 0 => i + (n - 1) * stride,
            false => i - stride,
        }
    }
}

impl Work {
    fn new(padded: [usize; 3]) -> Work {
        let count = padded.iter().product();
        Work { values: vec![Complex::default(); count], spare: vec![Complex::default(); count] }
    }
}

/// The kernel reaches half of the grid, and must not come back on the other side.
fn padded(n: [usize; 3]) -> [usize; 3] {
    n.map(|n| fast_length(n + n / 2))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};

    use super::*;

    /// The operator by definition, in float64: a confocal scan of small elements that face the wall. Rows are voxels, columns
    /// what pairs and bins see of them, weighted by the root of the inverse falloff.
    struct Dense {
        n: [usize; 3],
        rows: Vec<Vec<f64>>,
    }

    impl Dense {
        fn new() -> Dense {
            let n = [7, 7, 5];
            let (points, bins, bin) = (12, 40, 0.02);
            let at = |i: usize| {
                dvec3(
                    0.1 * (i / 35) as f64 - 0.3,
                    0.1 * (i / 5 % 7) as f64 - 0.3,
                    0.6 + 0.05 * (i % 5) as f64,
                )
            };
            let row = |p: DVec3| {
                let mut row = vec![0.0; points * points * bins];
                for (pair, seen) in row.chunks_mut(bins).enumerate() {
                    let wall = |i: usize| (i as f64 + 0.5) / points as f64 * 1.4 - 0.7;
                    let d = p.distance(dvec3(wall(pair / points), wall(pair % points), 0.0));
                    let place = (2.0 * d - 1.1) / bin - 0.5;
                    let (low, share) = (place as usize, place.fract());
                    for (bin, weight) in [(low, 1.0 - share), (low + 1, share)] {
                        if bin < bins {
                            seen[bin] = p.z / d * weight;
                        }
                    }
                }
                row
            };
            Dense { n, rows: (0..245).map(|i| row(at(i))).collect() }
        }

        fn gram(&self) -> Vec<Vec<f64>> {
            let dot = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| a * b).sum();
            self.rows.iter().map(|a| self.rows.iter().map(|b| dot(a, b)).collect()).collect()
        }
    }

    /// Solves a system by elimination.
    fn solved(mut rows: Vec<Vec<f64>>, right: &[f64]) -> Vec<f64> {
        let n = rows.len();
        rows.iter_mut().zip(right).for_each(|(row, r)| row.push(*r));
        for i in 0..n {
            let pivot = rows[i].clone();
            for (_, row) in rows.iter_mut().enumerate().filter(|(j, _)| *j != i) {
                let share = row[i] / pivot[i];
                row[i..].iter_mut().zip(&pivot[i..]).for_each(|(v, p)| *v -= share * p);
            }
        }
        (0..n).map(|i| rows[i][n] / rows[i][i]).collect()
    }

    fn wanted(prior: Prior) -> Wanted {
        Wanted { noise: 0.2, prior, iterations: 300, variation: 0.01 }
    }

    fn apart(found: &[f32], wanted: &[f64]) -> f64 {
        let off: f64 = found.iter().zip(wanted).map(|(f, w)| (f64::from(*f) - w).powi(2)).sum();
        (off / wanted.iter().map(|w| w * w).sum::<f64>()).sqrt()
    }

    /// The convolution as a matrix over the padded grid.
    fn matrix(gram: &Gram) -> Vec<Vec<f64>> {
        let count: usize = gram.padded.iter().product();
        let mut work = Work::new(gram.padded);
        let column = |i: usize| {
            let mut point = vec![0.0f32; count];
            point[i] = 1.0;
            work.values.iter_mut().zip(&point).for_each(|(v, p)| *v = Complex::from(*p));
            gram.transform.spectrum(&mut work.values, &mut work.spare);
            work.values.iter_mut().zip(&gram.eigenvalues).for_each(|(v, g)| *v *= *g / count as f32);
            gram.transform.volume(&mut work.values, &mut work.spare);
            work.values.iter().map(|v| f64::from(v.re)).collect()
        };
        (0..count).map(column).collect()
    }

    fn of_dense() -> (Dense, Vec<Vec<f64>>, Gram) {
        let dense = Dense::new();
        let rows = dense.gram();
        let middle = dense.n.map(|n| n / 2);
        let kernel: Vec<f32> = rows[(3 * 7 + 3) * 5 + 2].iter().map(|v| *v as f32).collect();
        let gram = Gram::new(dense.n, middle, &kernel).unwrap();
        (dense, rows, gram)
    }

    /// Two separate voxels and a pair, away from the rim.
    fn albedo() -> Vec<f64> {
        let mut albedo = vec![0.0; 245];
        for [x, y, z] in [[2, 2, 2], [4, 4, 1], [4, 5, 1], [2, 5, 3]] {
            albedo[(x * 7 + y) * 5 + z] = 1.0;
        }
        albedo
    }

    #[test]
    fn its_image_is_nearly_that_of_the_dense_operator() {
        let (dense, rows, gram) = of_dense();
        let times = |rows: &[Vec<f64>], v: &[f64]| -> Vec<f64> {
            rows.iter().map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum()).collect()
        };
        let image = times(&rows, &albedo());
        let scale = f64::from(gram.scale);
        let (all, [_, py, pz]) = (matrix(&gram), gram.padded);
        let place = |i: usize| (i / 35 * py + i / 5 % 7) * pz + i % 5;
        let mut wide = vec![0.0; all.len()];
        albedo().iter().enumerate().for_each(|(i, a)| wide[place(i)] = *a);
        let near = times(&all, &wide);
        let near: Vec<f32> = (0..245).map(|i| (scale * near[place(i)]) as f32).collect();
        let off = apart(&near, &image);
        assert!(off < 0.3, "{off}");
        // And so is its inverse: the voxels come back, the brightest of all.
        let image: Vec<f32> = image.iter().map(|v| *v as f32).collect();
        let mut regular = rows.clone();
        (0..245).for_each(|i| regular[i][i] += 0.2 * scale);
        let exact = solved(regular, &image.iter().map(|v| f64::from(*v)).collect::<Vec<_>>());
        let found = gram.solve(&image, wanted(Prior::None));
        let off = apart(&found, &exact);
        assert!(off < 0.6, "{off}");
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.sort_by(|a, b| found[*b].total_cmp(&found[*a]));
        assert!(order[..4].iter().all(|i| albedo()[*i] > 0.0), "{:?}", &order[..8]);
        assert_eq!(dense.n, gram.n);
    }

    #[test]
    fn without_a_prior_it_is_the_solution_of_the_system() {
        let (_, _, gram) = of_dense();
        let mut rows = matrix(&gram);
        (0..rows.len()).for_each(|i| rows[i][i] += 0.2);
        let projected: Vec<f32> = (0..245).map(|i| ((i * i) % 17) as f32).collect();
        let [_, py, pz] = gram.padded;
        let place = |i: usize| (i / 35 * py + i / 5 % 7) * pz + i % 5;
        let mut right = vec![0.0; rows.len()];
        (0..245).for_each(|i| right[place(i)] = f64::from(projected[i] / gram.scale));
        let all = solved(rows, &right);
        let exact: Vec<f64> = (0..245).map(|i| all[place(i)]).collect();
        let off = apart(&gram.solve(&projected, wanted(Prior::None)), &exact);
        assert!(off < 1e-3, "{off}");
    }

    /// What ADMM minimises, of a solution.
    fn objective(gram: &Gram, all: &[Vec<f64>], projected: &[f32], albedo: &[f32], variation: f64) -> f64 {
        let [px, py, pz] = gram.padded;
        let mut wide = vec![0.0; all.len()];
        let mut right = vec![0.0; all.len()];
        for i in 0..245 {
            let place = (i / 35 * py + i / 5 % 7) * pz + i % 5;
            wide[place] = f64::from(albedo[i]);
            right[place] = f64::from(projected[i] / gram.scale);
        }
        let most = right.iter().copied().fold(0.0, f64::max);
        let mut sum = 0.0;
        for (i, row) in all.iter().enumerate() {
            let image: f64 = row.iter().zip(&wide).map(|(a, b)| a * b).sum();
            sum += wide[i] * (0.5 * image + 0.1 * wide[i] - right[i]);
            let [x, y, z] = [i / (py * pz), i / pz % py, i % pz];
            let beside = [[(x + 1) % px, y, z], [x, (y + 1) % py, z], [x, y, (z + 1) % pz]];
            let rises = beside.map(|[x, y, z]| (wide[(x * py + y) * pz + z] - wide[i]).powi(2));
            sum += variation * most * rises.iter().sum::<f64>().sqrt();
        }
        sum
    }

    #[test]
    fn with_a_prior_nothing_near_is_better() {
        let (_, rows, gram) = of_dense();
        let albedo = albedo();
        let projected: Vec<f32> =
            rows.iter().map(|row| row.iter().zip(&albedo).map(|(a, b)| a * b).sum::<f64>() as f32).collect();
        let all = matrix(&gram);
        for (prior, variation) in [(Prior::Positive, 0.0), (Prior::Tv, 0.01)] {
            let found = gram.solve(&projected, wanted(prior));
            assert!(found.iter().all(|v| *v >= 0.0) && found.iter().any(|v| *v > 0.2));
            let least = objective(&gram, &all, &projected, &found, variation);
            let mut state = 7u32;
            let mut random = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / (1u32 << 24) as f32 - 0.5
            };
            for _ in 0..40 {
                let other: Vec<f32> = found.iter().map(|v| (v + 0.02 * random()).max(0.0)).collect();
                let more = objective(&gram, &all, &projected, &other, variation);
                assert!(more > least - 1e-4 * least.abs(), "{prior:?}: {more} {least}");
            }
            // Without the prior it is worse: negative values, made 0.
            let plain: Vec<f32> =
                gram.solve(&projected, wanted(Prior::None)).iter().map(|v| v.max(0.0)).collect();
            assert!(objective(&gram, &all, &projected, &plain, variation) > least + 1e-3 * least.abs());
        }
    }

    #[test]
    fn a_point_that_is_not_seen_gives_no_operator() {
        assert!(Gram::new([2, 2, 2], [1, 1, 1], &[0.0; 8]).is_none());
    }
}
