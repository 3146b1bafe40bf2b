//! Adam's bias corrections, for kernels. The host computes them: near 1 a device's `pow` may lose what is left of
//! 1 - beta^age after the subtraction.

use thirdbounce_kernels::unbias;

use crate::transport::kernels::Push;

/// `push` with the corrections after `age` steps since the moments were zero, from 1. `betas`: decays of the two moments.
pub(crate) fn unbiased(push: Push, betas: [f64; 2], age: u32) -> Push {
    let [unbias_first, unbias_second] = betas.map(|beta| unbias(beta, age) as f32);
    Push { unbias_first, unbias_second, ..push }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_a_constant_are_the_constant() {
        for beta in [0.9, 0.999, 0.999_99] {
            let (mut moment, decay) = (0.0f64, f64::from(beta as f32));
            for age in 1..=2000 {
                moment = decay * moment + (1.0 - decay) * 3.0;
                let push = unbiased(Push::default(), [beta, 0.5], age);
                let error = moment * f64::from(push.unbias_first) - 3.0;
                assert!(error.abs() < 1e-6, "{beta}, {age}: {error}");
            }
        }
    }
}
