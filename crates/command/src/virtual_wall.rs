//! A virtual wall: the surface of a result rendered onto a dense confocal scan, for programs that know no other.

use std::path::{Path, PathBuf};

use glam::{DVec3, dvec3};
use serde_json::Value;
use thirdbounce::capture::{Capture, Pulse, Reflectance};
use thirdbounce::engine::{background, room_light, variances, without_room};
use thirdbounce::export::report::{self, Report};
use thirdbounce::judge::FoundPulse;
use thirdbounce::maps::Maps;
use thirdbounce::{Error, Kind, Result, Settings, export, job};
use thirdbounce_simulate::{Mesh, Object, Pairs, RenderOptions, Scene, render_pairs};

/// Levels to which albedos are rounded: each is an object of the renderer.
const LEVELS: usize = 64;
/// Least |z| of a normal: steeper pixels do not reach farther along z.
const STEEPEST: f64 = 0.2;
/// Pairs of the measurement that the scale of the light is estimated from, at most.
const PAIRS: usize = 1024;
/// A measured pair takes the place of a rendered one within this share of the distance of neighbours.
const COINCIDES: f64 = 0.125;
/// Most values of a virtual wall.
const MOST_VALUES: f64 = 1e9;

/// The scan to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VirtualWall {
    /// Points along x and y, at the centres of cells.
    pub scan: [usize; 2],
    /// Side of the square wall about the middle of the maps, metres; `None`: the extent of the maps.
    pub wall: Option<f64>,
}

/// A rendered scan.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfocalScan {
    /// The capture.
    pub capture: Capture,
    /// Share of the squares of the measured light, beyond photon noise, that is the surface's.
    pub share: f64,
    /// Pairs that are measured ones.
    pub kept: usize,
    /// The capture of the result.
    pub source: PathBuf,
}

impl VirtualWall {
    /// The points of a scan `NXxNY`.
    ///
    /// # Errors
    /// `Kind::Options` for anything else, or fewer than 2 x 2 points.
    pub fn scan(text: &str) -> Result<[usize; 2]> {
        let sides = text.split_once(['x', 'X']).map(|(x, y)| [x, y].map(|n| n.trim().parse().unwrap_or(0)));
        sides.filter(|sides| sides.iter().all(|n| (2..=4096).contains(n))).ok_or_else(|| {
            Error::options(
                format!("a confocal scan of {text:?} points"),
                "give columns x rows from 2 to 4096, such as 128x128",
            )
        })
    }

    /// Renders the result in `folder`.
    ///
    /// # Errors
    /// `Kind::Input`: no result in the folder, one without surface, or a capture that is not where it was or not what it was;
    /// `Kind::Memory`: more values than a capture can have.
    pub fn of(&self, folder: &Path) -> Result<ConfocalScan> {
        let report = report::read(&folder.join("report.json"))?;
        let maps = export::npz::read_maps(&folder.join("maps.npz"))?;
        let (source, measured) = measured(&report, folder)?;
        let pulse = pulse(&report, &measured)?;
        let surface = TiledSurface { maps: &maps, reflectance: reflectance(&report)?, pulse };
        let objects = surface.objects();
        if objects.is_empty() {
            return Err(Error::input(
                format!("{}: the result has no surface", folder.display()),
                "reconstruct again, or give another result",
            ));
        }
        let fit = surface.scale(&objects, &measured)?;
        let pairs = self.pairs(maps.extent);
        let bins = bins(&objects, &pairs, measured.bin_width, surface.pulse.as_ref());
        if (pairs.laser.len() * bins) as f64 > MOST_VALUES {
            return Err(Error::new(
                Kind::Memory,
                format!("{} pairs of {bins} bins", pairs.laser.len()),
                "give fewer points, or sum bins in the reconstruction",
            ));
        }
        let mut capture = surface.light(&objects, &pairs, [0.0, measured.bin_width], bins)?;
        capture.histograms.iter_mut().for_each(|v| *v = (f64::from(*v) * fit.scale) as f32);
        capture.name = format!("{} on a virtual wall", measured.name);
        capture.pulse = surface.pulse;
        let kept = keep_measured(&mut capture, &measured, self.pitch(maps.extent));
        capture.check()?;
        Ok(ConfocalScan { capture, share: fit.share, kept, source })
    }

