//! The convolution with the kernel by Fourier transforms of rustfft.
//!
//! Columns are real along z, so two of them share a complex transform, and half of the frequencies suffice. Each frequency
//! is a plane of its own: only that plane is padded along x and y.

use rayon::prelude::*;

use super::super::fourier::{Complex, Line, Planes, Spare, transpose};
use super::gram::{self, SomePairs};
use crate::transport::Grid;

/// A convolution of volumes of one grid, `[(x * n[1] + y) * n[2] + z]`.
pub(super) struct Convolution {
    n: [usize; 3],
    lengths: [usize; 3],
    /// The kernel's spectrum, `[(kz * lengths[1] + ky) * lengths[0] + kx]`: real, as the kernel is the same on both sides.
    spectrum: Vec<f32>,
    /// The largest value of the spectrum: no volume grows by more.
    pub bound: f32,
    along: [Line; 2],
    planes: [Planes; 2],
}

impl Convolution {
    /// Bytes of a convolution on a grid: the kernel with its spectra while it is made, or the spectrum and what one
    /// convolution needs, whichever is more.
    pub fn bytes(grid: &Grid) -> u64 {
        let [lx, ly, lz] = gram::lengths(grid);
        let half = lz / 2 + 1;
        let making = lx * ly * (4 * grid.n[2] + 2 * 8 * half + 4 * half);
        let working = lx * ly * 4 * half + 2 * 8 * grid.n[0] * grid.n[1] * half;
        making.max(working) as u64
    }

    /// With the Gram operator's kernel on a grid. What is negative of its spectrum comes of the approximation, as the Gram
    /// operator has none: it becomes zero.
    pub fn gram(pairs: &SomePairs, grid: &Grid) -> Convolution {
        Convolution::with(&gram::kernel(pairs, grid), grid)
    }

