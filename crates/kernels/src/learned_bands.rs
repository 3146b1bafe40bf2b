use super::shared::*;
use super::{Call, Cells, Real};

/// Light of each pair, less its background, in samples along the path, times the cube of the path; in five bands.
pub fn learned_bands<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: scan f, pairs v4, counts f, bands v4, broad f);
    let bins = call.learned().inputs as usize;
    let [start, width, step] = [SCAN_START, SCAN_WIDTH, SCAN_STEP].map(|i| scan[i as usize].wide());
    let (samples, reach) = (LEARNED_SAMPLES as usize, LEARNED_TAPS as usize);
    for pair in 0..pairs.len() / 2 {
        let background = pairs[2 * pair][3].wide();
        let light = |sample: usize| -> f64 {
            let path = sample as f64 * step;
            let ends = [path - 0.5 * step, path + 0.5 * step].map(|p| (p - start) / width);
            let share = |bin: usize| (ends[1].min(bin as f64 + 1.0) - ends[0].max(bin as f64)).max(0.0);
            let value = |bin: usize| share(bin) * (counts[pair * bins + bin].wide() - background);
            (0..bins).map(value).sum::<f64>() * path.powi(3)
        };
        let all: Vec<f64> = (0..samples).map(light).collect();
        for i in 0..samples {
            let of_band = |band: usize| -> F {
                let taps = &scan[SCAN_TAPS as usize + band * (2 * reach + 1)..][..2 * reach + 1];
                let at = |k: usize| (i + reach).checked_sub(k).and_then(|at| all.get(at)).unwrap_or(&0.0);
                F::of(taps.iter().enumerate().map(|(k, tap)| tap.wide() * at(k)).sum())
            };
            bands[pair * samples + i] = std::array::from_fn(of_band);
            broad[pair * samples + i] = of_band(4);
        }
    }
}
