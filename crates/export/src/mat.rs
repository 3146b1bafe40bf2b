//! Maps as a MATLAB v5 file ("MAT-File Format", MathWorks): the arrays of `maps.npz`, indexed as there: `depth(ix, iy)`.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::npz;
use crate::error::{Error, Result};
use crate::files::array::{Array, Element, c_order};
use crate::maps::Maps;

/// Types of elements: characters, dimensions, flags, matrices, deflated ones.
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// Writes the maps.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, bytes)
}

/// The file of [`write`].
pub(super) fn bytes(maps: &Maps) -> Result<Vec<u8>> {
    let mut bytes = format!("{:<116}", "MATLAB 5.0 MAT-file, maps of thirdbounce").into_bytes();
    // No subsystem, version 1.0, little-endian.
    bytes.extend([[0; 8].as_slice(), &[0, 1], b"IM"].concat());
    for (name, array) in npz::arrays(maps)? {
        let deflated = deflated(&element(MATRIX, &matrix(name, &array)))
            .map_err(|e| Error::output(format!("cannot be packed: {e}"), "free some memory"))?;
        bytes.extend(tag(COMPRESSED, deflated.len()));
        bytes.extend(deflated);
    }
    Ok(bytes)
}

fn deflated(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(vec![], Compression::default());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// The content of a matrix element. MATLAB has no array of fewer than two axes.
fn matrix(name: &str, array: &Array) -> Vec<u8> {
    // Class with flags (logical), type of the numbers.
    let (class, kind) = match array.element {
        Element::Bool => (0x0209, 2),
        Element::F32 => (7, 7),
        _ => (6, 9),
    };
    let size = array.element.size();
    let missing = 2usize.saturating_sub(array.shape.len());
    let shape: Vec<usize> = std::iter::repeat_n(1, missing).chain(array.shape.iter().copied()).collect();
    let dimensions: Vec<u8> = shape.iter().flat_map(|n| (*n as i32).to_le_bytes()).collect();
    // The first index runs fastest.
    let back: Vec<usize> = shape.iter().rev().copied().collect();
    let numbers: Vec<u8> =
        c_order(&back).flat_map(|i| array.bytes[i * size..][..size].iter().copied()).collect();
    let flags = [u32::to_le_bytes(class), [0; 4]].concat();
    [
        element(UINT32, &flags),
        element(INT32, &dimensions),
        element(INT8, name.as_bytes()),
        element(kind, &numbers),
    ]
    .concat()
}

fn tag(kind: u32, length: usize) -> Vec<u8> {
    [kind.to_le_bytes(), (length as u32).to_le_bytes()].concat()
}

/// Tag and content, padded to 8 bytes.
fn element(kind: u32, content: &[u8]) -> Vec<u8> {
    let mut bytes = tag(kind, content.len());
    bytes.extend(content);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}
