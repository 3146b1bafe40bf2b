//! Initialisation of a surface: the layers of a closed-form volume, or a plane.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;

use super::layers::{least_columns, split};
use super::options::{Begin, SurfaceOptions};
use super::support::{put, remove, retain_regions};
use crate::capture::{Background, Capture};
use crate::closed_form::{FbpOptions, LctOptions};
use crate::engine::{Prepared, Problem, Progress, RunsOn, Solver, TracePoint, VolumeMap, Watch};
use crate::gpu::Gpu;
use crate::learned::{self, LearnedStart};
use crate::maps::{Maps, percentile};
use crate::surface::support;
use crate::transport::Grid;
use crate::{Error, Result};

/// Pixels of the surface have this share of the albedo above which the closed-form method sees a surface: rims are dim.
const SUPPORT: f64 = 0.5;

/// A region without a pixel above this multiple of the noise of the brightest column in a hundred is noise: of 4,096 columns of
/// noise alone none is brighter.
const NOISE: f32 = 1.4;

/// A pair whose strongest bin has less than this share of the strongest of all pairs tells no first return.
const LIT: f32 = 0.1;

/// Light has come back when a bin has this share of the pair's strongest one.
const RISEN: f32 = 0.5;

/// The plane lies at this percentile of the depths that the pairs' first returns tell. The nearest pair tells the true one:
/// others see the object from the side. The smallest is one of noise.
const NEAREST: f64 = 10.0;

/// Between two maxima of a column the volume falls below this share of the lower one.
const DIP: f32 = 0.5;

/// Columns of a volume that are worth a task of their own.
const COLUMNS_OF_WORK: usize = 128;

/// Pairs of a filtered back-projection: as many as its coarse voxels need.
const PROJECTED: usize = 1024;

/// Share of its albedo that surface begins with which a light-cone transform alone shows.
const DOUBTED: f32 = 0.5;

/// Expected IoU below which the network is not trusted.
const TRUSTED: f64 = 0.3;

/// What surfaces may begin with.
#[derive(Debug, Clone)]
pub(crate) struct Starts {
    /// The layers of the network or of a closed form, with the brightest albedo 1, or of a plane.
    pub layers: Vec<Maps>,
    /// The brightest surface of every column of a light-cone transform, its haze, too.
    pub light: Option<Maps>,
    /// What the network sees, if that is the start.
    pub seen: Option<Arc<LearnedStart>>,
    /// The layer of a light-cone transform, if the network's is the first one.
    pub closed: Option<Maps>,
}

impl Starts {
    /// The layers, with what a light-cone transform shows where the network is not sure; `None`: it shows hardly more.
    pub fn union(&self) -> Option<Vec<Maps>> {
        let mut layers = self.layers.clone();
        let (first, closed) = (layers.first_mut()?, self.closed.as_ref()?);
        let more = |p: &usize| !first.depth[*p].is_finite() && closed.depth[*p].is_finite();
        let pixels: Vec<usize> = (0..first.depth.len()).filter(more).collect();
        if (pixels.len() as f64) < least_columns(first.nx) {
            return None;
        }
        for pixel in pixels {
            put(first, Some(closed), pixel);
            first.albedo[pixel] *= DOUBTED;
        }
        Some(layers)
    }

    /// The same with these layers, and with what a fit from them showed as seen by the network.
    pub fn with_union(&self, layers: Vec<Maps>, shown: Option<&Maps>) -> Starts {
        let joined =
            |seen: &Arc<LearnedStart>| shown.map_or_else(|| seen.clone(), |maps| Arc::new(seen.joined(maps)));
        Starts { layers, light: self.light.clone(), seen: self.seen.as_ref().map(joined), closed: None }
    }