    fn sides(&self, extent: [f64; 4]) -> [f64; 2] {
        self.wall.map_or([extent[1] - extent[0], extent[3] - extent[2]], |wall| [wall; 2])
    }

    /// Distance of neighbours, the smaller of x and y.
    fn pitch(&self, extent: [f64; 4]) -> f64 {
        let [x, y] = self.sides(extent);
        (x / self.scan[0] as f64).min(y / self.scan[1] as f64)
    }

    fn pairs(&self, [x0, x1, y0, y1]: [f64; 4]) -> Pairs {
        let ([nx, ny], sides) = (self.scan, self.sides([x0, x1, y0, y1]));
        let at =
            |i: usize, n: usize, middle: f64, side: f64| middle + ((i as f64 + 0.5) / n as f64 - 0.5) * side;
        let point = |pair: usize| {
            dvec3(
                at(pair / ny, nx, x0.midpoint(x1), sides[0]),
                at(pair % ny, ny, y0.midpoint(y1), sides[1]),
                0.0,
            )
        };
        let points: Vec<DVec3> = (0..nx * ny).map(point).collect(); // bounded: checked by `scan`
        Pairs {
            scan: [nx, ny],
            laser: points.clone(),
            sensor: points,
            laser_normal: None,
            sensor_normal: None,
        }
    }
}

/// The capture of a result, in the bins of its solver, without empty room and background.
fn measured(report: &Report, folder: &Path) -> Result<(PathBuf, Capture)> {
    let text = |key: &str| {
        let named = PathBuf::from(report.settings.get(key).and_then(Value::as_str)?);
        Some(found_from(folder, &named).unwrap_or(named))
    };
    let number = |key: &str| report.settings.get(key).and_then(Value::as_u64).map(|n| n as usize);
    let source = text("capture").filter(|path| path.exists()).ok_or_else(|| {
        let named = text("capture").unwrap_or_default();
        Error::input(
            format!("{}: the capture of the result, {}, is not there", folder.display(), named.display()),
            "put it back, or reconstruct again",
        )
    })?;
    let settings = Settings {
        wall: report.settings.get("wall").and_then(Value::as_f64),
        stride: number("stride").filter(|n| *n > 1),
        empty: text("empty"),
        ..Settings::default()
    };
    let mut capture = job::load(&source, &settings)?.capture;
    if (capture.bin_width / report.capture.bin_width_m - 1.0).abs() > 1e-6 {
        return Err(Error::input(
            format!(
                "{}: the capture does not have the bins of the result in {}",
                source.display(),
                folder.display()
            ),
            "reconstruct again",
        ));
    }
    let found = report.settings.get("empty_found").cloned().unwrap_or_default();
    let is_emptied = found["is_used"] == true;
    if is_emptied {
        let left = room_light(&capture).and_then(|light| without_room(&capture, &light));
        capture = left.map_or(capture, |(_, left)| left);
    }
    let sum = number("bins_summed").unwrap_or(1).clamp(1, capture.bins);
    let mut capture = capture.binned(sum)?;
    let level = background(&capture);
    let [per_count, floor] = variances(&capture, level);
    capture.noise = Some([per_count, floor]);
    capture.histograms.iter_mut().for_each(|v| *v -= level as f32);
    Ok((source, capture))
}

/// A file of a report, whose path may be relative to the folder in which the run was: this one, or one above the result.
fn found_from(folder: &Path, named: &Path) -> Option<PathBuf> {
    let above = std::fs::canonicalize(folder).ok()?;
    let there = above.ancestors().map(|folder| folder.join(named)).find(|path| path.exists());
    if named.exists() { Some(named.into()) } else { there }
}

