//! Dispatch by dispatch: a device beside the reference.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::Compared;
use super::device::{decode, perform, read_words, write};
use super::host::Host;
use crate::Sample;
use thirdbounce::Result;
use thirdbounce::engine::{OnDevice, Plan};
use thirdbounce::gpu::{Buffer, Command, Schedule};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Model, Reflectance};
use thirdbounce_kernels::Cells;

/// A job, and what was compared so far.
pub struct ComparedSteps {
    pub job: OnDevice,
    pub compared: Vec<Compared>,
    /// The largest error of the case.
    pub allowed: f64,
}

impl ComparedSteps {
    /// Runs what `write` adds to a schedule, and compares every dispatch.
    pub fn run(&mut self, write: impl FnOnce(&mut Schedule, &Plan)) -> Result<()> {
        let plan = self.job.plan.clone();
        for command in Schedule::of(|s| write(s, &plan)).commands {
            let is_dispatch = matches!(command, Command::Dispatch { .. });
            let mut host = Host::default();
            let done = is_dispatch.then(|| host.dispatch(&mut self.job, &command)).transpose()?;
            perform(&mut self.job, &Schedule { commands: vec![command] })?;
            for buffer in done.iter().flat_map(|(_, writes)| writes) {
                let module = done.as_ref().map_or("", |(code, _)| code.name);
                let want = host.get(&mut self.job, *buffer)?.clone();
                let compared = compare(&mut self.job, module, *buffer, &want, self.allowed)?;
                self.compared.push(compared);
            }
            match done {
                Some((code, _)) if code.name == "sample" || code.name == "surface_points" => {
                    settle(&mut self.job)?
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Compares a buffer of the device with the reference's.
pub fn compare(
    job: &mut OnDevice,
    module: &'static str,
    buffer: Buffer,
    want: &Cells<f64>,
    allowed: f64,
) -> Result<Compared> {
    let words = read_words(job, buffer)?;
    let mut hasher = DefaultHasher::new();
    words.hash(&mut hasher);
    let got = decode(job, buffer, words)?;
    let stride = job.model.stride();
    // Rendering may add to the padding of rows, which nothing reads; other passes leave it at zero.
    let rows =
        ["forward", "filter", "pulse", "residual", "spot"].iter().position(|name| module.starts_with(name));
    let is_padding =
        |i: usize| rows.is_some() && buffer != buffer::LOSS_PARTIALS && i % stride < PADDING as usize;
    let error = match (&got, want) {
        (Cells::Words(got), Cells::Words(want)) => {
            let differs = |(i, (g, w)): (usize, (&u32, &u32))| match g == w {
                true => 0.0,
                false if is_float(buffer, i) => {
                    let [g, w] = [g, w].map(|bits| f64::from(f32::from_bits(*bits)));
                    if (g - w).is_finite() { (g - w).abs() / w.abs().max(1e-30) } else { f64::INFINITY }
                }
                false => f64::INFINITY,
            };
            got.iter().zip(want).enumerate().map(differs).fold(0.0, f64::max)
        }
        (Cells::Floats(got), Cells::Floats(want)) => {
            let parts = parts_of(buffer);
            let of_part = |part: usize| {
                let at = |i: &usize| want[*i] != Cells::<f64>::ANY && (rows != Some(0) || !is_padding(*i));
                let all: Vec<usize> = (part..want.len()).step_by(parts).filter(at).collect();
                let largest = all.iter().map(|i| want[*i].abs()).fold(1e-300, f64::max);
                let differs = |i: &usize| match (got[*i] - want[*i]).abs() {
                    // Uninitialised memory.
                    _ if got[*i].is_nan() && want[*i].is_nan() => 0.0,
                    off if is_padding(*i) && off != 0.0 => f64::INFINITY,
                    off if off.is_finite() => off / largest,
                    _ => f64::INFINITY,
                };
                all.iter().map(differs).fold(0.0, f64::max)
            };
            (0..parts).map(of_part).fold(0.0, f64::max)
        }
        _ => f64::INFINITY,
    };
    // The filter takes much off the losses of a row.
    let is_filtered = ["residual_rows", "residual_scan"].iter().any(|name| module.starts_with(name))
        && buffer == buffer::LOSS_PARTIALS;
    let allowed = if is_filtered { allowed.max(1e-4) } else { allowed };
    Ok(Compared { module, buffer, error, allowed, bits: hasher.finish() })
}

/// Whether a word is a float.
fn is_float(buffer: Buffer, word: usize) -> bool {
    let of = |all: &[u32], length: u32| all.contains(&(word as u32 % length));
    match buffer {
        buffer::COUNTS => of(&[COUNT_PEAK_ALBEDO, COUNT_PEAK_SMOOTH, COUNT_LEAST_SMOOTH], COUNTS),
        buffer::TRACE => of(&[TRACE_DATA, TRACE_L1, TRACE_PEAK, TRACE_OBJECTIVE, TRACE_LEAST], TRACE_ROW),
        _ => false,
    }
}

/// Numbers of an element of a buffer: each has a unit of its own.
fn parts_of(buffer: Buffer) -> usize {
    match buffer {
        buffer::SURFACE_WEIGHTS => SURFACE_WEIGHTS as usize,
        buffer::COLUMNS => 8,
        buffer::NOISE_STATE => 3,
        buffer::SAMPLE_POINTS
        | buffer::SAMPLE_NORMALS
        | buffer::GRADIENT
        | buffer::HEIGHT_GRADIENT
        | buffer::HEIGHT_PULL
        | buffer::HEIGHT_MOMENTS => 4,
        buffer::HEIGHTS | buffer::LOSS_PARTIALS | buffer::LEARNED_MOMENTS | buffer::LEARNED_SCALES => 2,
        _ => 1,
    }
}

/// Replaces samples for which fp32 and float64 may make another choice (a bin, a cosine above zero) by one for which they
/// do not.
fn settle(job: &mut OnDevice) -> Result<()> {
    let active = read_words(job, buffer::COUNTS)?[COUNT_ACTIVE as usize] as usize;
    let directed = job.model.reflectance.has_normals();
    let mut read = |buffer| -> Result<Vec<[f32; 4]>> {
        let words = read_words(job, buffer)?;
        Ok(words.as_chunks::<4>().0.iter().take(active).map(|v| v.map(f32::from_bits)).collect())
    };
    let mut points = read(buffer::SAMPLE_POINTS)?;
    let mut normals = if directed { read(buffer::SAMPLE_NORMALS)? } else { vec![] };
    let wide = |v: &[[f32; 4]]| v.iter().map(|v| v.map(f64::from)).collect::<Vec<_>>();
    let (p, n) = (wide(&points), wide(&normals));
    let clear: Vec<bool> =
        (0..active).map(|i| is_clear(&job.model, &Sample::at(&job.model, &p, &n, i))).collect();
    let Some(first) = clear.iter().position(|clear| *clear) else { return Ok(()) };
    for i in (0..active).filter(|i| !clear[*i]) {
        points[i] = points[first];
        if directed {
            normals[i] = normals[first];
        }
    }
    write(job, buffer::SAMPLE_POINTS, &points)?;
    write(job, buffer::SAMPLE_NORMALS, &normals)
}

/// Whether no path ends near the edge of a bin or its centre, and no cosine is near zero.
fn is_clear(model: &Model, s: &Sample) -> bool {
    let wall = model.rendered_wall();
    // In bins: what fp32 makes of a path of some metres.
    let margin = (1e-6 / model.bin_width).min(1e-4);
    (0..wall.pairs()).all(|pair| {
        let place = 2.0 * (wall.path(pair, s.point) - model.t_start) / model.bin_width;
        let cosines = wall.points_of(pair).map(|number| {
            let [point, normal] = wall.point(number);
            let toward = (point - s.point).normalize();
            match model.reflectance {
                Reflectance::Lambertian => s.normal.dot(toward).abs().min(normal.dot(toward).abs()),
                Reflectance::Cosine => s.normal.dot(toward).abs(),
                _ => 1.0,
            }
        });
        (place - place.round()).abs() > 2.0 * margin && cosines.iter().all(|c| *c > margin)
    })
}