    /// With a kernel as that of [`gram::kernel`].
    pub fn with(kernel: &[f32], grid: &Grid) -> Convolution {
        let (n, lengths) = (grid.n, gram::lengths(grid));
        let [lx, ly, lz] = lengths;
        let half = lz / 2 + 1;
        let along = [Line::forward(lz), Line::backward(lz)];
        let wide = [lx, ly];
        let planes = [Planes::forward(wide), Planes::backward(wide)];
        let mut of_columns = vec![Complex::default(); lx * ly * half];
        of_columns.par_chunks_mut(half).enumerate().for_each_init(Default::default, |s, (i, to)| {
            let (line, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
            let (x, y) = (i / ly, i % ly);
            let opposite = (lx - x) % lx * ly + (ly - y) % ly;
            line.clear();
            line.resize(lz, Complex::default());
            for z in 0..n[2] {
                line[z] = kernel[i * n[2] + z].into();
                if z > 0 {
                    line[lz - z] = kernel[opposite * n[2] + z].into();
                }
            }
            along[0].run(line, spare);
            to.copy_from_slice(&line[..half]);
        });
        let mut of_planes = vec![Complex::default(); lx * ly * half];
        transpose(&of_columns, &mut of_planes, [lx * ly, half]);
        drop(of_columns);
        let mut spectrum = vec![0.0; lx * ly * half];
        let both = spectrum.par_chunks_mut(lx * ly).zip(of_planes.par_chunks_mut(lx * ly));
        both.for_each_init(Spare::default, |spare, (to, plane)| {
            planes[0].spectrum(plane, lx, spare);
            to.iter_mut().zip(plane).for_each(|(t, v)| *t = v.re.max(0.0));
        });
        let bound = spectrum.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        Convolution { n, lengths, spectrum, bound, along, planes }
    }

    /// The convolution of a volume that is zero beyond its faces, within them.
    pub fn of(&self, volume: &[f32]) -> Vec<f32> {
        let ([nx, ny, nz], [lx, ly, lz]) = (self.n, self.lengths);
        let (columns, half) = (nx * ny, lz / 2 + 1);
        let mut by_column = self.along_columns(volume);
        let mut by_plane = vec![Complex::default(); columns * half];
        transpose(&by_column, &mut by_plane, [columns, half]);
        let planes = by_plane.par_chunks_mut(columns).zip(self.spectrum.par_chunks(lx * ly));
        planes.for_each_init(Default::default, |s, (narrow, kernel)| {
            let (wide, spare): &mut (Vec<Complex>, Spare) = s;
            wide.clear();
            wide.resize(lx * ly, Complex::default());
            for (row, from) in wide.chunks_mut(ly).zip(narrow.chunks(ny)) {
                row[..ny].copy_from_slice(from);
            }
            self.planes[0].spectrum(wide, nx, spare);
            wide.iter_mut().zip(kernel).for_each(|(v, k)| *v *= k);
            self.planes[1].plane(wide, nx, spare);
            for (row, to) in wide.chunks(ly).zip(narrow.chunks_mut(ny)) {
                to.copy_from_slice(&row[..ny]);
            }
        });
        transpose(&by_plane, &mut by_column, [half, columns]);
        drop(by_plane);
        let mut found = vec![0.0; volume.len()];
        let scale = 1.0 / (lx * ly * lz) as f32;
        let pairs = found.par_chunks_mut(2 * nz).zip(by_column.par_chunks(2 * half));
        pairs.for_each_init(Default::default, |s, (to, spectra)| {
            let (line, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
            join(spectra, half, line, lz);
            self.along[1].run(line, spare);
            let (one, other) = to.split_at_mut(nz);
            one.iter_mut().zip(&*line).for_each(|(t, v)| *t = scale * v.re);
            other.iter_mut().zip(&*line).for_each(|(t, v)| *t = scale * v.im);
        });
        found
    }

    /// The spectra of all columns along z, `[column * half + k]`.
    fn along_columns(&self, volume: &[f32]) -> Vec<Complex> {
        let (nz, lz) = (self.n[2], self.lengths[2]);
        let half = lz / 2 + 1;
        let mut spectra = vec![Complex::default(); self.n[0] * self.n[1] * half];
        let pairs = spectra.par_chunks_mut(2 * half).zip(volume.par_chunks(2 * nz));
        pairs.for_each_init(Default::default, |s, (to, from)| {
            let (line, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
            let (one, other) = from.split_at(nz);
            line.clear();
            line.extend(one.iter().map(|v| Complex::from(*v)));
            line.iter_mut().zip(other).for_each(|(t, v)| t.im = *v);
            line.resize(lz, Complex::default());
            self.along[0].run(line, spare);
            let (first, second) = to.split_at_mut(half);
            for (k, value) in first.iter_mut().enumerate() {
                *value = 0.5 * (line[k] + line[(lz - k) % lz].conj());
            }
            for (k, value) in second.iter_mut().enumerate() {
                let difference = 0.5 * (line[k] - line[(lz - k) % lz].conj());
                *value = Complex::new(difference.im, -difference.re);
            }
        });
        spectra
    }
}

/// The spectrum of a complex line whose parts are two real ones, of their halves of spectra. There may be one only.
fn join(spectra: &[Complex], half: usize, line: &mut Vec<Complex>, length: usize) {
    let (first, second) = spectra.split_at(half);
    line.clear();
    line.resize(length, Complex::default());
    let turned = |v: Complex| Complex::new(-v.im, v.re);
    for k in 0..half {
        let other = second.get(k).copied().unwrap_or_default();
        line[k] = first[k] + turned(other);
        if k > 0 && length - k >= half {
            line[length - k] = first[k].conj() + turned(other.conj());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Volume;
    use glam::dvec3;

    #[test]
    fn it_is_the_sum_by_definition() {
        let grid =
            Grid::new(Volume { min: dvec3(0.0, 0.0, 0.5), max: dvec3(0.3, 0.3, 0.74) }, 3, 0.06).unwrap();
        let ([nx, ny, nz], [lx, ly, _]) = (grid.n, gram::lengths(&grid));
        // The same at opposite offsets, and of a spectrum above zero: the offset (0, 0, 0) outweighs all others.
        let near = |x: isize, y: isize, z: isize| {
            let side = if (z, x, y) < (0, 0, 0) { -1 } else { 1 };
            let number = (7 * x + 3 * y + 11 * z) * side;
            if (x, y, z) == (0, 0, 0) { 130.0 } else { (number as f64).sin() }
        };
        let mut kernel = vec![0.0f32; lx * ly * nz];
        for (i, value) in kernel.iter_mut().enumerate() {
            let signed =
                |v: usize, length: usize| if v < 3 { v as isize } else { v as isize - length as isize };
            let (x, y) = (signed(i / nz / ly, lx), signed(i / nz % ly, ly));
            if x > -3 && y > -3 {
                *value = near(x, y, (i % nz) as isize) as f32;
            }
        }
        let volume: Vec<f32> = (0..grid.voxels()).map(|i| ((i * i) as f32).cos()).collect();
        let found = Convolution::with(&kernel, &grid).of(&volume);
        let place = |i: usize| [i / (ny * nz), i / nz % ny, i % nz].map(|v| v as isize);
        for (i, value) in found.iter().enumerate() {
            let sum: f64 = (0..nx * ny * nz)
                .map(|j| {
                    let (a, b) = (place(i), place(j));
                    near(a[0] - b[0], a[1] - b[1], a[2] - b[2]) * f64::from(volume[j])
                })
                .sum();
            assert!((f64::from(*value) - sum).abs() < 1e-3, "{i}: {value}, {sum}");
        }
    }
}
