//! Proposals: laws with numbers to begin with, from one surface, before any fit judges them.

use std::borrow::Cow;
use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use super::correction::{LAWS, Law, Proposed, line_of, named};
use super::decide::{EvidenceGate, both};
use super::gains;
use super::job::Job;
use super::pulse::add_products;
use super::trial::{Fitted, From, OF_CHANGE, PAIRS, Proposal, Trial, Trials, TriedLaw};
use crate::Result;
use crate::capture::Capture;
use crate::closed_form::LctOptions;
use crate::engine::{Progress, Watch, pixel_of};
use crate::gpu::Gpu;
use crate::maps::Maps;
use crate::options::SceneTraits;
use crate::settings::DevicePosition;
use crate::surface::{HeldOut, Left};
use thirdbounce_base::quantile::peak_between;

/// Constants of the proposals. Evidence: benches/NOTES.md, "Causes" and "Verdict".
mod bounds {
    /// Share that is certainly left beyond noise from which delays of lines and motions, and light-cone transforms of other records and scales are looked at.
    pub const DOUBTFUL: [f64; 2] = [0.08, 0.15];
    /// Steps that are fitted first, those whose signs differ most by renderings: of 16 faulty captures one of them leaves .72 to .94 (the
    /// first of 11, the second of 4, the third of one).
    pub const FIRST: usize = 3;
    /// First steps of fits over those of continued surfaces.
    pub const LONGER: f64 = 2.4;
    /// Laws that resemble a scale and are minimised: those whose starts leave least, by at most this factor.
    pub const AS_SCALE: (usize, f64) = (2, 0.93);
    /// Share that is left by fits of a moved surface up to which the network looks at the capture.
    pub const NEARLY: f64 = 1.25;
    /// Longest delay of a line, as a share of the bins, and in bins of the fits; share of what is left that delays must explain.
    pub const FARTHEST: [usize; 2] = [8, 24];
    pub const WORTH: f64 = 0.2;
    /// Another scale or record is proposed if its image is this many times as sharp; none where the
    /// image is as sharp as this: of 13 scales and rolled records up to 4.9, of a proper measured capture 8.0.
    pub const SHARPER: f64 = 2.5;
    pub const SHARP: f64 = 7.0;
    /// Scales: feet, paths one way, half of a wall. Records: how many each way, and their step in walls.
    pub const SCALES: [f64; 3] = [0.3048, 0.5, 2.0];
    pub const RECORDS: (usize, f64) = (5, 0.3);
    /// Pixels of the images on a side, and points of the wall at most: four times fewer take a fourth of the seconds.
    pub const PIXELS: usize = 64;
    pub const POINTS: usize = 32;
    /// Of these parts of the lines, the first and the last one are fitted; lines of a part at least.
    pub const PARTS: usize = 3;
    pub const LINES: usize = 4;
    /// They leave these shares at most of what the ends of the other lines leave, by fits that go on from the surface of all, and by those
    /// from the start: where all fits of few pairs explain these better, nothing moved. And standard errors by which one of them leaves less.
    pub const ENDS: [f64; 2] = [0.9, 0.75];
    pub const ENDS_ERRORS: f64 = 4.0;
    /// Each end of a scan sees most of what is near it, which seems to be a motion along that: these parts of it are tried.
    pub const ALONG: [f64; 3] = [0.0, 0.5, 1.0];
    /// Both parts begin with one start, and keep something of it: the scene moved farther, by this factor.
    pub const FARTHER: f64 = 1.4;
}

/// What sums over bins, images and fits of the ends of a scan propose.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn closed_form(trials: &mut Trials<'_>) -> Result<Vec<Proposal>> {
    let certain = trials.base.left().certain();
    let [doubtful, very] = bounds::DOUBTFUL;
    if certain > doubtful
        && let Some(lines) = lines(trials)?
    {
        return Ok(vec![lines]);
    }
    let mut all: Vec<Proposal> = vec![];
    if trials.job.settings.device_at != Some(DevicePosition::None) {
        all.extend(gains::proposed(trials)?);
    }
    if all.is_empty() && certain > doubtful {
        all.extend(motion(trials)?);
    }
    if certain > very {
        all.extend(sharper(trials.job, trials.gpu));
    }
    Ok(all)
}

