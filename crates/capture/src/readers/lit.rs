//! Captures of *Beyond Volumetric Albedo* (Tsai, Sankaranarayanan, Gkioulekas 2019), MATLAB v5 or v7.3.
//!
//! `transient` (pairs, t) counts of a confocal scan and `lighting` (pairs, 3), its points in metres. The bin width is not in these
//! files: their code takes 1.2 mm of path, 4 ps, for all. What their renderer writes has `gt_transient` in place of `transient`,
//! `bin_width` in metres and `sensor` (pairs, 3).
//!
//! Axes: in files with `gt_transient` the coordinates are kept; nothing in them says whether they are right-handed. The measured `transient` is made of LCT's `rect_data` (d1, d2, t)
//! by a reshape, with d1 as x and d2 as y of `lighting` (`exp_s/compute_init_mesh.m`): x runs to the left and y down, as
//! [`super::lct`] says of d1 and d2.

use glam::DVec3;

use super::frame;
use super::read_options::ReadOptions;
use super::unread::Unread;
use super::variables::Variables;
use crate::Capture;
use crate::error::{Error, Result};

const PICOSECONDS: f64 = 4.0;

/// Whether the file holds such a capture.
pub(super) fn is_one(file: &Variables) -> bool {
    file.have(&["lighting"]) && (file.have(&["transient"]) || file.have(&["gt_transient"]))
}

/// Finds a capture without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not agree, `Kind::Options` for a bin width beside the file's own.
pub(super) fn read<'f>(
    file: &'f Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<Unread<'f>> {
    let rendered = file.have(&["gt_transient"]);
    let array = if rendered { "gt_transient" } else { "transient" };
    let counts = file.counts_shape(array)?;
    let points = |name: &str| -> Result<Option<Vec<DVec3>>> {
        let Some((shape, v)) = file.numbers(name)? else { return Ok(None) };
        let of_pairs = |found: &Vec<DVec3>| matches!(counts[..], [_, pairs] if pairs == found.len());
        let found = frame::points(&shape, &v).filter(of_pairs).ok_or_else(|| {
            Error::input(
                format!(
                    "{array} has shape {counts:?} and {name} {shape:?} (MATLAB order reversed), which do not agree"
                ),
                format!("{array} is (pairs, t) and {name} (pairs, 3), of the same pairs"),
            )
        });
        found.map(Some)
    };
    let mut laser = points("lighting")?.ok_or_else(|| file.missing("lighting"))?;
    let mut sensor = points("sensor")?.unwrap_or_else(|| laser.clone());
    let bin_width = match file.number("bin_width")? {
        Some(width) => {
            given.no_bin_width("a surface-optimisation capture with bin_width")?;
            width
        }
        None => given.bin_width("a surface-optimisation capture", Some(PICOSECONDS), notes)?,
    };
    if !rendered {
        for p in laser.iter_mut().chain(&mut sensor) {
            p.y = -p.y;
        }
        notes.push(
            "x of lighting runs to the left and y down, as in the LCT capture that such a file is made of"
                .into(),
        );
    }
    let scan = frame::rows(&laser).unwrap_or([laser.len(), 1]);
    let outline = Capture::new(scan, laser, sensor, counts[0], bin_width, vec![]);
    Ok(Unread::in_order(outline, file, array).in_our_order())
}