/// The impulse response of the result: that which it found, else that of its capture.
fn pulse(report: &Report, measured: &Capture) -> Result<Option<Pulse>> {
    let found = report.settings.get("pulse_found").cloned().unwrap_or_default();
    match serde_json::from_value::<FoundPulse>(found) {
        Ok(found) => found.pulse(),
        Err(_) => Ok(measured.pulse.clone()),
    }
}

fn reflectance(report: &Report) -> Result<Reflectance> {
    let model = report.settings.get("model").cloned().unwrap_or_default();
    serde_json::from_value(model.clone()).map_err(|_| {
        Error::input(format!("report.json: the model {model} is not known"), "give a result of this version")
    })
}

/// Bins from path 0 that hold all light of the objects.
fn bins(objects: &[Object], pairs: &Pairs, width: f64, pulse: Option<&Pulse>) -> usize {
    let corners = || objects.iter().flat_map(|o| o.mesh.triangles.iter().flatten());
    let low = pairs.laser.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = pairs.laser.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let far = |p: &DVec3| (*p - low).abs().max((*p - high).abs()).truncate().extend(p.z).length();
    let path = 2.0 * corners().map(far).fold(0.0, f64::max) + pulse.map_or(0.0, |p| p.end().max(0.0));
    (path / width).ceil() as usize + 2
}

/// A surface with all that its light depends on.
struct TiledSurface<'m> {
    maps: &'m Maps,
    reflectance: Reflectance,
    pulse: Option<Pulse>,
}

/// The scale of rendered light to counts, and how much of the counts it is.
struct LightScale {
    scale: f64,
    share: f64,
}

impl TiledSurface<'_> {
    /// A tile in each pixel of the mask, in both layers, by the albedo. A pixel has the area of its cell, however steep it is.
    fn objects(&self) -> Vec<Object> {
        let maps = self.maps;
        let [x0, x1, y0, y1] = maps.extent;
        let half = [0.5 * (x1 - x0) / maps.nx as f64, 0.5 * (y1 - y0) / maps.ny as f64];
        let layers = [maps.layer(0), maps.layer(1)];
        let mut tiles = vec![];
        for layer in layers.iter().flatten() {
            for pixel in (0..layer.mask.len()).filter(|p| layer.mask[*p] && layer.depth[*p].is_finite()) {
                let normal = DVec3::from(layer.normal[pixel].map(f64::from));
                let normal =
                    if normal.is_finite() && normal.z < 0.0 { normal.normalize() } else { -DVec3::Z };
                let steep = normal.z.min(-STEEPEST);
                let [x, y] = layer.centre(pixel / maps.ny, pixel % maps.ny);
                let depth = f64::from(layer.depth[pixel]);
                let corner = |i: f64, j: f64| {
                    let [dx, dy] = [i * half[0], j * half[1]];
                    let z = depth - (normal.x * dx + normal.y * dy) / steep;
                    dvec3(x + dx, y + dy, z.max(1e-3 * depth))
                };
                let [a, b, c, d] =
                    [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
                let mesh = Mesh {
                    triangles: vec![[a, d, b], [b, d, c]],
                    normals: vec![[normal; 3]; 2],
                    self_occluding: false,
                };
                let flat = 4.0 * half[0] * half[1] / mesh.total_area();
                tiles.push((f64::from(layer.albedo[pixel]) * flat, mesh));
            }
        }
        let most = tiles.iter().map(|(albedo, _)| *albedo).fold(0.0, f64::max);
        let level = |albedo: f64| ((albedo / most * LEVELS as f64) as usize).min(LEVELS - 1);
        let mut objects: Vec<(f64, usize, Mesh)> = vec![(0.0, 0, Mesh::default()); LEVELS];
        for (albedo, mesh) in tiles.into_iter().filter(|(albedo, _)| *albedo > 0.0) {
            let of = &mut objects[level(albedo)];
            of.0 += albedo;
            of.1 += 1;
            of.2.extend(mesh);
        }
        let shown = objects.into_iter().filter(|(_, count, _)| *count > 0);
        shown.map(|(sum, count, mesh)| Object { mesh, albedo: sum / count as f64 }).collect()
    }

    /// The light of the objects at these pairs, in `bins` bins of the width from the start, through the impulse response. Nothing hides
    /// anything, as in the model of the solver.
    fn light(
        &self,
        objects: &[Object],
        pairs: &Pairs,
        [start, width]: [f64; 2],
        bins: usize,
    ) -> Result<Capture> {
        let triangles: usize = objects.iter().map(|o| o.mesh.triangles.len()).sum();
        let mut scene = Scene::new("surface", objects.to_vec());
        (scene.scan, scene.bins, scene.bin_width, scene.t_start) = (1, Some(bins), width, start);
        (scene.reflectance, scene.occlusion) = (self.reflectance, false);
        // Every triangle is a sample.
        let options =
            RenderOptions { max_samples: 4 * triangles, coarse: Some(2), ..RenderOptions::default() };
        let mut capture = render_pairs(&scene, pairs, &options)?.capture;
        if let Some(pulse) = &self.pulse {
            pulse.taps_of_bins(width)?.spread(&mut capture.histograms, bins);
        }
        Ok(capture)
    }

    /// The scale that leaves least of the measured light.
    fn scale(&self, objects: &[Object], measured: &Capture) -> Result<LightScale> {
        let some = measured.subset(PAIRS.min(measured.pair_count()), 0)?;
        let pairs = Pairs {
            scan: some.scan,
            laser: some.laser.clone(),
            sensor: some.sensor.clone(),
            laser_normal: some.laser_normal.clone(),
            sensor_normal: some.sensor_normal.clone(),
        };
        let light = self.light(objects, &pairs, [some.t_start, some.bin_width], some.bins)?;
        let both =
            || light.histograms.iter().zip(&some.histograms).map(|(r, m)| [f64::from(*r), f64::from(*m)]);
        let sum = |of: fn([f64; 2]) -> f64| both().map(of).sum::<f64>();
        let [cross, square, energy] = [sum(|[r, m]| r * m), sum(|[r, _]| r * r), sum(|[_, m]| m * m)];
        let scale = cross / square;
        if !(scale.is_finite() && scale > 0.0) {
            return Err(Error::input(
                "the surface of the result is not in the light of its capture",
                "give a result whose verdict is not poor",
            ));
        }
        let [per_count, floor] = variances(&some, 0.0);
        let noise: f64 = both().map(|[_, m]| per_count * m.max(0.0) + floor).sum();
        let left = (energy - scale * cross - noise).max(0.0);
        Ok(LightScale { scale, share: 1.0 - left / (energy - noise).max(f64::MIN_POSITIVE) })
    }
}

