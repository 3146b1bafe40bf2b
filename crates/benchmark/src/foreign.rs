//! Maps of other programs: npz, OpenEXR or MATLAB (docs/methods.md, "Maps of other programs").
//!
//! Only depths are required. Without albedo, pixels with a depth are the surface; without normals, none are measured;
//! without an extent, the maps have the truth's.

use std::path::{Path, PathBuf};

use exr::meta::attribute::AttributeValue;
use exr::prelude::read_first_flat_layer_from_file;

use thirdbounce::capture::formats::variables::Variables;
use thirdbounce::export::npz;
use thirdbounce::files::archive::Npz;
use thirdbounce::files::array::c_order;
use thirdbounce::maps::Maps;
use thirdbounce::{Error, Result};

/// File names searched in a folder.
const NAMES: [&str; 3] = ["maps.npz", "maps.exr", "maps.mat"];

const ARRAYS: &str = "depth [nx, ny] in metres, and if there are any albedo, mask [nx, ny], normal [nx, ny, 3] and \
                      extent (xmin, xmax, ymin, ymax)";
const CHANNELS: &str = "the channel depth.Z or Z in metres, and if there are any albedo.Y or Y, and normal.X, normal.Y and \
                        normal.Z";

/// Reads maps from a file, or from the first of `maps.npz`, `maps.exr` and `maps.mat` in a folder. `extent` is the
/// default for maps without their own.
///
/// # Errors
/// `Kind::Input` for a file that is missing, damaged or of another kind, missing arrays, or shapes that do not agree.
pub fn read(path: &Path, extent: [f64; 4]) -> Result<Maps> {
    let file = file_of(path)?;
    let ending = file.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
    let read = || -> Result<Maps> {
        let maps = match ending.as_str() {
            "npz" if is_whole(&file)? => npz::read_maps(&file)?,
            "npz" => of_npz(&file)?.whole(extent),
            "exr" => of_exr(&file)?.whole(extent),
            "mat" => of_matlab(&file)?.whole(extent),
            _ => {
                return Err(Error::input(
                    "is not a known file type for maps",
                    "give maps as .npz, .exr or .mat (docs/methods.md lists their arrays)",
                ));
            }
        };
        maps.check().map(|()| maps)
    };
    read().map_err(|e| e.at(file.display()))
}

fn file_of(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        return Ok(path.into());
    }
    let found = NAMES.iter().map(|name| path.join(name)).find(|file| file.is_file());
    found.ok_or_else(|| {
        Error::input(
            format!("{}: holds none of {}", path.display(), NAMES.join(", ")),
            "give the file of the maps itself",
        )
    })
}

/// Content of a file. Values are `[ix * ny + iy]`.
#[derive(Default)]
struct ForeignMaps {
    size: [usize; 2],
    depth: Vec<f32>,
    albedo: Option<Vec<f32>>,
    normal: Option<Vec<[f32; 3]>>,
    mask: Option<Vec<bool>>,
    extent: Option<[f64; 4]>,
}

impl ForeignMaps {
    fn whole(self, extent: [f64; 4]) -> Maps {
        let ForeignMaps { size: [nx, ny], depth, albedo, normal, mask, extent: own } = self;
        let is_there = |z: &f32| z.is_finite() && *z > 0.0;
        let has_albedo = albedo.is_some();
        let albedo =
            albedo.unwrap_or_else(|| depth.iter().map(|z| f32::from(u8::from(is_there(z)))).collect());
        let mut maps = Maps {
            nx,
            ny,
            extent: own.unwrap_or(extent),
            mask: mask.clone().unwrap_or_else(|| Maps::mask_of(&albedo, Maps::MASK_FRACTION)),
            mask_fraction: (mask.is_none() && has_albedo).then_some(Maps::MASK_FRACTION),
            albedo,
            normal: normal.unwrap_or_else(|| vec![[f32::NAN; 3]; depth.len()]),
            depth_error: None,
            probability: None,
            behind: None,
            depth,
        };
        // Many programs write 0 without surface.
        maps.depth.iter_mut().filter(|z| **z <= 0.0).for_each(|z| *z = f32::NAN);
        maps
    }
}

/// Whether an npz has all arrays required by [`npz::read_maps`].
fn is_whole(file: &Path) -> Result<bool> {
    let there = Npz::open(file)?.names();
    Ok(["albedo", "depth", "normal", "extent"].iter().all(|name| there.iter().any(|n| n == name)))
}

/// An npz with depths and optional arrays.
fn of_npz(file: &Path) -> Result<ForeignMaps> {
    let mut all = Npz::open(file)?;
    let depth = all.require("depth", ARRAYS)?;
    let mut numbers = |name: &str| -> Result<Option<(Vec<usize>, Vec<f64>)>> {
        Ok(all.get(name)?.map(|array| (array.shape.clone(), array.to_f64())))
    };
    of_arrays((depth.shape.clone(), depth.to_f64()), &mut numbers)
}