/// Delays of columns or rows, by the correlation of what is rendered and measured.
fn lines(trials: &Trials<'_>) -> Result<Option<Proposal>> {
    let Some(all) = trials.trial.all(&trials.base.surface.layers)? else { return Ok(None) };
    let left = all.left();
    let excess: f64 = left.pairs.iter().map(|p| p[0]).sum::<f64>() - left.noise;
    let laws = LAWS.iter().filter(|law| law.proposed == Proposed::ByCorrelation);
    let laws = laws.filter(|law| (law.applies)(&trials.scan));
    let each = laws.filter_map(|law| Some((law, correlated(law, &all, trials.scan.scan)?)));
    let best = each.max_by(|(_, a), (_, b)| a.1.total_cmp(&b.1));
    let best = best.filter(|(_, (_, gain))| *gain > bounds::WORTH * excess);
    Ok(best.map(|(law, (delays, _))| Proposal { law, starts: vec![delays], is_far: false }))
}

/// Delays of lines beyond those that are undone in a trial, with these.
///
/// # Errors
/// The device fails.
pub fn delays(undone: &Trial<'_>, tried: &TriedLaw, scan: [usize; 2]) -> Result<Option<Vec<f64>>> {
    let all = undone.all(&tried.fitted.surface.layers)?;
    let more = all.and_then(|all| correlated(tried.law, &all, scan));
    Ok(more.map(|(more, _)| tried.numbers.iter().zip(more).map(|(delay, more)| delay + more).collect()))
}

/// Of each line, metres of path by which the measured light is later than the rendered one, with their median at 0; and by how much the squares that are left fall.
fn correlated(law: &Law, held: &HeldOut, scan: [usize; 2]) -> Option<(Vec<f64>, f64)> {
    let axis = law.lines?;
    let (bins, count) = (held.bins(), scan[axis]);
    let farthest = (bins / bounds::FARTHEST[0]).min(bounds::FARTHEST[1]);
    let [rendered, measured] = held.sides();
    let mut rows: Vec<Vec<usize>> = vec![vec![]; count];
    held.pairs.iter().enumerate().for_each(|(row, pair)| rows[line_of(scan, axis, *pair)].push(row));
    if rows.iter().any(Vec::is_empty) {
        return None;
    }
    // By line and lag in bins: sums of rendered values times measured ones.
    let of_line = |rows: &Vec<usize>| -> Vec<f64> {
        let [mut early, mut late] = [vec![0.0; farthest + 1], vec![0.0; farthest + 1]];
        for row in rows {
            let [rendered, measured] = [&rendered, &measured].map(|all| &all[row * bins..(row + 1) * bins]);
            add_products(measured, rendered, 0, &mut early);
            add_products(rendered, measured, 0, &mut late);
        }
        early.into_iter().rev().chain(late.into_iter().skip(1)).collect()
    };
    let products: Vec<Vec<f64>> = rows.par_iter().map(of_line).collect();
    let best = |of: &Vec<f64>| {
        let at = (0..of.len()).max_by(|a, b| of[*a].total_cmp(&of[*b]).then(b.cmp(a))).unwrap_or(farthest);
        let beside = at.checked_sub(1).map(|i| of[i]).zip(of.get(at + 1));
        let part = beside.map_or(0.0, |(before, behind)| peak_between([before, of[at], *behind]));
        (at as f64 - farthest as f64 + part, of[at] - of[farthest])
    };
    let each: Vec<(f64, f64)> = products.iter().map(best).collect();
    let mut sorted: Vec<f64> = each.iter().map(|e| e.0).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted[count / 2];
    let delays = each.iter().map(|e| (e.0 - middle) * held.bin_width()).collect();
    Some((delays, 2.0 * each.iter().map(|e| e.1).sum::<f64>()))
}