/// Puts measured confocal pairs in the place of rendered ones at the same point; returns their number.
fn keep_measured(capture: &mut Capture, measured: &Capture, pitch: f64) -> usize {
    let near = COINCIDES * pitch;
    let ([nx, ny], bins) = (capture.scan, capture.bins);
    let (first, last) = (capture.laser[0], capture.laser[capture.pair_count() - 1]);
    let place = |value: f64, from: f64, to: f64, n: usize| {
        let at = ((value - from) / (to - from) * (n - 1) as f64).round();
        (0.0..n as f64).contains(&at).then_some(at as usize)
    };
    let shift = (capture.t_start - measured.t_start) / measured.bin_width;
    let mut kept = vec![false; capture.pair_count()]; // bounded: the scan
    for pair in 0..measured.pair_count() {
        let [laser, sensor] = [measured.laser[pair], measured.sensor[pair]];
        let at = place(laser.x, first.x, last.x, nx).zip(place(laser.y, first.y, last.y, ny));
        let Some(at) = at.map(|(x, y)| x * ny + y) else { continue };
        if laser.distance(capture.laser[at]) > near || sensor.distance(capture.laser[at]) > near {
            continue;
        }
        let counts = measured.histogram(pair);
        for (bin, value) in capture.histograms[at * bins..(at + 1) * bins].iter_mut().enumerate() {
            let from = bin as f64 + shift;
            let (low, part) = (from.floor(), from - from.floor());
            if low >= 0.0 && low < counts.len() as f64 {
                let next = counts.get(low as usize + 1).copied().unwrap_or(0.0);
                *value = counts[low as usize] * (1.0 - part as f32) + next * part as f32;
            }
        }
        kept[at] = true;
    }
    kept.into_iter().filter(|kept| *kept).count()
}