    /// The start of fits of a capture, given in its own bins and in those of `problem`: the network, with what a light-cone transform
    /// shows beside it, or a closed form where the network sees nothing.
    ///
    /// # Errors
    /// Those of [`seen`] and [`Start::layers`].
    pub fn of(
        gpu: &Gpu,
        [capture, summed]: [&Capture; 2],
        problem: &Problem<'_>,
        options: &SurfaceOptions,
        watch: &mut Watch<'_>,
    ) -> Result<Starts> {
        let grid = &problem.grid;
        let mut closed = || {
            Ok::<_, Error>(match Start::new(gpu, problem, options)? {
                Some(mut start) => start.layers(summed, options.iterations, watch)?,
                None => Starts {
                    layers: vec![plane(summed, grid, options.background)],
                    light: None,
                    seen: None,
                    closed: None,
                },
            })
        };
        let Some(seen) = seen(gpu, options, capture, grid, problem.memory)? else { return closed() };
        let mut starts = Starts {
            layers: vec![seen.maps(grid, learned::SURE)],
            light: None,
            seen: Some(seen),
            closed: None,
        };
        // A light-cone transform, which costs little, errs in other ways, and the network sees one surface where it may show two.
        if options.begin != Begin::Learned && is_light_cone(options, summed) {
            let light_cone = closed()?;
            let other = other_surface(&starts.layers[0], &light_cone.layers, least_columns(grid.n[0]));
            starts.layers.extend(other);
            starts.light = light_cone.light;
            starts.closed = light_cone.layers.into_iter().next();
        }
        Ok(starts)
    }
}

/// Of two layers, the surface that is not that of `seen`, where both are and it has one; `None` if it has fewer than `least` pixels.
fn other_surface(seen: &Maps, layers: &[Maps], least: f64) -> Option<Maps> {
    let [one, two] = layers else { return None };
    let edge = support::edge(seen);
    let mut other = Maps::empty([seen.nx, seen.ny], seen.extent);
    for pixel in 0..seen.depth.len() {
        let off = [one, two].map(|layer| (layer.depth[pixel] - seen.depth[pixel]).abs());
        if off.iter().all(|off| off.is_finite()) && off[0].max(off[1]) > edge {
            put(&mut other, Some(if off[0] > off[1] { one } else { two }), pixel);
        }
    }
    let count = other.depth.iter().filter(|z| z.is_finite()).count();
    (count as f64 >= least).then_some(other)
}

/// What the network sees of a capture on a grid, if it is to begin with that; `None`: a closed form or a plane begins.
///
/// # Errors
/// `Kind::Input`: the network is requested, and has too few pairs or sees nothing. The device fails.
pub(crate) fn seen(
    gpu: &Gpu,
    options: &SurfaceOptions,
    capture: &Capture,
    grid: &Grid,
    memory: Option<u64>,
) -> Result<Option<Arc<LearnedStart>>> {
    let is_asked = options.begin == Begin::Learned;
    if !is_asked && options.begin != Begin::Auto {
        return Ok(None);
    }
    let seen = LearnedStart::of(gpu, capture, Some(grid.extent()), memory)?.filter(|seen| {
        let is_trusted = is_asked || seen.expected_iou() >= TRUSTED;
        is_trusted && seen.maps(grid, learned::SURE).mask.contains(&true)
    });
    if is_asked && seen.is_none() {
        return Err(Error::input(
            format!("the network sees no surface in {} pairs", capture.pair_count()),
            "begin with lct or fbp, or with auto",
        ));
    }
    Ok(seen.map(Arc::new))
}

/// A closed-form method that is prepared to initialise surfaces of one scan.
pub(crate) struct Start {
    method: Box<dyn Prepared>,
    /// Number of pairs used.
    pairs: Option<usize>,
}

impl Start {
    /// Prepares the method for the scan of `problem`, whose grid has the pixels of the first fit; `None`: a plane initialises.
    ///
    /// # Errors
    /// `Kind::Input`: the capture breaks an assumption of the requested method. Memory or device do not allow it.
    pub fn new(gpu: &Gpu, problem: &Problem<'_>, options: &SurfaceOptions) -> Result<Option<Start>> {
        let Problem { capture, grid, .. } = *problem;
        let Some(closed) = method(options, grid.n[0], capture)? else { return Ok(None) };
        let projects = closed.common().runs_on == RunsOn::Device;
        let pairs = Some(PROJECTED).filter(|most| projects && capture.pair_count() > *most);
        let scan = few(capture, pairs)?.outline();
        let problem = Problem { capture: &scan, is_start: true, ..problem.and_volume() };
        Ok(Some(Start { method: closed.prepare(gpu, &problem)?, pairs }))
    }

    /// Makes all kernels and buffers now.
    ///
    /// # Errors
    /// Memory or device do not allow it.
    pub fn allocate(&mut self) -> Result<()> {
        self.method.allocate()
    }

