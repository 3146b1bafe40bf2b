//! Z-NLOS (Zaragoza) captures, HDF5 or MATLAB. Files that NeTF made of them: [`super::netf`].
//!
//! `data` has the axes (colour, t, bounce, sx, sy) if confocal, else (colour, t, bounce, sx, sy, lx, ly). All axes may
//! be reversed, because HDF5 and MATLAB order them differently. Colours are summed, and the given bounce is used.
//! `{camera,laser}GridPositions` are 3×X×Y or X×Y×3, in the axis order of `data`, or one list of all points (3×XY,
//! 3×XY×1, XY×3 or XY×1×3) in the order in which the file stores their histograms. Files without the colour axis are
//! read, too. `{camera,laser}GridNormals` are optional. The devices are `cameraPosition` and `laserPosition`. `deltaT`
//! and `t0` are metres of path, `t` is the number of bins. The paths include the legs from the laser and to the camera, which are removed for each point.
//! `hiddenVolumePosition` tells on which side of the wall the scene is; the wall is rotated to face +z.
//!
//! Axes: the coordinates in the file are kept, except for that rotation. They are right-handed.

use std::ops::Range;

use glam::DVec3;

use super::counts::Counts;
use super::frame;
use super::points::unit;
use super::read_options::ReadOptions;
use super::variables::Variables;
use crate::conditioning::legs;
use crate::error::{Error, Result};
use crate::{Bounce, Capture, host};

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays, shapes that do not agree, or an axis order that cannot be determined.
pub fn read(file: &Variables, given: &ReadOptions, notes: &mut Vec<String>) -> Result<Capture> {
    let number = |name: &str| -> Result<f64> { file.number(name)?.ok_or_else(|| file.missing(name)) };
    let shape = file.counts_shape("data")?;
    let sensors = SidePoints::read(file, "camera")?.ok_or_else(|| file.missing("cameraGridPositions"))?;
    let lasers = SidePoints::read(file, "laser")?;
    let bins = file.number("t")?.map(|t| t as usize);
    let axes = DataAxes::of(&shape, [&sensors, lasers.as_ref().unwrap_or(&sensors)], bins)?;
    let confocal = axes.size.len() == 5;
    let kept = kept_bounces(given.bounce, axes.size[2], notes)?;
    let counts = file.counts("data")?;
    let integer_counts = counts.whole();
    let histograms = axes.gather(&counts, kept)?;
    drop(counts);
    let of_sensors = [axes.size[3], axes.size[4]];
    let sensor_places = sensors.ordered(axes.reversed, of_sensors);
    let (laser_places, scan, laser, sensor);
    if confocal {
        // Without a laser grid the laser points are the camera points.
        laser_places = lasers.as_ref().unwrap_or(&sensors).ordered(axes.reversed, of_sensors);
        scan = of_sensors;
        (laser, sensor) = (laser_places.points.clone(), sensor_places.points.clone());
        if laser.len() != sensor.len() {
            return Err(Error::input(
                format!(
                    "{} laser points for {} camera points of a confocal capture",
                    laser.len(),
                    sensor.len()
                ),
                "a confocal capture has one laser point per camera point",
            ));
        }
    } else {
        let lasers = lasers.ok_or_else(|| file.missing("laserGridPositions"))?;
        let of_lasers = [axes.size[5], axes.size[6]];
        laser_places = lasers.ordered(axes.reversed, of_lasers);
        let (l, s) = (laser_places.points.len(), sensor_places.points.len());
        scan = match (l, s) {
            (1, _) => of_sensors,
            (_, 1) => of_lasers,
            _ => [l, s],
        };
        let all = |of: &dyn Fn(usize) -> DVec3| host::collected("the wall points", l * s, (0..l * s).map(of));
        laser = all(&|p| laser_places.points[p / s])?;
        sensor = all(&|p| sensor_places.points[p % s])?;
    }
    let s = sensor_places.points.len();
    let pairs = scan[0] * scan[1];
    let spread = |normals: Option<Vec<DVec3>>, of: &dyn Fn(usize) -> usize| {
        normals.map(|n| (0..pairs).map(|p| unit(n[of(p)])).collect::<Vec<_>>())
    };
    let capture = Capture {
        laser_normal: spread(laser_places.normals, &|p| if confocal { p } else { p / s }),
        sensor_normal: spread(sensor_places.normals, &|p| if confocal { p } else { p % s }),
        t_start: file.number("t0")?.unwrap_or(0.0),
        integer_counts,
        ..Capture::new(scan, laser, sensor, axes.size[1], number("deltaT")?, histograms)
    };
    // Pairs that were not measured are left out later; the rest must be valid.
    legs::check_measured(&capture)?;
    let device = |name: &str| -> Result<DVec3> { file.point(name)?.ok_or_else(|| file.missing(name)) };
    let camera_at = device("cameraPosition")?;
    let laser_at =
        if confocal { file.point("laserPosition")?.unwrap_or(camera_at) } else { device("laserPosition")? };
    let outer: Vec<f64> = (capture.laser.iter().zip(&capture.sensor))
        .map(|(l, s)| laser_at.distance(*l) + camera_at.distance(*s))
        .collect();
    notes.push("the legs from the laser to the wall and from the wall to the camera are removed".into());
    let capture = legs::remove(&capture, &outer)?;
    let capture = frame::facing_z(capture, file.point("hiddenVolumePosition")?, notes);
    // The pairs of an exhaustive capture are ordered laser point by laser point.
    let lattice = confocal || scan[0] != laser_places.points.len() || s == 1;
    Ok(if lattice { frame::in_order(capture) } else { capture })
}