/// Laws of which a step leaves less, by fits that continue the surface, the most promising one first.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn by_steps(trials: &mut Trials<'_>) -> Result<Vec<Proposal>> {
    let (trial, scan) = (trials.trial.clone(), trials.scan.clone());
    let (layers, step) = (trials.base.surface.layers.clone(), trials.base.surface.step);
    // Steps with the better of their signs, which renderings alone show, and standard errors of the difference between both.
    let mut tried = vec![];
    for law in LAWS {
        let Proposed::BySteps(steps) = law.proposed else { continue };
        for (at, [step, _]) in law.steps.iter().enumerate() {
            let [one, other] = [*step, -step]
                .map(|by| (0..law.steps.len()).map(|i| if i == at { by } else { 0.0 }).collect::<Vec<f64>>());
            let undone = |n: &[f64]| trial.with_capture(law.undone(trial.capture(), &scan, n));
            let versions = [undone(&one), undone(&other)];
            let [left, right] = versions.each_ref().map(|version| version.ideal(&layers));
            let Some((left, right)) = left?.zip(right?) else { continue };
            let errors = left.left().errors_below(&right.left());
            let [positive, negative] = versions;
            let (version, numbers) = if errors < 0.0 { (negative, other) } else { (positive, one) };
            tried.push((errors.abs(), (law, steps, numbers), version));
        }
    }
    if tried.is_empty() {
        return Ok(vec![]);
    }
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (changes, versions): (Vec<_>, Vec<_>) =
        tried.into_iter().map(|(_, change, version)| (change, version)).unzip();
    // Renderings of fewer pairs than fits can take do not tell which.
    let is_few = trial.capture().pair_count() < 2 * PAIRS;
    let (first, others) =
        versions.split_at(if is_few { versions.len() } else { bounds::FIRST.min(versions.len()) });
    let from = From::Fit(&layers, OF_CHANGE);
    let mut fits = trials.fits(&[&[trial], first].concat(), from, step)?.into_iter();
    let Some(base) = fits.next().flatten() else { return Ok(vec![]) };
    let against_base = |fitted: Option<Fitted>| fitted.map(|fitted| both(&fitted.held, &base.held, None));
    let mut left: Vec<Option<[Left; 2]>> = fits.map(against_base).collect();
    if !left.iter().flatten().any(|left| EvidenceGate::SHOWN.passes(left)) {
        return Ok(vec![]);
    }
    left.extend(trials.fits(others, from, step)?.into_iter().map(against_base));
    // What is left over what is left without the change, as by a step that is as long as one of the scale.
    let mut less: Vec<(f64, &'static Law, Vec<f64>)> = vec![];
    for ((law, steps, numbers), left) in changes.into_iter().zip(left) {
        let Some(left) = left.filter(|left| EvidenceGate::STEP.passes(left)) else { continue };
        let [after, before] = left.each_ref().map(Left::excess);
        less.push(((after / before).powf(1.0 / f64::from(steps)), law, numbers));
    }
    less.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut all: Vec<Proposal> = vec![];
    for (_, law, numbers) in less {
        let start: Vec<f64> = numbers.iter().map(|n| bounds::LONGER * n).collect();
        if all.iter().all(|of| of.law.name != law.name) {
            all.push(Proposal { law, starts: vec![start], is_far: false });
        }
    }
    // A scale that leaves less by its step stays, whatever leaves less by theirs; of the others the first one.
    let first = all.first().map(|of| of.law.name);
    trials.is_scaled = all.iter().any(|of| (of.law.has_rivals)(&of.starts[0]));
    all.retain(|of| (of.law.has_rivals)(&of.starts[0]) || Some(of.law.name) == first);
    Ok(all)
}

/// Laws of delays and places that resemble a scale, where one leaves less.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn as_scale(trials: &mut Trials<'_>) -> Result<Vec<Proposal>> {
    if !trials.is_scaled {
        return Ok(vec![]);
    }
    let (most, factor) = bounds::AS_SCALE;
    let mut begun: Vec<TriedLaw> = vec![];
    let scan = trials.scan.clone();
    for law in LAWS.iter().filter(|law| law.proposed == Proposed::AsScale && (law.applies)(&scan)) {
        let is_far = law.of_point.is_some();
        let mut best = trials.begun(&Proposal { law, starts: (law.starts)(&scan), is_far })?;
        // Fits that begin with the surface at hand, moved, nearly agree: what the network sees then decides.
        if let Some(near) = best.as_ref().filter(|best| !is_far && best.share_left() < bounds::NEARLY) {
            let seen = trials.looked_at(law, &near.numbers)?;
            best = best.into_iter().chain(seen).min_by(TriedLaw::compared);
        }
        begun.extend(best.filter(|best| best.share_left() < factor));
    }
    begun.sort_by(TriedLaw::compared);
    begun.truncate(most);
    let proposal = |TriedLaw { law, numbers, .. }| Proposal { law, starts: vec![numbers], is_far: true };
    Ok(begun.into_iter().map(proposal).collect())
}

