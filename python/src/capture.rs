//! Captures as dictionaries of arrays.

use std::path::PathBuf;

use engine::capture::{self, Capture, Pulse};
use engine::{Error, Result};
use glam::DVec3;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::guarded;
use crate::settings::{self, Texts};
use crate::tell::heard;

/// A capture, as the Python part gives it: every array is flat and in C order, lengths are metres. What may be missing is an
/// `Option`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Arrays<'py> {
    name: String,
    /// Points along x and along y.
    scan: [usize; 2],
    /// \[pair * bins + bin\].
    #[pyo3(default)]
    counts: Option<PyReadonlyArray1<'py, f32>>,
    /// x, y, z of each pair.
    laser: PyReadonlyArray1<'py, f64>,
    sensor: PyReadonlyArray1<'py, f64>,
    #[pyo3(default)]
    laser_normal: Option<PyReadonlyArray1<'py, f64>>,
    #[pyo3(default)]
    sensor_normal: Option<PyReadonlyArray1<'py, f64>>,
    bins: usize,
    bin_width: f64,
    t_start: f64,
    /// `None`: as the counts are.
    #[pyo3(default)]
    photon_counts: Option<bool>,
    /// Samples, the width of one, and where the first begins.
    #[pyo3(default)]
    pulse: Option<(PyReadonlyArray1<'py, f64>, f64, f64)>,
    #[pyo3(default)]
    laser_spot: Option<f64>,
    #[pyo3(default)]
    sensor_spot: Option<f64>,
    #[pyo3(default)]
    cycles: Option<f64>,
    #[pyo3(default)]
    direct: Option<f64>,
    /// Positions of laser and detector.
    #[pyo3(default)]
    devices: Option<[Option<[f64; 3]>; 2]>,
    /// As `counts`, without the object.
    #[pyo3(default)]
    empty: Option<PyReadonlyArray1<'py, f32>>,
}

impl Arrays<'_> {
    /// The capture. The counts are copied: Python may change its array while a solve runs.
    pub fn capture(&self) -> Result<Capture> {
        let counts = self.counts.as_ref().map(|c| flat(c)).transpose()?.map_or(vec![], <[f32]>::to_vec);
        let (laser, sensor) = (points(&self.laser)?, points(&self.sensor)?);
        let mut made = Capture::new(self.scan, laser, sensor, self.bins, self.bin_width, counts);
        let normals = |n: &Option<PyReadonlyArray1<'_, f64>>| n.as_ref().map(points).transpose();
        made.laser_normal = normals(&self.laser_normal)?;
        made.sensor_normal = normals(&self.sensor_normal)?;
        (made.name, made.t_start) = (self.name.clone(), self.t_start);
        made.integer_counts = self.photon_counts.unwrap_or_else(|| made.has_whole_counts());
        if let Some((samples, width, start)) = &self.pulse {
            made.pulse = Some(Pulse::new(flat(samples)?.to_vec(), *width, *start));
        }
        (made.laser_spot, made.sensor_spot) = (self.laser_spot, self.sensor_spot);
        (made.cycles, made.direct) = (self.cycles, self.direct);
        made.devices = self.devices.unwrap_or_default().map(|device| device.map(DVec3::from_array));
        if let Some(empty) = &self.empty {
            let mut room = made.outline();
            room.histograms = flat(empty)?.to_vec();
            made.set_empty(&room)?;
        }
        Ok(made)
    }
}

/// The values of an array that the Python part has laid out.
pub fn flat<'a, T: numpy::Element>(array: &'a PyReadonlyArray1<'_, T>) -> Result<&'a [T]> {
    array
        .as_slice()
        .map_err(|e| Error::options(format!("an array is not contiguous: {e}"), "report this as a bug"))
}

fn points(numbers: &PyReadonlyArray1<'_, f64>) -> Result<Vec<DVec3>> {
    Ok(flat(numbers)?.as_chunks::<3>().0.iter().map(|p| DVec3::from_array(*p)).collect())
}

/// The capture as a dictionary. The counts are not copied.
pub fn dictionary<'py>(py: Python<'py>, capture: Capture) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    let numbers =
        |all: &[DVec3]| PyArray1::from_vec(py, all.iter().flat_map(|p| p.to_array()).collect::<Vec<f64>>());
    made.set_item("name", &capture.name)?;
    made.set_item("scan", capture.scan)?;
    made.set_item("laser", numbers(&capture.laser))?;
    made.set_item("sensor", numbers(&capture.sensor))?;
    made.set_item("laser_normal", capture.laser_normal.as_deref().map(numbers))?;
    made.set_item("sensor_normal", capture.sensor_normal.as_deref().map(numbers))?;
    made.set_item("bins", capture.bins)?;
    made.set_item("bin_width", capture.bin_width)?;
    made.set_item("t_start", capture.t_start)?;
    made.set_item("photon_counts", capture.integer_counts)?;
    let pulse = capture.pulse.map(|p| (PyArray1::from_vec(py, p.samples), p.width, p.start));
    made.set_item("pulse", pulse)?;
    made.set_item("laser_spot", capture.laser_spot)?;
    made.set_item("sensor_spot", capture.sensor_spot)?;
    made.set_item("cycles", capture.cycles)?;
    made.set_item("direct", capture.direct)?;
    made.set_item("devices", capture.devices.map(|device| device.map(|at| at.to_array())))?;
    made.set_item("empty", capture.empty.map(|empty| PyArray1::from_vec(py, empty)))?;
    made.set_item("counts", PyArray1::from_vec(py, capture.histograms))?;
    Ok(made)
}

/// Reads a capture of any format; the notes say what was assumed.
#[pyfunction]
pub fn read<'py>(
    py: Python<'py>,
    path: PathBuf,
    settings: Texts,
) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
    let place = path.display().to_string();
    let opened = heard(py, Some(&place), move || {
        let given = engine::job::reading(&settings::settings(&settings)?)?;
        capture::read_given(&path, &given)
    })?;
    Ok((dictionary(py, opened.capture)?, opened.notes))
}

/// Writes a capture; the notes say what the format cannot hold.
#[pyfunction]
pub fn write(py: Python<'_>, arrays: Arrays<'_>, path: PathBuf) -> PyResult<Vec<String>> {
    let place = path.display().to_string();
    guarded(py, Some(&place), || capture::write(&arrays.capture()?, &path))
}
