//! Maps as dictionaries of arrays, and their files.

use std::path::PathBuf;

use engine::export;
use engine::maps::{Layer, Maps, Truth};
use engine::{Error, Result};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::capture::flat;
use crate::error::guarded;

/// Maps, as the Python part gives them: every array is flat and in C order.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct MapArrays<'py> {
    shape: [usize; 2],
    extent: [f64; 4],
    albedo: PyReadonlyArray1<'py, f32>,
    depth: PyReadonlyArray1<'py, f32>,
    normals: PyReadonlyArray1<'py, f32>,
    mask: PyReadonlyArray1<'py, bool>,
    mask_fraction: Option<f64>,
    depth_error: Option<PyReadonlyArray1<'py, f32>>,
    behind: Option<LayerArrays<'py>>,
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct LayerArrays<'py> {
    albedo: PyReadonlyArray1<'py, f32>,
    depth: PyReadonlyArray1<'py, f32>,
    normals: PyReadonlyArray1<'py, f32>,
    mask: PyReadonlyArray1<'py, bool>,
    depth_error: Option<PyReadonlyArray1<'py, f32>>,
}

fn vectors(numbers: &PyReadonlyArray1<'_, f32>) -> Result<Vec<[f32; 3]>> {
    Ok(flat(numbers)?.as_chunks::<3>().0.to_vec())
}

fn values(array: &Option<PyReadonlyArray1<'_, f32>>) -> Result<Option<Vec<f32>>> {
    array.as_ref().map(|a| flat(a).map(<[f32]>::to_vec)).transpose()
}

impl MapArrays<'_> {
    fn maps(&self) -> Result<Maps> {
        let behind = |b: &LayerArrays<'_>| -> Result<Layer> {
            Ok(Layer {
                albedo: flat(&b.albedo)?.to_vec(),
                depth: flat(&b.depth)?.to_vec(),
                normal: vectors(&b.normals)?,
                mask: flat(&b.mask)?.to_vec(),
                depth_error: values(&b.depth_error)?,
            })
        };
        Ok(Maps {
            nx: self.shape[0],
            ny: self.shape[1],
            extent: self.extent,
            albedo: flat(&self.albedo)?.to_vec(),
            depth: flat(&self.depth)?.to_vec(),
            normal: vectors(&self.normals)?,
            mask: flat(&self.mask)?.to_vec(),
            mask_fraction: self.mask_fraction,
            depth_error: values(&self.depth_error)?,
            behind: self.behind.as_ref().map(behind).transpose()?,
        })
    }
}

/// Maps as a dictionary. Nothing is copied.
pub fn dictionary<'py>(py: Python<'py>, maps: Maps) -> PyResult<Bound<'py, PyDict>> {
    let shape = [maps.nx, maps.ny];
    let made = layer(py, shape, [maps.albedo, maps.depth], maps.normal, maps.mask, maps.depth_error)?;
    made.set_item("extent", maps.extent)?;
    made.set_item("mask_fraction", maps.mask_fraction)?;
    let behind = maps.behind.map(|b| layer(py, shape, [b.albedo, b.depth], b.normal, b.mask, b.depth_error));
    made.set_item("behind", behind.transpose()?)?;
    Ok(made)
}

/// Truth as a dictionary of the same form: its albedo is 1 where there is surface.
pub fn truth<'py>(py: Python<'py>, truth: Truth) -> PyResult<Bound<'py, PyDict>> {
    let albedo = truth.mask.iter().map(|m| f32::from(u8::from(*m))).collect();
    let Truth { nx, ny, extent, depth, normal, mask, behind } = truth;
    dictionary(
        py,
        Maps { nx, ny, extent, albedo, depth, normal, mask, mask_fraction: None, depth_error: None, behind },
    )
}

fn layer<'py>(
    py: Python<'py>,
    shape: [usize; 2],
    [albedo, depth]: [Vec<f32>; 2],
    normals: Vec<[f32; 3]>,
    mask: Vec<bool>,
    depth_error: Option<Vec<f32>>,
) -> PyResult<Bound<'py, PyDict>> {
    let plane = |values: Vec<f32>| PyArray1::from_vec(py, values).reshape(shape);
    let made = PyDict::new(py);
    made.set_item("albedo", plane(albedo)?)?;
    made.set_item("depth", plane(depth)?)?;
    made.set_item(
        "normals",
        PyArray1::from_vec(py, normals.into_flattened()).reshape([shape[0], shape[1], 3])?,
    )?;
    made.set_item("mask", PyArray1::from_vec(py, mask).reshape(shape)?)?;
    made.set_item("depth_error", depth_error.map(plane).transpose()?)?;
    Ok(made)
}

/// Writes maps: one npz file if the path ends in .npz, else a folder with everything that the command writes. `report` is
/// the text of report.json.
#[pyfunction]
pub fn write_maps(
    py: Python<'_>,
    arrays: MapArrays<'_>,
    path: PathBuf,
    report: Option<String>,
) -> PyResult<Vec<PathBuf>> {
    let place = path.display().to_string();
    guarded(py, Some(&place), || {
        let maps = arrays.maps()?;
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz")) {
            return export::npz::write_maps(&path, &maps).map(|()| vec![path]);
        }
        let mut written = export::write_maps(&path, &maps)?;
        if let Some(report) = report {
            let file = path.join("report.json");
            engine::files::atomic::write(&file, report.as_bytes())?;
            written.push(file);
        }
        Ok(written)
    })
}

/// Reads the maps of an npz file.
#[pyfunction]
pub fn read_maps(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let place = path.display().to_string();
    let read = guarded(py, Some(&place), || export::npz::read_maps(&path))?;
    dictionary(py, read)
}

/// Albedo and depth side by side, as PNG.
#[pyfunction]
pub fn picture<'py>(py: Python<'py>, arrays: MapArrays<'py>) -> PyResult<Bound<'py, PyBytes>> {
    let png = guarded(py, None, || {
        export::png::preview(&arrays.maps()?)
            .map_err(|e| Error { what: format!("the maps: {}", e.what), ..e })
    })?;
    Ok(PyBytes::new(py, &png))
}
