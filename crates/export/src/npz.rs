//! Maps and truth as npz files.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::archive::{Npz, npz_bytes};
use crate::files::array::Array;
use crate::files::atomic;
use crate::maps::{Layer, Maps, Truth};

const MAPS: &str = "albedo, depth, normal, mask and extent, as reconstruct writes them";
const TRUTH: &str = "gt_depth [nx, ny], gt_normal [nx, ny, 3], gt_mask [nx, ny] and gt_extent";

/// Keys of the expected depth error of the first layer, and of both layers.
const DEPTH_ERROR: [&str; 2] = ["depth_error", "layers_depth_error"];

/// Key of the probability of surface.
const PROBABILITY: &str = "probability";

/// Keys of albedo, depth, normal and mask of both layers. Truth has no albedos.
const MAPS_LAYERS: [&str; 4] = ["layers_albedo", "layers_depth", "layers_normal", "layers_mask"];
const TRUTH_LAYERS: [&str; 4] = ["", "gt_layers_depth", "gt_layers_normal", "gt_layers_mask"];

/// Writes `albedo`, `depth` [nx, ny] and `normal` [nx, ny, 3] as float32 (NaN = no surface), `mask` [nx, ny] as bool,
/// `extent` (xmin, xmax, ymin, ymax) as float64, the scalar `mask_fraction` as float64 if given, and `depth_error`
/// and `probability` [nx, ny] as float32 if known. With a second layer, `layers_albedo`, `layers_depth`, `layers_mask`,
/// `layers_depth_error` [2, nx, ny] and `layers_normal` [2, nx, ny, 3] have both.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_maps(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, bytes)
}

/// The file of [`write_maps`].
pub(super) fn bytes(maps: &Maps) -> Result<Vec<u8>> {
    npz_bytes(&arrays(maps)?)
}

/// The arrays of [`write_maps`] with their names.
pub(super) fn arrays(maps: &Maps) -> Result<Vec<(&'static str, Array)>> {
    maps.check()?;
    let shape = [maps.nx, maps.ny];
    let mut arrays = vec![
        ("albedo", Array::from_f32(&shape, &maps.albedo)),
        ("depth", Array::from_f32(&shape, &maps.depth)),
        ("normal", Array::from_f32(&[maps.nx, maps.ny, 3], maps.normal.as_flattened())),
        ("mask", Array::from_bool(&shape, &maps.mask)),
        ("extent", Array::from_f64(&[4], &maps.extent)),
    ];
    if let Some(fraction) = maps.mask_fraction {
        arrays.push(("mask_fraction", Array::from_f64(&[], &[fraction])));
    }
    if let Some(depth_error) = &maps.depth_error {
        arrays.push((DEPTH_ERROR[0], Array::from_f32(&shape, depth_error)));
        if let Some(second) = maps.behind.as_ref().and_then(|b| b.depth_error.as_ref()) {
            let both = [&depth_error[..], second].concat();
            arrays.push((DEPTH_ERROR[1], Array::from_f32(&[2, maps.nx, maps.ny], &both)));
        }
    }
    if let Some(probability) = &maps.probability {
        arrays.push((PROBABILITY, Array::from_f32(&shape, probability)));
    }
    if let Some(behind) = &maps.behind {
        let albedo = [&maps.albedo[..], &behind.albedo].concat();
        arrays.push(("layers_albedo", Array::from_f32(&[2, maps.nx, maps.ny], &albedo)));
        let first = [&maps.depth[..], maps.normal.as_flattened()];
        arrays.extend(layers(MAPS_LAYERS, shape, first, &maps.mask, behind));
    }
    Ok(arrays)
}

/// Reads maps. A missing `mask` is derived from the albedo by `mask_fraction` or [`Maps::MASK_FRACTION`].
///
/// # Errors
/// `Kind::Input` for a missing or damaged file, missing arrays or shapes that do not agree.
pub fn read_maps(path: &Path) -> Result<Maps> {
    let read = || -> Result<Maps> {
        let mut npz = Npz::open(path)?;
        let (shape, albedo) = plane(&mut npz, "albedo", MAPS)?;
        let fraction = npz.scalar("mask_fraction")?;
        let mask = match npz.get("mask")? {
            Some(mask) => mask.to_bool(),
            None => Maps::mask_of(&albedo, fraction.unwrap_or(Maps::MASK_FRACTION)),
        };
        let maps = Maps {
            nx: shape[0],
            ny: shape[1],
            extent: extent(&mut npz, "extent", MAPS)?,
            albedo,
            depth: plane(&mut npz, "depth", MAPS)?.1,
            normal: vectors(&npz.require("normal", MAPS)?, "normal")?,
            mask,
            mask_fraction: fraction,
            depth_error: match npz.get(DEPTH_ERROR[0])? {
                Some(_) => Some(plane(&mut npz, DEPTH_ERROR[0], MAPS)?.1),
                None => None,
            },
            probability: match npz.get(PROBABILITY)? {
                Some(_) => Some(plane(&mut npz, PROBABILITY, MAPS)?.1),
                None => None,
            },
            behind: second(&mut npz, MAPS_LAYERS, shape)?,
        };
        maps.check().map(|()| maps)
    };
    read().map_err(|e| e.at(path.display()))
}

