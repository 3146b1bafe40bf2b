use super::gather::gather;
use super::light::PLAIN;
use super::shared::*;
use super::{Call, Cells, Real, watch};

/// The gradient at points of the surface: by the vector (albedo times normal) and by the depth; without normals by the
/// albedo and by the depth.
pub fn surface_gather<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, points v4, normals v4, _4 any, _5 any, gradient v4; wall f, residual f);
    let active = counts[COUNT_ACTIVE as usize] as usize;
    let samples = [&points[..active], normals.get(..active).unwrap_or_default()];
    let gradient = &mut gradient[..active];
    with_arithmetic!(call, F, gathered(call, samples, [wall, residual], gradient));
    watch(counts, FAULT_BACKWARD, gradient.as_flattened());
}

fn gathered<F: Real, A: Real>(
    call: &Call<'_>,
    samples: [&[[F; 4]]; 2],
    tables: [&[F]; 2],
    gradient: &mut [[F; 4]],
) {
    gather::<F, A>(call, true, samples, tables, gradient, |cosines, block, sums, j| {
        let depth = block.albedo[j] * sums.depth[j];
        let [x, y, z] = sums.vector.map(|part| part[j]);
        if cosines == PLAIN { [sums.albedo[j], depth, A::zero(), A::zero()] } else { [x, y, z, depth] }
    });
}
