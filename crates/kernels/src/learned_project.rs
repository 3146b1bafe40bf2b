use super::shared::*;
use super::{Call, Cells, Real};

/// The bands of all pairs at the paths of the voxels, and the sums of their squares.
pub fn learned_project<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: scan f, pairs v4, bands v4, broad f, out f, moments v2);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let [step, pitch, near] = [SCAN_STEP, SCAN_PITCH, SCAN_NEAR].map(|i| scan[i as usize].wide());
    let group = 64 * LEARNED_RUN as usize;
    let groups = cells.div_ceil(group);
    moments[..groups * LEARNED_BANDS as usize].fill([F::zero(); 2]);
    let samples = LEARNED_SAMPLES as usize;
    for cell in 0..cells {
        let [x, y, z] = call.learned_cell(cell).map(|i| (i as f64 + 0.5) * pitch);
        let at = [x - 0.5, y - 0.5, z + near];
        let mut sums = [0.0; LEARNED_BANDS as usize];
        for (pair, ends) in pairs.chunks(2).enumerate().take(layer.inputs as usize) {
            let to = |end: &[F; 4]| (0..3).map(|k| (at[k] - end[k].wide()).powi(2)).sum::<f64>().sqrt();
            let path = (to(&ends[0]) + to(&ends[1])) / step;
            let (i, share) = (path as usize, path.fract());
            if i + 1 >= samples {
                continue;
            }
            for (band, sum) in sums.iter_mut().enumerate() {
                let of = |i: usize| bands[pair * samples + i].get(band).unwrap_or(&broad[pair * samples + i]).wide();
                *sum += (1.0 - share) * of(i) + share * of(i + 1);
            }
        }
        for (band, sum) in sums.iter().enumerate() {
            out[band * cells + cell] = F::of(*sum);
            let squares = &mut moments[band * groups + cell / group][1];
            *squares = *squares + F::of(sum * sum);
        }
    }
}