#[cfg(test)]
mod tests {
    use thirdbounce_simulate::{Layout, simulate, truth};

    use super::*;

    /// The torus, measured as the layout says, and its truth as maps of this albedo.
    fn scene(layout: Layout) -> (Scene, Maps) {
        let mut scene = Scene::named("torus").unwrap();
        (scene.layout, scene.scan, scene.bin_width, scene.occlusion) = (layout, 16, 0.012, false);
        let truth = truth(&scene, 64).unwrap();
        let maps = Maps {
            albedo: truth.mask.iter().map(|m| if *m { 3.0 } else { 0.0 }).collect(),
            depth: truth.depth.clone(),
            normal: truth.normal.clone(),
            mask: truth.mask.clone(),
            ..Maps::empty([64, 64], truth.extent)
        };
        // A pixel has the area of its cell: light of a scene is that of its own surface.
        let steep = |n: &[f32; 3]| (-n[2]).max(STEEPEST as f32);
        let albedo =
            maps.albedo.iter().zip(&maps.normal).map(|(a, n)| if *a > 0.0 { a / steep(n) } else { 0.0 });
        let albedo = albedo.collect();
        (scene, Maps { albedo, ..maps })
    }

    #[test]
    fn a_surface_of_one_laser_gives_the_light_of_a_confocal_scan() {
        let (one, maps) = scene(Layout::OneLaser { point: glam::DVec2::ZERO });
        let measured = simulate(&one, &RenderOptions::default()).unwrap().capture;
        let surface = TiledSurface { maps: &maps, reflectance: Reflectance::Cosine, pulse: None };
        let objects = surface.objects();
        let fit = surface.scale(&objects, &measured).unwrap();
        assert!(fit.share > 0.97, "{}", fit.share);
        let wall = VirtualWall { scan: [16, 16], wall: None };
        let pairs = wall.pairs(maps.extent);
        let (confocal, _) = scene(Layout::Confocal);
        let real = simulate(&confocal, &RenderOptions::default()).unwrap().capture;
        assert_eq!(pairs.laser, real.laser);
        let light = surface.light(&objects, &pairs, [0.0, real.bin_width], real.bins).unwrap();
        let both = || {
            light
                .histograms
                .iter()
                .zip(&real.histograms)
                .map(|(a, b)| [f64::from(*a) * fit.scale, f64::from(*b)])
        };
        let off: f64 = both().map(|[a, b]| (a - b).powi(2)).sum();
        let all: f64 = both().map(|[_, b]| b * b).sum();
        assert!(off < 0.03 * all, "{}", off / all);
    }

    #[test]
    fn measured_pairs_are_kept_where_they_coincide() {
        let (scene, maps) = scene(Layout::Confocal);
        let measured = simulate(&scene, &RenderOptions::default()).unwrap().capture;
        let pairs = VirtualWall { scan: [16, 16], wall: None }.pairs(maps.extent);
        let empty = |pairs: &Pairs, bins: usize| {
            let histograms = vec![0.0; pairs.laser.len() * bins];
            Capture::new(
                pairs.scan,
                pairs.laser.clone(),
                pairs.sensor.clone(),
                bins,
                measured.bin_width,
                histograms,
            )
        };
        let mut same = empty(&pairs, measured.bins);
        assert_eq!(keep_measured(&mut same, &measured, 1.0 / 16.0), 256);
        assert_eq!(same.histograms, measured.histograms);
        let other = VirtualWall { scan: [8, 8], wall: None }.pairs(maps.extent);
        assert_eq!(
            keep_measured(&mut empty(&other, measured.bins), &measured, 1.0 / 8.0),
            0,
            "between the points"
        );
        assert!(VirtualWall::scan("128").is_err() && VirtualWall::scan("1x9").is_err());
        assert_eq!(VirtualWall::scan("128x64").unwrap(), [128, 64]);
    }
}