/// A MATLAB file with arrays [nx, ny], as indexed in MATLAB: `depth(ix, iy)`.
fn of_matlab(file: &Path) -> Result<ForeignMaps> {
    let all = Variables::open(file)?;
    // Shapes come in C order, MATLAB's dimensions reversed.
    let mut numbers = |name: &str| -> Result<Option<(Vec<usize>, Vec<f64>)>> {
        Ok(all.numbers(name)?.map(|(shape, values)| turned(&shape, &values)))
    };
    let depth = numbers("depth")?.ok_or_else(|| {
        let there = all.names().join(", ");
        Error::input(format!("there is no array depth (the file holds {there})"), format!("store {ARRAYS}"))
    })?;
    of_arrays(depth, &mut numbers)
}

/// An array with its axes in the opposite order.
fn turned(shape: &[usize], values: &[f64]) -> (Vec<usize>, Vec<f64>) {
    let back: Vec<usize> = shape.iter().rev().copied().collect();
    let moved = c_order(&back).map(|i| values[i]).collect();
    (back, moved)
}

type Numbers<'n> = &'n mut dyn FnMut(&str) -> Result<Option<(Vec<usize>, Vec<f64>)>>;

fn of_arrays((shape, depth): (Vec<usize>, Vec<f64>), numbers: Numbers<'_>) -> Result<ForeignMaps> {
    let [nx, ny] = shape[..] else {
        return Err(Error::input(format!("depth has shape {shape:?}"), format!("store {ARRAYS}")));
    };
    let single = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect::<Vec<f32>>();
    let mut of = |name: &str, wanted: &[usize]| -> Result<Option<Vec<f64>>> {
        match numbers(name)? {
            None => Ok(None),
            Some((shape, values)) if shape == wanted || values.len() == wanted[0] && wanted.len() == 1 => {
                Ok(Some(values))
            }
            Some((shape, _)) => Err(Error::input(
                format!("{name} has shape {shape:?}, and {wanted:?} fits the depths"),
                format!("store {ARRAYS}"),
            )),
        }
    };
    let mask = of("mask", &[nx, ny])?.map(|all| all.into_iter().map(|v| v != 0.0).collect());
    let normal = of("normal", &[nx, ny, 3])?;
    let normal = normal.map(|all| all.chunks_exact(3).map(|n| [0, 1, 2].map(|c| n[c] as f32)).collect());
    Ok(ForeignMaps {
        size: [nx, ny],
        albedo: of("albedo", &[nx, ny])?.map(single),
        normal,
        mask,
        extent: of("extent", &[4])?.map(|e| [e[0], e[1], e[2], e[3]]),
        depth: single(depth),
    })
}

/// The first part of an EXR picture: top row the largest y, left column the largest x.
fn of_exr(file: &Path) -> Result<ForeignMaps> {
    let image = read_first_flat_layer_from_file(file).map_err(|e| {
        Error::input(format!("cannot be read as EXR: {e}"), "check that the file is there and whole")
    })?;
    let layer = &image.layer_data;
    let [nx, ny] = [layer.size.0, layer.size.1];
    let channel = |names: &[&str]| -> Option<Vec<f32>> {
        let of = |name: &&str| layer.channel_data.list.iter().find(|c| c.name == **name);
        let values: Vec<f32> = names.iter().find_map(of)?.sample_data.values_as_f32().collect();
        // Rows from the top become columns of x, y upward.
        let at = |i: usize| values[(ny - 1 - i % ny) * nx + nx - 1 - i / ny];
        Some((0..nx * ny).map(at).collect())
    };
    let depth = channel(&["depth.Z", "Z"]).ok_or_else(|| {
        let there: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
        Error::input(
            format!("there is no channel depth.Z or Z (the file holds {})", there.join(", ")),
            format!("write {CHANNELS}"),
        )
    })?;
    let parts = ["normal.X", "normal.Y", "normal.Z"].map(|name| channel(&[name]));
    let normal = match parts {
        [Some(x), Some(y), Some(z)] => Some((0..x.len()).map(|i| [x[i], y[i], z[i]]).collect()),
        _ => None,
    };
    let extent = layer.attributes.other.iter().find_map(|(name, value)| match value {
        AttributeValue::FloatRect(r) if *name == *"extent" => {
            Some([r.min.0, r.max.0, r.min.1, r.max.1].map(f64::from))
        }
        _ => None,
    });
    Ok(ForeignMaps {
        size: [nx, ny],
        depth,
        albedo: channel(&["albedo.Y", "Y"]),
        normal,
        mask: channel(&["mask.Y"]).map(|all| all.into_iter().map(|v| v != 0.0).collect()),
        extent,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_turned_round() {
        // MATLAB's depth(ix, iy) of 2 x 3, iy slowest in the file.
        let (shape, values) = turned(&[3, 2], &[0.0, 10.0, 1.0, 11.0, 2.0, 12.0]);
        assert_eq!((shape, values), (vec![2, 3], vec![0.0, 1.0, 2.0, 10.0, 11.0, 12.0]));
    }

    #[test]
    fn depths_alone_are_maps() {
        let found =
            ForeignMaps { size: [2, 2], depth: vec![0.0, 0.5, f32::NAN, 0.7], ..ForeignMaps::default() };
        let maps = found.whole([0.0, 1.0, 0.0, 1.0]);
        assert_eq!(maps.mask, [false, true, false, true]);
        assert!(maps.depth[0].is_nan() && maps.normal[1][0].is_nan());
        maps.check().unwrap();
    }
}
