//! Transient images of the NLoS benchmark of Bonn (Klein, Laurenzis, Michels, Hullin 2018), `.ti`, version TI04.
//!
//! Sources: their page *Transient Image Files* (nlos.cs.uni-bonn.de), and `LibTransientImage`, their reader in C++. Little endian,
//! nothing between the blocks:
//!
//! | block | content |
//! |---|---|
//! | header, 28 bytes | `TI04`; uint32 pixel mode, pixels, bins; float32 time of the first bin, distance of two bins; uint32 bytes of the third block |
//! | counts | float32 [v, u, bin] |
//! | places, 68 bytes in mode 10 | uint32 pixels along u and v; float32 x, y, z of the top left, top right, bottom left and bottom right corner of the reflector, and of the laser's spot on it |
//! | properties | JSON to the end of the file; not read |
//!
//! Both legs are taken off (their word is *unwarped*). Times are path lengths in the unit of the coordinates, and name the middles
//! of bins. Of TI04, mode 10 (a grid of pixels) is the only one that their viewer and their reader know. TI00 and TI01 hold no
//! places. What the sources leave open: whether corners are those of the reflector or the middles of its outermost pixels, which are
//! half a pixel apart; the middles are taken.
//!
//! Axes: the coordinates in the file are kept and taken as right-handed. The wall faces those who see the four corners as they are named.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use glam::DVec3;

use super::frame;
use super::read_options::ReadOptions;
use crate::error::{Error, Result};
use crate::host;
use crate::{Capture, histogram_figures};

const HEADER: usize = 28;
const PLACES: usize = 68;
/// The mode with a grid of pixels.
const GRID: u32 = 10;
/// The laser's spot is on the wall if it is this near to it, as a share of the wall's width.
const NEAR: f64 = 0.05;

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for another version or mode, or blocks that do not fit the file. `Kind::Options` for a bin width.
pub(super) fn read(path: &Path, given: &ReadOptions, notes: &mut Vec<String>) -> Result<Capture> {
    given.no_bin_width("a transient image")?;
    let unreadable = |e: std::io::Error| Error::input(format!("cannot be read: {e}"), "check the disk");
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    let mut file = BufReader::new(file);
    let mut head = [0; HEADER];
    file.read_exact(&mut head).map_err(|_| cut(length))?;
    let [pixels, bins] = sizes(&head)?;
    // The file is as long as its header says, so that the counts fit in memory as they fit on the disk.
    let counts = pixels.checked_mul(bins).filter(|n| *n > 0).ok_or_else(|| cut(length))?;
    let values = counts.checked_mul(4).ok_or_else(|| cut(length))?;
    if values.checked_add((HEADER + PLACES) as u64).is_none_or(|wanted| wanted > length) {
        return Err(cut(length));
    }
    let mut histograms = host::room("the counts", counts as usize)?;
    let mut block = [0; 1 << 14];
    let mut left = values as usize;
    while left > 0 {
        let block = &mut block[..left.min(1 << 14)];
        file.read_exact(block).map_err(unreadable)?;
        histograms.extend(block.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)));
        left -= block.len();
    }
    let mut places = [0; PLACES];
    file.read_exact(&mut places).map_err(|_| cut(length))?;
    let capture = placed(&head, &places, pixels, bins as usize, histograms, notes)?;
    Ok(frame::in_order(frame::facing_z(capture, None, notes)))
}

fn cut(length: u64) -> Error {
    Error::input(
        format!("the transient image does not fit its {length} bytes"),
        "the file is cut or damaged: copy or download it again",
    )
}

fn word(bytes: &[u8], at: usize) -> [u8; 4] {
    let mut word = [0; 4];
    word.copy_from_slice(&bytes[4 * at..4 * at + 4]);
    word
}

fn whole(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(word(bytes, at))
}

fn real(bytes: &[u8], at: usize) -> f64 {
    f64::from(f32::from_le_bytes(word(bytes, at)))
}

/// Pixels and bins of a header of the version and mode that are read.
fn sizes(head: &[u8; HEADER]) -> Result<[u64; 2]> {
    if &head[..4] != b"TI04" {
        return Err(Error::input(
            format!("is a transient image of version {}, which holds no points", head[..4].escape_ascii()),
            "write it as TI04 with LibTransientImage of the toolbox of its authors, and set the four corners and the laser",
        ));
    }
    let (mode, block) = (whole(head, 1), whole(head, 6));
    if mode != GRID || block as usize != PLACES {
        return Err(Error::input(
            format!("is a transient image with pixels of mode {mode} and {block} bytes of places"),
            "only mode 10, a grid of pixels with 68 bytes of places, is read: write the capture as npz (docs/guide/formats.md)",
        ));
    }
    Ok([2, 3].map(|at| u64::from(whole(head, at))))
}

/// The capture of these counts with its points.
fn placed(
    head: &[u8; HEADER],
    places: &[u8; PLACES],
    pixels: u64,
    bins: usize,
    histograms: Vec<f32>,
    notes: &mut Vec<String>,
) -> Result<Capture> {
    let [nu, nv] = [0, 1].map(|at| whole(places, at) as usize);
    let [first, width] = [4, 5].map(|at| real(head, at));
    if (nu as u64).checked_mul(nv as u64) != Some(pixels) {
        return Err(Error::input(
            format!("the transient image has {pixels} pixels, and {nu} x {nv} places"),
            "the file is damaged: copy or download it again",
        ));
    }
    let point = |i: usize| DVec3::from_array([0, 1, 2].map(|axis| real(places, 2 + 3 * i + axis)));
    let [top_left, top_right, bottom_left, bottom_right, laser] = [0, 1, 2, 3, 4].map(point);
    let (right, down) = (top_right - top_left, bottom_left - top_left);
    let normal = down.cross(right).try_normalize().filter(|n| n.is_finite());
    let Some(normal) = normal else {
        return Err(Error::input(
            format!("the corners of the reflector span no area: {top_left}, {top_right}, {bottom_left}"),
            "set the corners in the file: it may have been made of an older version, which has none",
        ));
    };
    let off = (laser - top_left).dot(normal).abs();
    if off.is_nan() || off > NEAR * right.length().max(down.length()) {
        return Err(Error::input(
            format!("the laser is {off:.3} off the reflector"),
            "store the place of the laser's spot on the reflector: the file's times begin there",
        ));
    }
    let share = |i: usize, n: usize| i as f64 / (n.max(2) - 1) as f64;
    let at = |u: usize, v: usize| {
        let (a, b) = (share(u, nu), share(v, nv));
        top_left.lerp(top_right, a).lerp(bottom_left.lerp(bottom_right, a), b)
    };
    let places = (0..nv).flat_map(|v| (0..nu).map(move |u| (u, v)));
    let sensor = host::collected("the wall points", nu * nv, places.map(|(u, v)| at(u, v)))?;
    notes.push(format!(
        "times are taken as path lengths in metres, {first} as the middle of the first bin, and the corners as the middles of the \
         outermost pixels: if they are the reflector's edges, the wall is a pixel \
         smaller, and its size has to be given"
    ));
    let alike = |vector| host::filled("the wall points", nu * nv, vector);
    let capture = Capture {
        integer_counts: histogram_figures::whole(&histograms),
        laser_normal: Some(alike(normal)?),
        sensor_normal: Some(alike(normal)?),
        t_start: first - 0.5 * width,
        ..Capture::new([nv, nu], alike(laser)?, sensor, bins, width, histograms)
    };
    Ok(capture)
}
