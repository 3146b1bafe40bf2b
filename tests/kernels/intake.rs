//! The kernels that take counts from a caller's buffer, against the float64 twins.

use fixtures::device::surfaces::{Fit, read_floats};
use fixtures::device::*;
use glam::dvec3;
use thirdbounce::capture::Capture;
use thirdbounce::gpu::{Command, Gpu, Schedule};
use thirdbounce::solve::passes::TALLY;
use thirdbounce::solve::{Format, LentRows, OnDevice, intake, tally_of};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Grid, Model, Reflectance, Rows, twin};

/// Counts of 30 pairs: three for a bin but the last, which has two.
pub const ROWS: LentRows = LentRows { counts: 122, sum: 3 };
const BINS: usize = 41;

/// A plan for lent counts of 30 pairs with 41 bins, of which bins 3 to 36 are kept, in another order of pairs.
pub fn lending(gpu: &Gpu, grid: &Grid) -> (OnDevice, Rows) {
    let points: Vec<_> =
        (0..30).map(|i| dvec3(0.1 * f64::from(i % 6), 0.1 * f64::from(i / 6), 0.0)).collect();
    let scan = Capture::new([6, 5], points.clone(), points, BINS, 0.05, vec![]);
    let (mut model, mut rows): (Model, Rows) = Model::outline(&scan, Reflectance::Cosine, 1.0, false);
    rows.reorder(&(0..30).map(|i| i * 7 % 30).collect::<Vec<_>>());
    rows.crop(3..36);
    model.bins = 33;
    let job = job(gpu, &model, grid, &Fit { lent: Some(ROWS), ..Fit::of(grid, 1) });
    (job, rows)
}

/// Counts of the pairs as a buffer has them in this format, and the values of their bins.
pub fn counts(format: Format, random: &mut Random) -> (Vec<u32>, Vec<f64>) {
    let values: Vec<f64> = (0..30 * ROWS.counts).map(|_| random.uniform(0.0, 60_000.0).floor()).collect();
    let words: Vec<u32> = match format {
        Format::F32 => values.iter().map(|v| (*v as f32).to_bits()).collect(),
        Format::U32 => values.iter().map(|v| *v as u32).collect(),
        Format::U16 => values.chunks(2).map(|two| two[0] as u32 | (two[1] as u32) << 16).collect(),
    };
    assert_eq!(words.len() as u64 * 4, format.bytes_of(values.len()));
    let rows = values.chunks(ROWS.counts);
    (words, rows.flat_map(|row| row.chunks(ROWS.sum).map(|bins| bins.iter().sum::<f64>())).collect())
}

const FORMATS: [Format; 3] = [Format::F32, Format::U32, Format::U16];

#[test]
pub fn counts_are_summed_over_slices_of_pairs() {
    let gpu = gpu();
    let grid = grid();
    let (mut job, _) = lending(&gpu, &grid);
    let mut random = Random::new(3);
    for format in FORMATS {
        let (words, values) = counts(format, &mut random);
        write(&mut job, buffer::HISTOGRAMS, &words);
        // So few pairs are a slice each; the second part begins in the middle.
        let mut s = Schedule::of(|s| tally_of(s, buffer::HISTOGRAMS, ROWS, format, &[11, 30]));
        for of_slice in [1, 7] {
            job.perform(&s);
            let want = twin::tally(&values, BINS, of_slice);
            assert_eq!(want.len(), 30usize.div_ceil(of_slice) * BINS);
            let got: Vec<[f32; 4]> = job.executor.read(buffer::TALLY, ..want.len());
            let flat = got.as_flattened().iter().map(|v| f64::from(*v));
            assert!(error(flat, want.into_iter().flatten()) < 1e-6, "{format:?} {of_slice}");
            // Slices of several pairs: the last one is shorter.
            let Command::Dispatch { push, .. } = s.commands[0].clone() else { panic!("dispatches only") };
            let told: Push = bytemuck::cast(push);
            s = Schedule::default();
            s.dispatch(&TALLY, [1, 5, 1], 1).bind(buffer::SOURCE, buffer::HISTOGRAMS).with(Push {
                last: 30,
                step: 7,
                ..told
            });
        }
    }
    assert_valid(&gpu);
}

/// Writes which of a caller's rows are the model's.
pub fn write_rows_of(job: &mut OnDevice, rows: &Rows) {
    let words: Vec<u32> = [0, 0].into_iter().chain(rows.pairs().iter().map(|p| *p as u32)).collect();
    write(job, buffer::ROWS, &words);
}

#[test]
pub fn counts_become_the_measurement() {
    let gpu = gpu();
    let grid = grid();
    let (mut job, rows) = lending(&gpu, &grid);
    write_rows_of(&mut job, &rows);
    let mut random = Random::new(4);
    for format in FORMATS {
        let (words, values) = counts(format, &mut random);
        write(&mut job, buffer::HISTOGRAMS, &words);
        let how = [0.125, 300.0];
        let schedule = Schedule::of(|s| intake(s, &job.plan.clone(), &rows, ROWS, format, how));
        job.perform(&schedule);
        let want = twin::intake(&values, BINS, &rows, how);
        assert_eq!(want.len(), 30 * 33);
        assert!(error(read_floats(&mut job, buffer::MEASURED, want.len()), want) < 1e-6, "{format:?}");
    }
    assert_valid(&gpu);
}
