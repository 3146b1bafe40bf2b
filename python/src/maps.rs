//! Maps as dictionaries of arrays, and their files.

use std::path::PathBuf;

use engine::export;
use engine::export::page::PageHistograms;
use engine::maps::{Layer, Maps, Truth};
use engine::{Error, Result};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyType};

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
    probability: Option<PyReadonlyArray1<'py, f32>>,
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
            probability: values(&self.probability)?,
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
    let plane = |values: Vec<f32>| PyArray1::from_vec(py, values).reshape(shape);
    made.set_item("probability", maps.probability.map(plane).transpose()?)?;
    let behind = maps.behind.map(|b| layer(py, shape, [b.albedo, b.depth], b.normal, b.mask, b.depth_error));
    made.set_item("behind", behind.transpose()?)?;
    Ok(made)
}

/// Truth as a dictionary of the same form: its albedo is 1 where there is surface, unless it is known.
pub fn truth<'py>(py: Python<'py>, truth: Truth) -> PyResult<Bound<'py, PyDict>> {
    let Truth { nx, ny, extent, depth, normal, mask, albedo, behind } = truth;
    let of = |pixel: usize| albedo.as_ref().map_or(1.0, |albedo| albedo[pixel]);
    let albedo = mask.iter().enumerate().map(|(pixel, m)| if *m { of(pixel) } else { 0.0 }).collect();
    dictionary(
        py,
        Maps {
            nx,
            ny,
            extent,
            albedo,
            depth,
            normal,
            mask,
            mask_fraction: None,
            depth_error: None,
            probability: None,
            behind,
        },
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

/// What the page of a result shows of its capture.
#[pyclass(module = "thirdbounce._native", frozen)]
pub struct PageContent {
    pub title: String,
    pub light: PageHistograms,
}

#[pymethods]
impl PageContent {
    #[new]
    fn new(py: Python<'_>, title: String, light: &str) -> PyResult<PageContent> {
        guarded(py, None, || {
            let light = serde_json::from_str(light);
            light.map(|light| PageContent { title, light }).map_err(|e| {
                Error::options(
                    format!("the content of a page is none: {e}"),
                    "leave `page` as it was computed",
                )
            })
        })
    }

    /// For pickle and copy.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, (String, String))> {
        let page = slf.get();
        let light = guarded(slf.py(), None, || packed(serde_json::to_string(&page.light)))?;
        Ok((slf.get_type(), (page.title.clone(), light)))
    }
}

/// JSON, or the error of packing it.
pub fn packed(json: serde_json::Result<String>) -> Result<String> {
    json.map_err(|e| Error::output(format!("it cannot be packed as JSON: {e}"), "report this as a bug"))
}

/// Measures maps against truth: figures as JSON.
#[pyfunction]
pub fn evaluate(
    py: Python<'_>,
    arrays: MapArrays<'_>,
    truth: MapArrays<'_>,
    mask_fraction: Option<f64>,
) -> PyResult<String> {
    guarded(py, None, || {
        let (mut maps, truth) = (arrays.maps()?, truth.maps()?);
        let Maps { nx, ny, extent, depth, normal, mask, behind, .. } = truth;
        let truth = Truth { nx, ny, extent, depth, normal, mask, albedo: None, behind };
        packed(serde_json::to_string(&engine::job::evaluate_maps(&mut maps, &truth, mask_fraction)?))
    })
}

/// Reads truth.
#[pyfunction]
pub fn read_truth(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let place = path.display().to_string();
    truth(py, guarded(py, Some(&place), || export::npz::read_truth(&path))?)
}

/// Writes maps: one file if the path has an ending, else a folder with everything that the command writes. `report` is the text
/// of report.json, `page` what report.html shows of the capture.
#[pyfunction]
pub fn write_maps(
    py: Python<'_>,
    arrays: MapArrays<'_>,
    path: PathBuf,
    report: Option<String>,
    page: Option<PyRef<'_, PageContent>>,
) -> PyResult<Vec<PathBuf>> {
    let place = path.display().to_string();
    guarded(py, Some(&place), || {
        let maps = arrays.maps()?;
        let mut written = export::save(&path, &maps)?;
        if let Some(report) = report.filter(|_| path.is_dir()) {
            if let Some(page) = page {
                let file = path.join("report.html");
                let of_page = serde_json::from_str(&report).map_err(|e| {
                    Error::options(format!("the report is none: {e}"), "leave `report` as it was computed")
                })?;
                export::page::write(&file, &page.title, &maps, &page.light, &of_page, None)?;
                written.push(file);
            }
            let file = path.join("report.json");
            engine::files::atomic::write(&file, report.as_bytes())?;
            written.push(file);
        }
        Ok(written)
    })
}

/// Reads the maps of an npz file, or of a folder of results with its report.
#[pyfunction]
pub fn read_maps(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let place = path.display().to_string();
    let is_folder = path.is_dir();
    let file = if is_folder { path.join("maps.npz") } else { path.clone() };
    let made = dictionary(py, guarded(py, Some(&place), || export::npz::read_maps(&file))?)?;
    if is_folder && let Ok(report) = std::fs::read_to_string(path.join("report.json")) {
        made.set_item("report", report)?;
    }
    Ok(made)
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
