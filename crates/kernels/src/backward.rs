use super::gather::gather;
use super::light::PLAIN;
use super::shared::*;
use super::{Call, Cells, Real, V3, watch};

/// The gradient of the paper's solver by the raw variables at every sample; before the last pairs, by albedo and by
/// albedo times normal.
pub fn backward<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, points v4, _3 any, _4 any, gradient v4, normals v4; wall f, residual f);
    let active = counts[COUNT_ACTIVE as usize] as usize;
    let samples = [&points[..active], normals.get(..active).unwrap_or_default()];
    let gradient = &mut gradient[..active];
    with_arithmetic!(call, F, gathered(call, samples, [wall, residual], gradient));
    if call.push.flags & BACKWARD_FINISH != 0 {
        for (i, g) in gradient.iter_mut().enumerate() {
            let level = [F::zero(), F::zero(), -F::one(), F::one()];
            *g = through_surface(*g, points[i][3], samples[1].get(i).copied().unwrap_or(level), call);
        }
        watch(counts, FAULT_BACKWARD, gradient.as_flattened());
    }
}

fn gathered<F: Real, A: Real>(
    call: &Call<'_>,
    samples: [&[[F; 4]]; 2],
    tables: [&[F]; 2],
    gradient: &mut [[F; 4]],
) {
    gather::<F, A>(call, call.is("EXACT"), samples, tables, gradient, |cosines, block, sums, j| {
        let [x, y, z] = sums.vector.map(|part| part[j]);
        // Values are homogeneous in the vector, whose slope then has them along the normal.
        let [nx, ny, nz] = block.normal.map(|part| part[j]);
        [if cosines == PLAIN { sums.albedo[j] } else { nx * x + ny * y + nz * z }, x, y, z]
    });
}

/// From the gradient by albedo and by albedo times normal to that by the raw variables: the chain rule through ELU, tanh and
/// the normalization.
fn through_surface<F: Real>([by_albedo, x, y, z]: [F; 4], albedo: F, own: [F; 4], call: &Call<'_>) -> [F; 4] {
    let (normal, length, by_normal) = (V3::of(own), own[3], V3 { x, y, z });
    let sign = if albedo == F::zero() { F::zero() } else { albedo.signum() };
    let l1 = F::from32(call.paper.l1_scale) * sign;
    let elu = if albedo > F::zero() { F::one() } else { albedo + F::one() };
    let tanh = normal * length + V3 { x: F::zero(), y: F::zero(), z: F::one() };
    let across = (by_normal - normal * normal.dot(by_normal)) * (albedo / length);
    let own = across.times(tanh.map(|t| (F::one() - t * t).at_least(F::zero())));
    own.with_first((by_albedo + l1) * elu)
}