    /// The layers of the closed-form volume, with the brightest albedo 1, and the volume. `watch` may cancel.
    ///
    /// # Errors
    /// Those of the method.
    pub fn layers(&mut self, capture: &Capture, iterations: usize, watch: &mut Watch<'_>) -> Result<Starts> {
        let capture = few(capture, self.pairs)?;
        of_method(&mut *self.method, &capture, iterations, watch)
    }
}

/// A subset of about `most` pairs: a coarser scan, or random pairs of a list.
fn few(capture: &Capture, pairs: Option<usize>) -> Result<Cow<'_, Capture>> {
    let Some(pairs) = pairs else { return Ok(Cow::Borrowed(capture)) };
    let stride = (capture.pair_count() as f64 / pairs as f64).sqrt().ceil() as usize;
    Ok(Cow::Owned(match capture.stride(stride) {
        Ok(coarser) => coarser,
        Err(_) => capture.subset(pairs, 0)?,
    }))
}

/// The closed-form method that initialises a surface on `lateral` pixels; `None`: a plane does.
///
/// # Errors
/// `Kind::Input`: the capture breaks an assumption of the requested method.
pub(crate) fn method(
    options: &SurfaceOptions,
    lateral: usize,
    capture: &Capture,
) -> Result<Option<Box<dyn Solver>>> {
    let counted = capture.integer_counts || capture.histograms.iter().any(|v| *v < 0.0);
    let lct = LctOptions::default().with(|o| {
        o.lateral = lateral;
        o.snr = (!counted).then_some(3.0);
        o.image.reflectance = options.reflectance;
        o.image.min_depth = options.min_depth;
        o.image.background = options.background;
    });
    let takes = lct.takes(capture);
    Ok(match options.begin {
        Begin::Plane => None,
        Begin::Lct => {
            takes.map_err(|e| Error::input(e.what, "begin with fbp, with a plane, or with auto"))?;
            Some(Box::new(lct))
        }
        Begin::Auto | Begin::Learned if takes.is_ok() => Some(Box::new(lct)),
        Begin::Auto | Begin::Learned | Begin::Fbp => {
            let fbp = FbpOptions::default().with(|o| {
                o.lateral = lateral;
                o.image = lct.image;
            });
            Some(Box::new(fbp))
        }
    })
}

/// Whether the light-cone transform initialises surfaces of this scan.
pub(crate) fn is_light_cone(options: &SurfaceOptions, capture: &Capture) -> bool {
    matches!(method(options, options.lateral, capture), Ok(Some(closed)) if closed.common().runs_on == RunsOn::Host)
}

/// As [`Start::layers`]; `watch` is not called for iterations.
///
/// # Errors
/// Those of the method.
fn of_method(
    method: &mut dyn Prepared,
    capture: &Capture,
    iterations: usize,
    watch: &mut Watch<'_>,
) -> Result<Starts> {
    let mut ask = |progress: &Progress| -> ControlFlow<()> {
        let point = TracePoint { iteration: 0, ..progress.point };
        (watch.hear)(&Progress { doing: progress.doing, point, iterations, remaining: None, maps: None })
    };
    let mut asking = Watch::of(&mut ask);
    let solved = method.solve(capture, &mut asking)?;
    let mut first = solved.maps;
    let least = SUPPORT * first.mask_fraction.unwrap_or(Maps::MASK_FRACTION);
    let threshold = (least * f64::from(Maps::white(&first.albedo))) as f32;
    let most = first.albedo.iter().copied().fold(0.0, f32::max);
    // Where noise outshines everything, the brightest regions are all that is known.
    let noise = solved.sharpness.and_then(|s| s.noise).map_or(0.0, |noise| NOISE * noise.floor as f32);
    let noise = if noise < most { noise } else { 0.0 };
    let light = first.clone();
    let mut second = solved.volume.as_ref().map(|volume| second_maxima(&first, volume));
    for maps in std::iter::once(&mut first).chain(&mut second) {
        for pixel in 0..maps.albedo.len() {
            let lit = maps.albedo[pixel] > threshold && maps.depth[pixel].is_finite();
            if lit {
                maps.albedo[pixel] /= most
            } else {
                remove(maps, pixel)
            }
            if lit && !maps.normal[pixel][2].is_finite() {
                maps.normal[pixel] = [0.0, 0.0, -1.0];
            }
        }
        retain_regions(maps, |maps, region| region.iter().any(|p| most * maps.albedo[*p] > noise));
    }
    let layers = second.and_then(|second| split(&first, &second, least_columns(first.nx)));
    Ok(Starts {
        layers: layers.map_or_else(|| vec![first], Vec::from),
        light: Some(light),
        seen: None,
        closed: None,
    })
}