/// Indices of the bounces to use, by default the third. The file holds `bounces` of them, from the second on.
fn kept_bounces(given: Option<Bounce>, bounces: usize, notes: &mut Vec<String>) -> Result<Range<usize>> {
    let chosen = given.unwrap_or(Bounce::Nth(3));
    let kept = match chosen {
        Bounce::All => 0..bounces,
        _ if bounces == 1 => 0..1,
        Bounce::Nth(n) if n < bounces + 2 => n - 2..n - 1,
        Bounce::Nth(n) => {
            return Err(Error::options(
                format!("bounce {n} was given, but the file holds the bounces 2 to {}", bounces + 1),
                "give a bounce that the file holds, or all",
            ));
        }
    };
    notes.push(match (bounces, chosen) {
        (1, _) => "data holds a single bounce, or the sum of all".into(),
        (_, Bounce::All) => format!("the sum of the bounces 2 to {} is used", bounces + 1),
        (_, Bounce::Nth(n)) => {
            format!("only bounce {n} of the bounces 2 to {} is used; they can also be summed", bounces + 1)
        }
    });
    Ok(kept)
}

/// The points of one side as the file has them.
pub(super) struct SidePoints {
    /// Points along the two axes in the order of the file.
    pub shape: [usize; 2],
    /// Whether the coordinates are the first axis, [3, ., .], as in a file in the order of the format.
    first: bool,
    pub points: Vec<DVec3>,
    pub normals: Option<Vec<DVec3>>,
}

/// Numbers of points along the two axes of the file, whether the coordinates come first, and the vectors.
type Vectors = ([usize; 2], bool, Vec<DVec3>);

impl SidePoints {
    /// `{side}GridPositions` and `{side}GridNormals`, `None` without positions.
    pub fn read(file: &Variables, side: &str) -> Result<Option<SidePoints>> {
        let vectors = |name: &str| -> Result<Option<Vectors>> {
            let Some((shape, values)) = file.numbers(name)? else { return Ok(None) };
            let n = values.len() / 3;
            let (places, first) = match shape[..] {
                [3] => ([1, 1], true),
                [3, n] => ([n, 1], true),
                [n, 3] => ([n, 1], false),
                [3, a, b] => ([a, b], true),
                [a, b, 3] => ([a, b], false),
                _ => {
                    return Err(Error::input(
                        format!("{name} has shape {shape:?}, without x, y, z along the first or last axis"),
                        format!("{name} is 3 x X x Y or X x Y x 3"),
                    ));
                }
            };
            let at = |p: usize, c: usize| if first { values[c * n + p] } else { values[3 * p + c] };
            Ok(Some((places, first, (0..n).map(|p| DVec3::new(at(p, 0), at(p, 1), at(p, 2))).collect())))
        };
        let Some((shape, first, points)) = vectors(&format!("{side}GridPositions"))? else { return Ok(None) };
        let name = format!("{side}GridNormals");
        let normals = match vectors(&name)? {
            Some((places, of_first, normals)) if places == shape && of_first == first => Some(normals),
            Some((_, _, normals)) if normals.len() == 1 => {
                Some(host::filled(&name, points.len(), normals[0])?)
            }
            Some(([a, b], ..)) => {
                return Err(Error::input(
                    format!("{name} holds {a} x {b} normals for {} x {} points", shape[0], shape[1]),
                    "give one normal per point, in the shape of the points, or a single one",
                ));
            }
            None => None,
        };
        Ok(Some(SidePoints { shape, first, points, normals }))
    }

    /// Numbers of points along the first and the second axis of the scan; `reversed` if the axes of `data` are.
    fn scan(&self, reversed: bool) -> [usize; 2] {
        let [a, b] = self.shape;
        // A reversed file has reversed points too, [Y, X, 3]. If it has [3, X, Y] all the same, the order is X, Y.
        if reversed && !self.first { [b, a] } else { [a, b] }
    }

