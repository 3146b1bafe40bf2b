//! Fourier transforms of the closed-form methods.

use rayon::prelude::*;

pub use thirdbounce_fourier::{Complex, Line};

/// The complex number of length 1 at an angle, computed in float64: angles may be many turns.
pub fn turn(angle: f64) -> Complex {
    let (sin, cos) = angle.sin_cos();
    Complex::new(cos as f32, sin as f32)
}

/// The smallest number from `n` on that is a product of 2, 3 and 5: transforms of these lengths are fast.
pub fn fast_length(n: usize) -> usize {
    let is_fast = |n: &usize| {
        let mut rest = *n;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        rest == 1
    };
    (n.max(1)..).find(is_fast).unwrap_or(n)
}

/// Two arrays of a method that are overwritten by each volume, and kept: fresh pages take as long as a transform.
#[derive(Default)]
pub struct SpareSpectra(pub [Vec<Complex>; 2]);

/// Gives an array whose content does not matter this length.
pub fn resize(array: &mut Vec<Complex>, length: usize) {
    if array.len() != length {
        array.clear();
        array.par_extend(rayon::iter::repeat_n(Complex::default(), length));
    }
}

/// Transforms of planes `[x * n[1] + y]`. A spectrum lies the other way round: `[ky * n[0] + kx]`.
pub struct Planes {
    n: [usize; 2],
    along: [Line; 2],
}

/// Memory that transforms of planes need beside the plane itself.
#[derive(Default)]
pub struct Spare {
    plane: Vec<Complex>,
    line: Vec<Complex>,
}

impl Planes {
    /// Forward transforms of planes of `n[0]` × `n[1]`.
    pub fn forward(n: [usize; 2]) -> Planes {
        Planes { n, along: n.map(Line::forward) }
    }

    /// Backward transforms of their spectra.
    pub fn backward(n: [usize; 2]) -> Planes {
        Planes { n, along: n.map(Line::backward) }
    }

    /// The spectrum of a plane, in place. Only the first `rows` x differ from zero.
    pub fn spectrum(&self, plane: &mut [Complex], rows: usize, spare: &mut Spare) {
        let [nx, ny] = self.n;
        self.along[1].run(&mut plane[..rows * ny], &mut spare.line);
        spare.plane.resize(nx * ny, Complex::default());
        transpose_rows(&plane[..rows * ny], &mut spare.plane, [nx, ny], 0);
        self.along[0].run_into(&mut spare.plane, plane, &mut spare.line);
    }

    /// The plane of a spectrum, in place. Only the first `rows` x of it are needed; the others are not computed.
    pub fn plane(&self, spectrum: &mut [Complex], rows: usize, spare: &mut Spare) {
        let [nx, ny] = self.n;
        self.along[0].run(spectrum, &mut spare.line);
        let few = rows * ny;
        spare.plane.resize(nx * ny, Complex::default());
        transpose_rows(spectrum, &mut spare.plane[..few], [ny, nx], 0);
        self.along[1].run_into(&mut spare.plane[..few], &mut spectrum[..few], &mut spare.line);
    }
}

/// Places on a side of the blocks of a transposition, which fit the cache.
const BLOCK: usize = 16;

/// Writes `from`, `[a * n[1] + b]`, as `[b * n[0] + a]`, on all threads.
pub fn transpose<T: Copy + Default + Send + Sync>(from: &[T], to: &mut [T], n: [usize; 2]) {
    let rows = to.par_chunks_mut((BLOCK * n[0]).max(1));
    rows.enumerate().for_each(|(i, rows)| transpose_rows(from, rows, n, i * BLOCK));
}

/// Writes `rows` of the transposed array, the first of which is `first`. Beyond the end of `from` there is nothing.
fn transpose_rows<T: Copy + Default>(from: &[T], rows: &mut [T], [na, nb]: [usize; 2], first: usize) {
    let count = from.len() / nb;
    for (part, rows) in rows.chunks_mut(BLOCK * na).enumerate() {
        let first = first + part * BLOCK;
        for first_a in (0..count).step_by(BLOCK) {
            let end = (first_a + BLOCK).min(count);
            for (b, row) in (first..).zip(rows.chunks_exact_mut(na)) {
                let column = from[first_a * nb + b..].iter().step_by(nb);
                row[first_a..end].iter_mut().zip(column).for_each(|(to, from)| *to = *from);
            }
        }
        rows.chunks_exact_mut(na).for_each(|row| row[count..].fill(T::default()));
    }
}

/// The wave number of place `i` of a spectrum of `n` values that are `step` metres apart, radians per metre.
pub fn wave_number(i: usize, n: usize, step: f64) -> f64 {
    let signed = if 2 * i > n { i as f64 - n as f64 } else { i as f64 };
    std::f64::consts::TAU * signed / (n as f64 * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spectrum_is_the_sum_by_definition_and_comes_back() {
        let n = [6, 5];
        let plane: Vec<Complex> =
            (0..30).map(|i| if i < 15 { turn(0.3 * (i * i) as f64) } else { Complex::default() }).collect();
        let mut spectrum = plane.clone();
        let mut spare = Spare::default();
        Planes::forward(n).spectrum(&mut spectrum, 3, &mut spare);
        for kx in 0..6 {
            for ky in 0..5 {
                let term = |i: usize| {
                    let angle = (kx * (i / 5)) as f64 / 6.0 + (ky * (i % 5)) as f64 / 5.0;
                    plane[i] * turn(-std::f64::consts::TAU * angle)
                };
                let sum: Complex = (0..30).map(term).sum();
                assert!((sum - spectrum[ky * 6 + kx]).norm() < 1e-5, "{kx} {ky}");
            }
        }
        Planes::backward(n).plane(&mut spectrum, 3, &mut spare);
        for i in 0..15 {
            assert!((spectrum[i] / 30.0 - plane[i]).norm() < 1e-6);
        }
    }

    #[test]
    fn fast_lengths_have_small_factors() {
        assert_eq!([1, 7, 11, 121, 128].map(fast_length), [1, 8, 12, 125, 128]);
    }

    #[test]
    fn wave_numbers_are_those_of_the_signed_frequency() {
        let of = |i| wave_number(i, 8, 0.5) * 4.0 / std::f64::consts::TAU;
        assert_eq!([0, 1, 4, 5, 7].map(of), [0.0, 1.0, 4.0, -3.0, -1.0]);
    }
}