/// The second maximum of each column of a volume: the largest value beyond the dips on both sides of the first maximum.
fn second_maxima(first: &Maps, volume: &VolumeMap) -> Maps {
    let mut second =
        Maps { mask_fraction: first.mask_fraction, ..Maps::empty([first.nx, first.ny], first.extent) };
    let of_column = |column: &[f32]| -> Option<(usize, f32)> {
        let top = (0..column.len()).max_by(|a, b| column[*a].total_cmp(&column[*b]))?;
        // The highest value so far beyond a dip, walking away from the maximum.
        let mut best: Option<(usize, f32)> = None;
        let mut lowest = column[top];
        let mut visit = |lowest: &mut f32, at: usize| {
            *lowest = lowest.min(column[at]);
            if *lowest < DIP * column[at] && best.is_none_or(|b| column[at] > b.1) {
                best = Some((at, column[at]));
            }
        };
        (0..top).rev().for_each(|at| visit(&mut lowest, at));
        lowest = column[top];
        (top + 1..column.len()).for_each(|at| visit(&mut lowest, at));
        best
    };
    let columns = volume.albedo.par_chunks(volume.grid.n[2]).with_min_len(COLUMNS_OF_WORK);
    let found: Vec<Option<(usize, f32)>> = columns.map(of_column).collect();
    for (pixel, (at, value)) in found.into_iter().enumerate().filter_map(|(p, best)| Some((p, best?))) {
        second.albedo[pixel] = value;
        second.depth[pixel] = (volume.grid.origin.z + at as f64 * volume.grid.pitch.z) as f32;
        second.normal[pixel] = [0.0, 0.0, -1.0];
    }
    second
}

/// A plane of albedo 1 that faces the wall, at the depth of the first returns; without any depth where no light comes back.
pub(crate) fn plane(capture: &Capture, grid: &Grid, with_background: bool) -> Maps {
    let [near, far] = grid.depth_range();
    let at = depth_of_first_returns(capture, with_background).map(|z| z.clamp(near, far));
    let count = grid.n[0] * grid.n[1];
    let (albedo, normal) = if at.is_some() { (1.0, [0.0, 0.0, -1.0]) } else { (0.0, [f32::NAN; 3]) };
    Maps {
        albedo: vec![albedo; count],
        depth: vec![at.map_or(f32::NAN, |z| z as f32); count],
        normal: vec![normal; count],
        mask: vec![at.is_some(); count],
        ..Maps::empty([grid.n[0], grid.n[1]], grid.extent())
    }
}

/// The depth of the nearest surface by the first returns of all pairs, metres; `None` without light. A path belongs to the
/// point of its ellipsoid that is farthest from the wall.
fn depth_of_first_returns(capture: &Capture, with_background: bool) -> Option<f64> {
    let background = Background::of(capture, with_background);
    let rows =
        || (0..capture.pair_count()).map(|pair| (capture.histogram(pair), background.of_pair(pair) as f32));
    let strongest = |(row, level): (&[f32], f32)| row.iter().copied().fold(0.0, f32::max) - level;
    let most = rows().map(strongest).fold(0.0, f32::max);
    let depth = |((row, level), (l, s)): ((&[f32], f32), (&glam::DVec3, &glam::DVec3))| -> Option<f32> {
        let peak = Some(strongest((row, level))).filter(|peak| *peak > 0.0 && *peak >= LIT * most)?;
        let first = row.iter().position(|v| v - level >= RISEN * peak)?;
        let half = 0.5 * (capture.t_start + (first as f64 + 0.5) * capture.bin_width);
        let deep = (half * half - 0.25 * l.distance_squared(*s)).max(0.0).sqrt();
        Some((0.5 * (l.z + s.z) + deep) as f32)
    };
    let pairs = capture.laser.iter().zip(&capture.sensor);
    let all: Vec<f32> = rows().zip(pairs).filter_map(depth).collect();
    percentile(&all, NEAREST).map(f64::from)
}

