use super::Real;
use super::shared::PaperData;

/// The factor that takes the bias off a moment `age` steps after it was zero. Kernels decay moments by the rounded `beta`.
pub fn unbias(beta: f64, age: u32) -> f64 {
    1.0 / (1.0 - f64::from(beta as f32).powf(age.into()))
}

/// A step of Adam: Kingma & Ba 2015, algorithm 1.
#[derive(Debug, Clone, Copy)]
pub struct Adam<F> {
    rate: F,
    betas: [F; 2],
    /// Factors that take the bias off the moments.
    unbias: [F; 2],
    epsilon: F,
}

impl<F: Real> Adam<F> {
    /// Step number `steps` since the moments were zero.
    pub fn of(paper: &PaperData, rate: f64, steps: u32) -> Adam<F> {
        let betas = [paper.beta1, paper.beta2];
        let unbias = betas.map(|beta| F::of(1.0 / (1.0 - f64::from(beta).powi(steps as i32))));
        Adam { rate: F::of(rate), betas: betas.map(F::from32), unbias, epsilon: F::from32(paper.epsilon) }
    }

    /// Moves a value and its moments.
    #[inline(always)]
    pub fn step(&self, gradient: F, [value, first, second]: [&mut F; 3]) {
        let [b1, b2] = self.betas;
        *first = b1 * *first + (F::one() - b1) * gradient;
        *second = b2 * *second + (F::one() - b2) * gradient * gradient;
        let [first, second] = [*first * self.unbias[0], *second * self.unbias[1]];
        *value = *value - self.rate * first / (second.sqrt() + self.epsilon);
    }
}
