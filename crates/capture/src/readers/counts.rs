//! Arrays of counts.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::glance::{self, Glance};
use super::points::squeezed;
use crate::data::histogram_figures;
use crate::error::{Error, Result};
use crate::files::archive::Npz;
use crate::files::array::{Element, Head, transpose, unread};
use crate::host;

/// An array of counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Counts {
    /// Lengths of its axes, the slowest first.
    pub shape: Vec<usize>,
    /// In C order.
    pub values: Vec<f32>,
}

impl Counts {
    /// Whether the values are photon counts: whole and not negative, however they are stored.
    pub fn whole(&self) -> bool {
        histogram_figures::whole(&self.values)
    }
}

/// The shape of an array of counts in an archive, which are not read.
pub(super) fn shape(npz: &mut Npz, name: &str, wanted: &str) -> Result<Vec<usize>> {
    let (head, _) = npz.stream(name)?.ok_or_else(|| npz.missing(name, wanted))?;
    if head.shape.contains(&0) {
        return Err(Error::input(
            format!("{name} has shape {:?}: it holds no bin, or no pair", head.shape),
            "write the capture again: it has to hold at least one bin of one pair",
        ));
    }
    Ok(head.shape)
}

/// The values of an array of counts. What unpacks to far more than the file is looked at first.
pub(super) fn read(npz: &mut Npz, name: &str, wanted: &str) -> Result<Vec<f32>> {
    look(npz, name)?;
    let array = npz.whole(name)?.ok_or_else(|| npz.missing(name, wanted))?;
    Ok(array.to_f32())
}

fn look(npz: &mut Npz, name: &str) -> Result<()> {
    if npz.sizes(name).is_some_and(|[size, packed]| glance::is_wanted(size, packed))
        && let Some((head, mut elements)) = npz.stream(name)?
    {
        let mut glance = Glance::default();
        let mut left = head.shape.iter().fold(1usize, |n, d| n.saturating_mul(*d));
        while left > 0 {
            let part = left.min(glance::AT_ONCE);
            glance.take(&head.part(&mut elements, part).map_err(|e| e.at(format!("array {name}")))?.to_f32());
            left -= part;
        }
        glance.finish(name)?;
    }
    Ok(())
}

/// Values that are in memory beside the histograms while an array is turned: some bins of all pairs, in pieces that fit a cache.
const TURNED: usize = 1 << 22;
const PIECE: usize = 1 << 17;
/// Pairs and bins that are transposed together: a part of both arrays that stays in the nearest cache.
const TILE: [usize; 2] = [32, 64];

/// The histograms `[pair * bins + bin]` of an array [T, ...] of counts, and whether all are photon counts.
pub(super) fn histograms(
    npz: &mut Npz,
    name: &str,
    wanted: &str,
    [bins, pairs]: [usize; 2],
) -> Result<(Vec<f32>, bool)> {
    look(npz, name)?;
    let (head, mut elements) = npz.stream(name)?.ok_or_else(|| npz.missing(name, wanted))?;
    let place = |e: Error| e.at(format!("array {name}"));
    if head.fortran {
        let left = elements.left();
        let array = head.whole(&mut elements, left).map_err(place)?;
        let turned = transpose(&array.to_f32(), bins, pairs)?;
        let whole = histogram_figures::whole(&turned);
        return Ok((turned, whole));
    }
    head.check(elements.left()).map_err(place)?;
    let mut turned = host::zeros("the counts", pairs * bins)?;
    let at_once = (TURNED / pairs.max(1)).clamp(1, bins);
    let mut part = host::zeros("a part of the counts", at_once * pairs)?;
    let size = head.element.size();
    let is_unsigned =
        matches!(head.element, Element::Bool | Element::U8 | Element::U16 | Element::U32 | Element::U64);
    let whole = AtomicBool::new(true);
    for first in (0..bins).step_by(at_once) {
        let count = at_once.min(bins - first);
        let slots: Vec<_> = part[..count * pairs].chunks_mut(PIECE).map(Mutex::new).collect();
        let take = |number: usize, bytes: &[u8]| {
            let mut slot = slots[number].lock().unwrap_or_else(PoisonError::into_inner);
            head.decode(bytes, &mut slot);
            if !is_unsigned && whole.load(Relaxed) && !histogram_figures::whole(&slot) {
                whole.store(false, Relaxed);
            }
        };
        elements.pieces(count * pairs * size, PIECE * size, &take).map_err(|e| place(unread(e)))?;
        drop(slots);
        let rows = turned.par_chunks_mut(TILE[0] * bins).enumerate();
        rows.for_each(|(group, rows)| {
            turn_into(rows, bins, first, &part[..count * pairs], pairs, group * TILE[0])
        });
    }
    Ok((turned, whole.into_inner()))
}