/// Scale and record at which a light-cone transform (O'Toole and others 2018) is far sharper: paths of points that are too far apart, or of
/// bins that are too narrow, meet in no surface.
fn sharper(job: &Job<'_>, gpu: &Gpu) -> Vec<Proposal> {
    let [nx, ny] = job.capture.scan;
    let few = job.capture.stride(nx.max(ny).div_ceil(bounds::POINTS));
    let job = &job.with_capture(few.map_or(Cow::Borrowed(&*job.capture), Cow::Owned));
    let Some(own) = sharpness(job, gpu, 1.0, 0.0).filter(|own| *own < bounds::SHARP) else { return vec![] };
    let (number, step) = bounds::RECORDS;
    let step = step * SceneTraits::of(&job.capture).wall;
    // The number of the law, the factor of the points, and by how much the record begins later.
    let scales = bounds::SCALES.map(|factor| [factor - 1.0, factor, 0.0]);
    let later = (1..=number).flat_map(|at| [1.0, -1.0].map(|side| side * at as f64 * step));
    let records: Vec<[f64; 3]> = later.map(|later| [-later, 1.0, later]).collect();
    let sharpest = |name: &str, all: &[[f64; 3]]| {
        let each =
            all.iter().filter_map(|[n, factor, later]| Some((*n, sharpness(job, gpu, *factor, *later)?)));
        let far = each.filter(|(_, sharp)| *sharp >= bounds::SHARPER * own);
        let (number, _) = far.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Proposal { law: named(name), starts: vec![vec![number]], is_far: true })
    };
    sharpest("scale", &scales).into_iter().chain(sharpest("record", &records)).collect()
}

/// How few pixels hold the light of a transform of the capture with points `factor` times as far apart and a record that begins `later`: mean fourth power of the albedo over the square of its mean square. `None` if the transform does not take it.
fn sharpness(job: &Job<'_>, gpu: &Gpu, factor: f64, later: f64) -> Option<f64> {
    let scaled = Capture::clone(&job.capture).with(|c| {
        c.t_start += later;
        c.laser.iter_mut().chain(&mut c.sensor).for_each(|point| *point *= factor);
    });
    let mut job = job.with_capture(Cow::Owned(scaled));
    let common = job.solver.common();
    let of_scene = SceneTraits::of(&job.capture);
    let traits = SceneTraits { preset: job.preset, reflectance: common.reflectance, ..of_scene };
    let options = LctOptions::defaults_for(&traits).with(|o| {
        o.lateral = common.lateral.min(bounds::PIXELS);
        o.image.min_depth = common.min_depth;
    });
    // A box that is set is for the capture as it is; voxels are cubes.
    let pitch = pixel_of(&job.capture, None, options.lateral);
    (job.settings.volume, job.settings.depth_pitch, job.settings.keep_volume) = (None, Some(pitch), None);
    job.solver = options.into();
    let job = job.summed().ok()?;
    let quiet = &mut |_: &Progress| ControlFlow::Continue(());
    let maps = job.solver.solve(gpu, &job.problem().ok()?, &mut Watch::of(quiet)).ok()?.maps;
    let [squares, fourths] = maps.albedo.iter().fold([0.0; 2], |[two, four], a| {
        let square = f64::from(a.max(0.0)).powi(2);
        [two + square, four + square * square]
    });
    (squares > 0.0).then(|| maps.albedo.len() as f64 * fourths / (squares * squares))
}