    /// True if these are the points of a scan of this shape: as a grid, or as one list of all.
    fn fits(&self, reversed: bool, scan: [usize; 2]) -> bool {
        let is_list = self.shape.contains(&1) && self.points.len() == scan[0] * scan[1];
        is_list || self.scan(reversed) == scan
    }

    /// The points in the order of the scan, first axis slowest. `scan` is the scan's shape by `data`.
    fn ordered(&self, reversed: bool, scan: [usize; 2]) -> SidePoints {
        let own = self.scan(reversed);
        let is_list = own != scan && self.fits(reversed, scan);
        let [x, y] = if is_list { scan } else { own };
        // A list is stored like the histograms: in a reversed file, the first axis of the scan is the fastest.
        let swapped = reversed && (is_list || !self.first);
        let from = |p: usize| if swapped { (p % y) * x + p / y } else { p };
        let pick = |all: &[DVec3]| (0..all.len()).map(|p| all[from(p)]).collect::<Vec<_>>();
        SidePoints {
            shape: [x, y],
            first: self.first,
            points: pick(&self.points),
            normals: self.normals.as_deref().map(pick),
        }
    }
}

/// The axes of `data`.
struct DataAxes {
    reversed: bool,
    /// Sizes of colour, t, bounce, sx, sy and, non-confocal, lx, ly.
    size: Vec<usize>,
}

impl DataAxes {
    fn of(shape: &[usize], [sensors, lasers]: [&SidePoints; 2], bins: Option<usize>) -> Result<DataAxes> {
        if !(4..=7).contains(&shape.len()) {
            return Err(Error::input(
                format!("data has {} axes: {shape:?}", shape.len()),
                "data is (colour, t, bounce, sx, sy), followed by lx, ly if not confocal, or reversed",
            ));
        }
        let fits = |reversed: bool| {
            let mut size = shape.to_vec();
            if reversed {
                size.reverse();
            }
            // MATLAB drops trailing axes of length 1, such as a single colour.
            if size.len().is_multiple_of(2) {
                size.insert(0, 1);
            }
            let lasers = size.len() == 5 || lasers.fits(reversed, [size[5], size[6]]);
            let sensors = sensors.fits(reversed, [size[3], size[4]]);
            let good = sensors && lasers && bins.is_none_or(|t| t == size[1]);
            good.then_some(DataAxes { reversed, size })
        };
        match (fits(false), fits(true)) {
            (Some(axes), None) | (None, Some(axes)) => Ok(axes),
            // Both orders fit the lengths: the data are in the order of the points.
            (Some(plain), Some(reversed)) => Ok(if sensors.first { plain } else { reversed }),
            (None, None) => Err(Error::input(
                format!(
                    "data has shape {shape:?} for {} x {} camera points and {} x {} laser points{}",
                    sensors.shape[0],
                    sensors.shape[1],
                    lasers.shape[0],
                    lasers.shape[1],
                    bins.map_or(String::new(), |t| format!(" and t = {t} bins"))
                ),
                "data is (colour, t, bounce, sx, sy), followed by lx, ly if not confocal, or reversed",
            )),
        }
    }

    /// Histograms pair by pair, laser points slowest, summed over colours and the kept bounces.
    ///
    /// # Errors
    /// `Kind::Memory` if they do not fit.
    fn gather(&self, counts: &Counts, kept: Range<usize>) -> Result<Vec<f32>> {
        let axes = self.size.len();
        // Stride in the file of each axis of the format.
        let mut step = vec![1usize; axes];
        if self.reversed {
            (1..axes).for_each(|a| step[a] = step[a - 1] * self.size[a - 1]);
        } else {
            (0..axes - 1).rev().for_each(|a| step[a] = step[a + 1] * self.size[a + 1]);
        }
        let (bins, sensors) = (self.size[1], self.size[3] * self.size[4]);
        let lasers: usize = self.size[5..].iter().product();
        let mut histograms = host::room("the counts", lasers * sensors * bins)?;
        for laser in 0..lasers {
            for sensor in 0..sensors {
                let mut at = sensor / self.size[4] * step[3] + sensor % self.size[4] * step[4];
                if axes == 7 {
                    at += laser / self.size[6] * step[5] + laser % self.size[6] * step[6];
                }
                for bin in 0..bins {
                    let all = (0..self.size[0]).flat_map(|c| kept.clone().map(move |b| (c, b)));
                    let value = |(c, b): (usize, usize)| {
                        counts.values[at + bin * step[1] + c * step[0] + b * step[2]]
                    };
                    histograms.push(all.map(value).sum());
                }
            }
        }
        Ok(histograms)
    }
}