/// A surface that earlier fits of the same capture found, on coarse pixels.
#[derive(Debug, Clone)]
pub struct Begun {
    /// Its layers.
    pub layers: Vec<Maps>,
    /// Those of its start.
    pub closed: Vec<Maps>,
    /// What the network sees, if that is the start.
    pub seen: Option<Arc<LearnedStart>>,
    /// A light-cone transform beside it: the brightest surface of every column.
    pub light: Option<Maps>,
    /// The length of the last steps, as a share of the longest ones.
    pub step: f64,
    /// It explains so little of the light that rounds of fits would not change that.
    pub is_far: bool,
}

impl Begun {
    /// A start without earlier fits.
    pub fn of(closed: Vec<Maps>, seen: Option<Arc<LearnedStart>>) -> Begun {
        Begun { layers: closed.clone(), closed, seen, light: None, step: 1.0, is_far: false }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};

    use super::*;
    use crate::transport::Volume;

    /// A scan over a point, whose pairs have these laser points; light in one bin, over a background.
    fn seen(target: DVec3, laser: impl Fn(DVec3) -> DVec3) -> Capture {
        let bins = 200;
        let sensor: Vec<DVec3> = (0..100)
            .map(|i| dvec3(f64::from(i / 10) / 9.0 - 0.5, f64::from(i % 10) / 9.0 - 0.5, 0.0))
            .collect();
        let laser: Vec<DVec3> = sensor.iter().map(|s| laser(*s)).collect();
        let mut counts = vec![2.0; bins * sensor.len()];
        for (row, (l, s)) in counts.chunks_mut(bins).zip(laser.iter().zip(&sensor)) {
            let path = l.distance(target) + s.distance(target);
            row[((path - 0.3) / 0.01) as usize] += 50.0;
        }
        let mut capture = Capture::new([10, 10], laser, sensor, bins, 0.01, counts);
        capture.t_start = 0.3;
        capture
    }

    #[test]
    fn the_union_has_the_surface_of_both() {
        let of = |lit: &dyn Fn(usize) -> bool, depth: f32| {
            let mut maps = Maps::empty([16, 16], [-0.5, 0.5, -0.5, 0.5]);
            for pixel in (0..256).filter(|p| lit(*p)) {
                (maps.albedo[pixel], maps.depth[pixel], maps.normal[pixel]) = (1.0, depth, [0.0, 0.0, -1.0]);
            }
            maps
        };
        let seen = of(&|p| p < 100, 0.5);
        let starts =
            |closed| Starts { layers: vec![seen.clone()], light: None, seen: None, closed: Some(closed) };
        let both = starts(of(&|p| p < 200, 0.7)).union().unwrap().swap_remove(0);
        let at = |p: usize| (both.albedo[p], both.depth[p]);
        assert_eq!([at(99), at(100)], [(1.0, 0.5), (DOUBTED, 0.7)]);
        assert!(both.depth[200].is_nan());
        assert!(starts(of(&|p| p < 100, 0.7)).union().is_none(), "the same pixels");
    }

    #[test]
    fn a_plane_lies_where_the_first_light_comes_from() {
        let volume = Volume { min: dvec3(-0.5, -0.5, 0.3), max: dvec3(0.5, 0.5, 1.0) };
        let grid = Grid::new(volume, 8, 0.05).unwrap();
        let target = dvec3(0.1, -0.1, 0.7);
        let one_laser = dvec3(0.2, 0.1, 0.0);
        for capture in [seen(target, |s| s), seen(target, |_| one_laser)] {
            let maps = plane(&capture, &grid, true);
            maps.check().unwrap();
            // Pairs around see the point from the side.
            let off = f64::from(maps.depth[0]) - target.z;
            assert!((-0.02..0.05).contains(&off), "{off}");
            assert!(maps.depth.iter().all(|z| *z == maps.depth[0]));
        }
        let mut dark = seen(target, |s| s);
        dark.histograms.fill(0.0);
        assert!(plane(&dark, &grid, true).depth.iter().all(|z| z.is_nan()));
    }
}