/// Starting numbers of a motion of the scene between the ends of a scan. If it moves all the time, points seem to be sheared, or a wall to
/// lean; if once, fits of the first and of the last third of the lines, each from the start, explain their own pairs far better than one
/// surface of all does, and lie apart by about how far it moved.
///
/// # Errors
/// The device fails, or the caller cancels.
fn motion(trials: &mut Trials<'_>) -> Result<Option<Proposal>> {
    let of_axis = |axis: usize| LAWS.iter().find(|law| law.proposed == Proposed::ByEnds(axis));
    let [Some(x), Some(y)] = [0, 1].map(of_axis) else { return Ok(None) };
    if !(x.applies)(&trials.scan) {
        return Ok(None);
    }
    let layers = trials.base.surface.layers.clone();
    let mut moved = (0, DVec3::ZERO, 0.0);
    // Short fits rule most captures out.
    for (from, most) in [From::Fit(&layers, OF_CHANGE), From::Start].into_iter().zip(bounds::ENDS) {
        let [Some(columns), Some(rows)] = [ends(trials, 0, from)?, ends(trials, 1, from)?] else {
            return Ok(None);
        };
        let (axis, [(share, errors, apart), (other, ..)]) =
            if rows.0 < columns.0 { (1, [rows, columns]) } else { (0, [columns, rows]) };
        if share > most * other {
            return Ok(None);
        }
        moved = (axis, apart, errors);
    }
    let (axis, apart, errors) = moved;
    let starts = bounds::ALONG.map(|part| {
        let mut start = (bounds::FARTHER * apart / trials.scan.half).extend(0.0).to_array();
        start[axis] *= part;
        start.to_vec()
    });
    let proposal = Proposal { law: [x, y][axis], starts: starts.to_vec(), is_far: true };
    Ok((errors >= bounds::ENDS_ERRORS).then_some(proposal))
}

/// Fits of the first and the last lines of a scan: what both leave of what the surface of all leaves of their pairs, the most standard errors
/// by which one of them leaves less, and how far the last one lies from the first one, metres. `None` where one finds nothing, or there are
/// too few lines along this axis.
fn ends(trials: &mut Trials<'_>, axis: usize, from: From<'_>) -> Result<Option<(f64, f64, DVec3)>> {
    let trial = trials.trial.clone();
    let capture = trial.capture();
    let (count, least) = (capture.scan[axis], bounds::LINES * bounds::PARTS);
    if count < least || capture.pair_count() < least * count {
        return Ok(None);
    }
    let ends = [0, bounds::PARTS - 1].map(|part| {
        let is_kept = |pair: &usize| line_of(capture.scan, axis, *pair) * bounds::PARTS / count == part;
        let kept: Vec<usize> = (0..capture.pair_count()).filter(is_kept).collect();
        let mut scan = capture.scan;
        scan[axis] = kept.len() / (capture.pair_count() / count);
        trial.with_capture(capture.keep(&kept, scan))
    });
    let (mut sums, mut errors, mut centres) = ([0.0; 2], f64::NEG_INFINITY, vec![]);
    let (layers, step) = (trials.base.surface.layers.clone(), trials.base.surface.step);
    let fits = trials.fits(&ends, from, step)?;
    for (end, own) in ends.iter().zip(fits) {
        let Some((own, all)) = own.zip(end.ideal(&layers)?) else { return Ok(None) };
        let (left, before) = (own.left(), all.left());
        sums = [sums[0] + left.excess(), sums[1] + before.excess()];
        errors = errors.max(left.errors_below(&before));
        centres.push(centre(&own.surface.layers));
    }
    Ok(Some((sums[0] / sums[1], errors, centres[1] - centres[0])))
}

/// The centre of surfaces, weighed by their albedos, metres.
fn centre(layers: &[Maps]) -> DVec3 {
    let (mut sum, mut weights) = (DVec3::ZERO, f64::MIN_POSITIVE);
    for maps in layers {
        for pixel in (0..maps.depth.len()).filter(|pixel| maps.depth[*pixel].is_finite()) {
            let [x, y] = maps.centre(pixel / maps.ny, pixel % maps.ny);
            let weight = f64::from(maps.albedo[pixel].max(0.0));
            sum += weight * DVec3::new(x, y, f64::from(maps.depth[pixel]));
            weights += weight;
        }
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_weighs_albedos_and_leaves_out_what_has_no_surface() {
        let mut maps = Maps::empty([2, 2], [0.0, 2.0, 0.0, 2.0]);
        maps.depth = vec![1.0, f32::NAN, f32::NAN, 2.0];
        maps.albedo = vec![1.0, 9.0, 9.0, 3.0];
        let all = centre(&[maps]);
        assert!(all.distance(DVec3::new(1.25, 1.25, 1.75)) < 1e-12, "{all}");
    }
}