/// Writes the counts `part` [bin, pair] to the bins from `first` on of the `rows` of the pairs from `pair` on.
fn turn_into(rows: &mut [f32], bins: usize, first: usize, part: &[f32], pairs: usize, pair: usize) {
    let here = rows.len() / bins;
    let mut tile = [[0.0f32; TILE[1]]; TILE[0]];
    for (number, lines) in part.chunks(TILE[1] * pairs).enumerate() {
        let count = lines.len() / pairs;
        for (bin, line) in lines.chunks_exact(pairs).enumerate() {
            tile.iter_mut().zip(&line[pair..pair + here]).for_each(|(row, value)| row[bin] = *value);
        }
        let at = first + number * TILE[1];
        let to = rows.chunks_exact_mut(bins).zip(&tile);
        to.for_each(|(row, tile)| row[at..at + count].copy_from_slice(&tile[..count]));
    }
}

/// The largest value, which decides the integer type to store; `None` unless all values are whole and not negative.
pub(super) fn largest_count(values: &[f32]) -> Option<f32> {
    values.iter().try_fold(0.0f32, |largest, &v| (v >= 0.0 && v.fract() == 0.0).then(|| largest.max(v)))
}

/// The error of an npy file.
pub(super) fn alone_in_npy(path: &Path) -> Error {
    let head = File::open(path)
        .map_err(|e| Error::input(format!("cannot be read: {e}"), "check the path and the disk"))
        .and_then(|file| Head::read(&mut BufReader::new(file)));
    let what = "is a single npy array, without wall points and bin width";
    head.map_or_else(|e| e, |head| alone(what, r#"np.load("FILE")"#, &head.shape))
}

/// Pixels of a picture on a side at least.
const PICTURE: usize = 16;

/// The error of an array of this shape if it is a picture with colours: an axis of 3 or 4 at either end of two long ones.
pub(super) fn picture(name: &str, shape: &[usize]) -> Option<Error> {
    let (colours, [a, b]) = match *shape {
        [a, b, c @ (3 | 4)] | [c @ (3 | 4), a, b] => (c, [a, b]),
        _ => return None,
    };
    (a >= PICTURE && b >= PICTURE).then(|| {
        Error::input(
            format!("{name} has shape {shape:?}, as of a picture of {a} x {b} pixels in {colours} colours, not of histograms"),
            "give the histograms of the scan: a picture holds none",
        )
    })
}

/// What is wrong with an array of three axes whose name says that it is a result.
pub(super) fn of_a_result(name: &str, shape: &[usize]) -> String {
    format!("{name} {shape:?} is named as a reconstructed volume, not as histograms")
}

/// Words in the names of results.
const RESULTS: [&str; 8] = ["volume", "vol", "recon", "reconstruction", "result", "albedo", "voxels", "rho"];

/// Whether an array of this name is a result: one of its words is that of a result.
pub(super) fn is_result(name: &str) -> bool {
    let name = name.rsplit('/').next().unwrap_or(name).to_lowercase();
    name.split(['_', '-', '.', ' '])
        .any(|word| RESULTS.contains(&word.trim_end_matches(|c: char| c.is_ascii_digit())))
}

/// The error of an npz file without points. Its largest array is taken as the counts.
pub(super) fn alone_in_npz(npz: &mut Npz) -> Error {
    let names = npz.names();
    let has = |wanted: &[&str]| wanted.iter().all(|name| names.iter().any(|other| other == name));
    if has(&["albedo", "extent"]) || has(&["gt_depth"]) {
        return Error::input(
            format!("holds {}: a result or a truth, not histograms", names.join(", ")),
            "give the capture that it was made from",
        );
    }
    let mut largest = ("H".to_string(), vec![]);
    for name in &names {
        let count = |shape: &[usize]| shape.iter().fold(1usize, |n, d| n.saturating_mul(*d));
        if let Ok(Some((head, _))) = npz.stream(name)
            && count(&head.shape) > count(&largest.1)
        {
            largest = (name.clone(), head.shape);
        }
    }
    if is_result(&largest.0) && largest.1.len() == 3 {
        return Error::input(
            of_a_result(&largest.0, &largest.1),
            "give the capture that it was made from; if it does hold histograms, store them as H with sensor_xyz, laser_xyz and delta_t",
        );
    }
    let what = format!("holds {}, but no sensor_xyz and laser_xyz beside H and delta_t", names.join(", "));
    alone(&what, &format!(r#"np.load("FILE")["{}"]"#, largest.0), &largest.1)
}

/// The expression for H of a tensor of mitransient: [Y, X, T, C], or exhaustive [Sy, Sx, Ly, Lx, T, C]; `None` for other shapes. Four
/// channels are a Stokes vector, of which the first is the intensity (mitransient 1.3.1, `TransientImageBlock` and `TransientHDRFilm`).
fn of_tensor(name: &str, shape: &[usize]) -> Option<String> {
    let order = match shape.len() {
        4 => "2, 1, 0",
        6 => "4, 3, 2, 1, 0",
        _ => return None,
    };
    match shape.last() {
        Some(1 | 3) => Some(format!("{name}.sum(-1).transpose({order})")),
        Some(4) => Some(format!("{name}[..., 0].transpose({order})")),
        _ => None,
    }
}

/// How to fix an `H` of a shape that does not fit its points. `laser`, `sensor`: lengths of the axes of the points; `in_npz`: with
/// the lines that rewrite an npz file.
pub(super) fn layout_hint(shape: &[usize], laser: &[usize], sensor: &[usize], in_npz: bool) -> String {
    let is_of = |places: &[usize], rows: &[usize]| {
        let places = squeezed(places);
        places.is_empty() || places == squeezed(&[rows[1], rows[0]]) || places == [rows[0] * rows[1]]
    };
    let is_tensor = match shape.len() {
        4 => is_of(laser, shape) && is_of(sensor, shape),
        6 => is_of(laser, &shape[2..]) && is_of(sensor, shape),
        _ => false,
    };
    match of_tensor("H", shape).filter(|_| is_tensor) {
        Some(h) if in_npz => format!(
            r#"H has the axes of mitransient; bins come first here:
import numpy as np; c = dict(np.load("FILE")); H = c["H"]; H = {h}
np.savez("capture.npz", **{{**c, "H": H}})"#
        ),
        Some(h) => format!("H has the axes of mitransient; bins come first here: H = {h}"),
        None => "store H as [T, X, Y] (bins, then the scan along x and y), or, with every combination of laser and sensor points, as \
                 [T, Lx, Ly, Sx, Sy] with laser_xyz [Lx, Ly, 3] and sensor_xyz [Sx, Sy, 3]"
            .into(),
    }
}

/// Bins of the histograms of PicoQuant's instruments (PicoHarp 300, HydraHarp 400: MAXHISTLEN): more than the points of a scan.
const LONGEST: usize = 1 << 16;

/// Which axis of a matrix of histograms is that of the points, and the scan where it is known: by `lists` of coordinates beside it, by
/// the longest histograms, or as a square.
pub(super) fn axis_of_points(sides: [usize; 2], lists: &[usize]) -> Option<(usize, [usize; 2])> {
    let of_lists = || {
        let pairs =
            lists.iter().enumerate().flat_map(|(at, a)| lists[at + 1..].iter().map(move |b| [*a, *b]));
        let mut axes =
            pairs.filter_map(|pair| Some((sides.iter().position(|n| *n == pair[0] * pair[1])?, pair)));
        axes.next()
    };
    let square = |axis: usize| {
        let side = sides[axis].isqrt();
        (side * side == sides[axis]).then_some((axis, [side; 2]))
    };
    let by_length = || square(1 - sides.iter().position(|n| *n == LONGEST)?);
    of_lists().or_else(by_length).or_else(|| square(0)).or_else(|| square(1))
}

/// The error of counts that come alone, with the lines of Python that make a capture of them. `load`: the expression that reads
/// them, of this shape.
pub(super) fn alone(what: &str, load: &str, shape: &[usize]) -> Error {
    if let Some(error) = picture("the array", shape) {
        return error;
    }
    let known = of_tensor("t", shape).map(|h| format!("t = {load}; H = {h}"));
    // The longest of three axes is that of the bins.
    let is_last = matches!(*shape, [_, LONGEST]) || matches!(*shape, [x, y, t] if t > x.max(y));
    let plain = || if is_last { format!("H = np.moveaxis({load}, -1, 0)") } else { format!("H = {load}") };
    let h = known.unwrap_or_else(plain);
    let points = match shape.len() {
        0..=2 => {
            r#"p = np.loadtxt("POINTS", delimiter=",")  # H is [T, P]: a line x,y,z for each of P, metres
l = s = p"#
        }
        _ => {
            r#"p = lambda n: np.stack(np.meshgrid(*[np.linspace(-.5, .5, k) for k in n], [0], indexing="ij"), -1)[:, :, 0]
l, s = p(H.shape[1:3]), p(H.shape[-2:])  # of one laser point: l = [[x, y, z]]"#
        }
    };
    Error::input(
        what,
        format!(
            r#"make a capture of it: H [T, X, Y] with the bins first, or [T, Lx, Ly, Sx, Sy]; points [X, Y, 3] on the wall in metres, bins in metres of path:
import numpy as np; {h}
{points}
np.savez("capture.npz", H=H, sensor_xyz=s, laser_xyz=l, delta_t=32e-12 * 299792458)
or, if an instrument wrote its histograms (points, bins) or time tags, use `histogram` with the points of the scan"#
        ),
    )
}