/// Writes truth: `gt_depth` [nx, ny] and `gt_normal` [nx, ny, 3] as float32 (NaN = miss), `gt_mask` as bool,
/// `gt_extent` as float64, and `gt_albedo` [nx, ny] as float32 (NaN = miss) where it is known. With a second layer, `gt_layers_depth`, `gt_layers_mask` [2, nx, ny] and
/// `gt_layers_normal` [2, nx, ny, 3] have both.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_truth(path: &Path, truth: &Truth) -> Result<()> {
    truth.check()?;
    let shape = [truth.nx, truth.ny];
    let mut arrays = vec![
        ("gt_depth", Array::from_f32(&shape, &truth.depth)),
        ("gt_normal", Array::from_f32(&[truth.nx, truth.ny, 3], truth.normal.as_flattened())),
        ("gt_mask", Array::from_bool(&shape, &truth.mask)),
        ("gt_extent", Array::from_f64(&[4], &truth.extent)),
    ];
    if let Some(albedo) = &truth.albedo {
        arrays.push(("gt_albedo", Array::from_f32(&shape, albedo)));
    }
    if let Some(behind) = &truth.behind {
        let first = [&truth.depth[..], truth.normal.as_flattened()];
        arrays.extend(layers(TRUTH_LAYERS, shape, first, &truth.mask, behind));
    }
    atomic::write(path, &npz_bytes(&arrays)?)
}

/// Reads truth. Without `gt_mask`, pixels with a finite depth are the mask. Without `gt_normal`, all normals are NaN.
///
/// # Errors
/// `Kind::Input` for a missing or damaged file, missing arrays or shapes that do not agree.
pub fn read_truth(path: &Path) -> Result<Truth> {
    let read = || -> Result<Truth> {
        let mut npz = Npz::open(path)?;
        let (shape, depth) = plane(&mut npz, "gt_depth", TRUTH)?;
        let mask = match npz.get("gt_mask")? {
            Some(mask) => mask.to_bool(),
            None => depth.iter().map(|d| d.is_finite()).collect(),
        };
        let normal = match npz.get("gt_normal")? {
            Some(normal) => vectors(&normal, "gt_normal")?,
            None => vec![[f32::NAN; 3]; depth.len()],
        };
        let albedo = match npz.get("gt_albedo")? {
            Some(_) => Some(plane(&mut npz, "gt_albedo", TRUTH)?.1),
            None => None,
        };
        let extent = extent(&mut npz, "gt_extent", TRUTH)?;
        let behind = second(&mut npz, TRUTH_LAYERS, shape)?;
        let truth = Truth { nx: shape[0], ny: shape[1], extent, depth, normal, mask, albedo, behind };
        truth.check().map(|()| truth)
    };
    read().map_err(|e| e.at(path.display()))
}

/// Depth, mask and normals of both layers as arrays of these names. `first`: depth and normals of the first one.
fn layers(
    names: [&'static str; 4],
    [nx, ny]: [usize; 2],
    first: [&[f32]; 2],
    mask: &[bool],
    behind: &Layer,
) -> [(&'static str, Array); 3] {
    let depth = [first[0], &behind.depth].concat();
    let normal = [first[1], behind.normal.as_flattened()].concat();
    [
        (names[1], Array::from_f32(&[2, nx, ny], &depth)),
        (names[2], Array::from_f32(&[2, nx, ny, 3], &normal)),
        (names[3], Array::from_bool(&[2, nx, ny], &[mask, &behind.mask].concat())),
    ]
}

/// The second of the layers under these keys; `None` without layers. Missing albedos are derived from the mask.
fn second(npz: &mut Npz, names: [&str; 4], [nx, ny]: [usize; 2]) -> Result<Option<Layer>> {
    if npz.get(names[1])?.is_none() {
        return Ok(None);
    }
    let count = nx * ny;
    let is_told = !names[0].is_empty() && npz.get(DEPTH_ERROR[1])?.is_some();
    let mut of = |name: &str, shape: &[usize]| -> Result<Array> {
        let array = npz.require(name, "arrays of both layers, [2, nx, ny]")?;
        if array.shape == shape {
            return Ok(array);
        }
        let wanted = format!("{name} holds two layers of the maps' pixels: {shape:?}");
        Err(Error::input(format!("{name} has shape {:?}", array.shape), wanted))
    };
    let depth = of(names[1], &[2, nx, ny])?.to_f32().split_off(count);
    let normal = of(names[2], &[2, nx, ny, 3])?.to_f32().split_off(3 * count);
    let mask = of(names[3], &[2, nx, ny])?.to_bool().split_off(count);
    let albedo = match names[0] {
        "" => mask.iter().map(|m| f32::from(u8::from(*m))).collect(),
        name => of(name, &[2, nx, ny])?.to_f32().split_off(count),
    };
    let normal = normal.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
    let depth_error = match is_told {
        true => Some(of(DEPTH_ERROR[1], &[2, nx, ny])?.to_f32().split_off(count)),
        false => None,
    };
    Ok(Some(Layer { albedo, depth, normal, mask, depth_error }))
}

fn plane(npz: &mut Npz, name: &str, wanted: &str) -> Result<([usize; 2], Vec<f32>)> {
    let array = npz.require(name, wanted)?;
    match array.shape[..] {
        [nx, ny] => Ok(([nx, ny], array.to_f32())),
        _ => Err(Error::input(
            format!("{name} has shape {:?}, not [nx, ny]", array.shape),
            format!("wanted: {wanted}"),
        )),
    }
}

fn extent(npz: &mut Npz, name: &str, wanted: &str) -> Result<[f64; 4]> {
    let array = npz.require(name, wanted)?;
    array.to_f64().try_into().map_err(|_| {
        Error::input(
            format!("{name} has shape {:?}", array.shape),
            format!("{name} holds xmin, xmax, ymin, ymax in metres"),
        )
    })
}

fn vectors(array: &Array, name: &str) -> Result<Vec<[f32; 3]>> {
    if array.shape.len() != 3 || array.shape[2] != 3 {
        return Err(Error::input(
            format!("{name} has shape {:?}", array.shape),
            format!("{name} holds one vector per pixel: [nx, ny, 3]"),
        ));
    }
    Ok(array.to_f32().chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect())
}
