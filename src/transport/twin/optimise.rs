use glam::DVec3;

use super::{Raw, Twin, sample_point};
use crate::transport::Sampling;

/// One step of Adam on the touched voxels, with the gradient gathered from the samples around each.
///
/// `gradient` has an entry per active voxel; `raw`, `first` and `second` have one per storage index and change in
/// place.
#[allow(clippy::too_many_arguments)] // the kernel's bindings
pub fn update(
    twin: &Twin,
    iteration: u32,
    step: u32,
    active: &[u32],
    touched: &[u32],
    gradient: &[Raw],
    raw: &mut [Raw],
    first: &mut [Raw],
    second: &mut [Raw],
) {
    let mut sums = vec![[0.0; 4]; raw.len()];
    for (index, g) in active.iter().zip(gradient) {
        let at = sample_point(twin, *index, iteration);
        let c = DVec3::from_array(twin.grid.voxel(*index as usize).map(|c| c as f64));
        for step in 0..27 {
            let to = c + DVec3::from_array([step % 3, step / 3 % 3, step / 9].map(|s| f64::from(s) - 1.0));
            if twin.model.sampling == Sampling::Fixed && to != c {
                continue;
            }
            let near = (1.0 - (at - to).abs()).max(DVec3::ZERO);
            let weight = near.x * near.y * near.z;
            if weight > 0.0 && to.min_element() >= 0.0 {
                let v = to.to_array().map(|v| v as usize);
                if twin.grid.contains(v) {
                    for k in 0..4 {
                        sums[twin.grid.index(v)][k] += weight * g[k];
                    }
                }
            }
        }
    }
    let rate = learning_rate(twin, iteration);
    for index in touched {
        let i = *index as usize;
        for k in 0..4 {
            let mut state = [raw[i][k], first[i][k], second[i][k]];
            adam(twin, rate, step, sums[i][k], &mut state);
            [raw[i][k], first[i][k], second[i][k]] = state;
        }
    }
}

/// One step of Adam on the noise weights, from the residual that the volume's gradient uses. State is (weight, first
/// moment, second moment), one per bin or one per histogram.
pub fn noise(twin: &Twin, step: u32, residual: &[f64], state: &mut [[f64; 3]]) {
    let m = twin.model;
    let per_histogram = state.len() != residual.len();
    let render = f64::from(m.scene(twin.grid).render_scale);
    for (i, s) in state.iter_mut().enumerate() {
        let of_sum: f64 =
            if per_histogram { residual[i * m.bins..(i + 1) * m.bins].iter().sum() } else { residual[i] };
        let sigmoid = 1.0 / (1.0 + (-s[0]).exp());
        adam(
            twin,
            m.learning_rate,
            step,
            of_sum / render * m.noise[1] * m.peak * sigmoid * (1.0 - sigmoid),
            s,
        );
    }
}

/// The volume's learning rate: constant, or half a cosine over the solve.
pub fn learning_rate(twin: &Twin, iteration: u32) -> f64 {
    let m = twin.model;
    let done = if m.decay_over > 0.0 { (f64::from(iteration) / m.decay_over).min(1.0) } else { 0.0 };
    m.learning_rate * (0.5 + 0.5 * (std::f64::consts::PI * done).cos())
}

/// Adam: Kingma & Ba 2015, algorithm 1.
fn adam(twin: &Twin, rate: f64, step: u32, gradient: f64, [value, first, second]: &mut [f64; 3]) {
    let m = twin.model;
    let [b1, b2] = m.betas;
    *first = b1 * *first + (1.0 - b1) * gradient;
    *second = b2 * *second + (1.0 - b2) * gradient * gradient;
    let first_hat = *first / (1.0 - b1.powi(step as i32));
    let second_hat = *second / (1.0 - b2.powi(step as i32));
    *value -= rate * first_hat / (second_hat.sqrt() + m.epsilon);
}
