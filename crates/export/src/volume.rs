//! The reconstructed volume as npz or HDF5.

use std::path::Path;

use rust_hdf5::{H5File, Hdf5Error};

use crate::error::{Error, Result};
use crate::files::archive::{Npz, npz_bytes};
use crate::files::array::Array;
use crate::files::atomic;

/// Albedo and normals on a regular grid of voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeArrays {
    /// Voxels along x, y, z; voxel `(ix * ny + iy) * nz + iz`.
    pub size: [usize; 3],
    /// (xmin, xmax, ymin, ymax, zmin, zmax) in metres, outer edges of the voxels.
    pub extent: [f64; 6],
    /// Albedo of each voxel.
    pub albedo: Vec<f32>,
    /// Unit normal of each voxel, towards the wall, if known.
    pub normal: Option<Vec<[f32; 3]>>,
}

impl VolumeArrays {
    fn check(&self) -> Result<()> {
        let voxels = self.size.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
        let normals = self.normal.as_ref().map_or(self.albedo.len(), Vec::len);
        if voxels != Some(self.albedo.len()) || normals != self.albedo.len() || self.albedo.is_empty() {
            return Err(Error::input(
                format!("{} albedos and {normals} normals for {:?} voxels", self.albedo.len(), self.size),
                "a volume holds one value per voxel",
            ));
        }
        Ok(())
    }
}

/// Writes a volume as HDF5 if the name ends in `.hdf5` or `.h5`, else as npz: `albedo` [X, Y, Z] and, if
/// known, `normal` [X, Y, Z, 3] as float32, `extent` as float64.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, volume: &VolumeArrays) -> Result<()> {
    volume.check()?;
    let ending = path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
    if matches!(ending.as_str(), "hdf5" | "h5") {
        return atomic::replace(path, |temporary| {
            write_hdf5(temporary, volume).map_err(|e| {
                Error::output(
                    format!("{}: cannot be written: {e}", path.display()),
                    "check the path and the disk",
                )
            })
        });
    }
    let [nx, ny, nz] = volume.size;
    let mut arrays = vec![("albedo", Array::from_f32(&volume.size, &volume.albedo))];
    if let Some(normal) = &volume.normal {
        arrays.push(("normal", Array::from_f32(&[nx, ny, nz, 3], normal.as_flattened())));
    }
    arrays.push(("extent", Array::from_f64(&[6], &volume.extent)));
    atomic::write(path, &npz_bytes(&arrays)?)
}

fn write_hdf5(path: &Path, volume: &VolumeArrays) -> std::result::Result<(), Hdf5Error> {
    let file = H5File::create(path)?;
    let [nx, ny, nz] = volume.size;
    let chunk = [nx.min(16), ny.min(16), nz.min(64)];
    let albedo =
        file.new_dataset::<f32>().shape(volume.size).chunk(&chunk).shuffle_deflate(4).create("albedo")?;
    albedo.write_raw(&volume.albedo)?;
    if let Some(normal) = &volume.normal {
        let chunk = [chunk[0], chunk[1], chunk[2], 3];
        let vectors = file.new_dataset::<f32>().shape([nx, ny, nz, 3]).chunk(&chunk).shuffle_deflate(4);
        vectors.create("normal")?.write_raw(normal.as_flattened())?;
    }
    file.new_dataset::<f64>().shape([6]).create("extent")?.write_raw(&volume.extent)?;
    file.close()
}

/// Reads a volume from npz.
///
/// # Errors
/// `Kind::Input` for a missing or damaged file, missing arrays or shapes that do not agree.
pub fn read(path: &Path) -> Result<VolumeArrays> {
    let read = || -> Result<VolumeArrays> {
        const WANTED: &str = "albedo [X, Y, Z], extent (6 numbers), optionally normal [X, Y, Z, 3]";
        let mut npz = Npz::open(path)?;
        let (albedo, extent) = (npz.require("albedo", WANTED)?, npz.require("extent", WANTED)?);
        let wrong = |name: &str, array: &Array| {
            Error::input(format!("{name} has shape {:?}", array.shape), format!("wanted: {WANTED}"))
        };
        let [nx, ny, nz] = albedo.shape[..] else { return Err(wrong("albedo", &albedo)) };
        let normal = match npz.get("normal")? {
            Some(normal) if normal.shape == [nx, ny, nz, 3] => {
                Some(normal.to_f32().chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect())
            }
            Some(normal) => return Err(wrong("normal", &normal)),
            None => None,
        };
        let volume = VolumeArrays {
            size: [nx, ny, nz],
            extent: extent.to_f64().try_into().map_err(|_| wrong("extent", &extent))?,
            albedo: albedo.to_f32(),
            normal,
        };
        volume.check().map(|()| volume)
    };
    read().map_err(|e| e.at(path.display()))
}
