//! Fourier transforms by rustfft. A crate of its own: its generic transforms are compiled here, and not at every change of the library.

#![deny(missing_docs)]

use std::sync::Arc;

use rustfft::{Fft, FftDirection, FftPlanner};

/// A complex number.
pub type Complex = rustfft::num_complex::Complex32;

/// A complex number in float64.
pub type Wide = rustfft::num_complex::Complex64;

/// Transforms of one length, forward or backward, not scaled.
pub struct Line(Arc<dyn Fft<f32>>);

impl Line {
    /// Forward transforms: multiplied by exp(-iωt).
    pub fn forward(length: usize) -> Line {
        Line(FftPlanner::new().plan_fft(length, FftDirection::Forward))
    }

    /// Backward transforms: multiplied by exp(iωt). Forward and then backward multiplies by the length.
    pub fn backward(length: usize) -> Line {
        Line(FftPlanner::new().plan_fft(length, FftDirection::Inverse))
    }

    /// Transforms `values`, one line after the other, in place.
    pub fn run(&self, values: &mut [Complex], spare: &mut Vec<Complex>) {
        spare.resize(self.0.get_inplace_scratch_len(), Complex::default());
        self.0.process_with_scratch(values, spare);
    }

    /// Writes the transforms of the lines of `from`, which it overwrites.
    pub fn run_into(&self, from: &mut [Complex], to: &mut [Complex], spare: &mut Vec<Complex>) {
        spare.resize(self.0.get_outofplace_scratch_len(), Complex::default());
        self.0.process_outofplace_with_scratch(from, to, spare);
    }
}
