//! Captures of known scenes.

use engine::capture::{Pulse, Reflectance};
use engine::{Error, Result};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use thirdbounce_simulate::{self as simulator, Dark, Layout, RenderOptions, Scene};

use crate::tell::heard;
use crate::{capture, maps};

/// What to simulate.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct SimulationRequest {
    scene: String,
    scan: usize,
    wall: f64,
    bin_width: f64,
    bins: Option<usize>,
    pairs: String,
    point: [f64; 2],
    lasers: Option<usize>,
    model: String,
    occlusion: bool,
    albedo: Option<f64>,
    /// Full width at half maximum, metres of path.
    pulse: Option<f64>,
    photons: Option<f64>,
    dark: f64,
    seed: u64,
    noise: f64,
    truth_pixels: usize,
}

impl SimulationRequest {
    fn scene(&self) -> Result<Scene> {
        let mut scene = Scene::named(&self.scene)?;
        self.albedo.into_iter().for_each(|albedo| scene.set_albedo(albedo));
        (scene.scan, scene.wall) = (self.scan, self.wall);
        (scene.bin_width, scene.bins) = (self.bin_width, self.bins);
        scene.pulse = self.pulse.map(Pulse::gaussian).transpose()?;
        (scene.photons, scene.dark, scene.seed) = (self.photons, Dark::Counts(self.dark), self.seed);
        (scene.reflectance, scene.occlusion) = (Reflectance::named(&self.model)?, self.occlusion);
        scene.layout = self.layout()?;
        Ok(scene)
    }

    fn layout(&self) -> Result<Layout> {
        let point = self.point.into();
        match self.pairs.as_str() {
            "confocal" => Ok(Layout::Confocal),
            "one-laser" => Ok(Layout::OneLaser { point }),
            "one-sensor" => Ok(Layout::OneSensor { point }),
            "exhaustive" => Ok(Layout::Exhaustive { lasers: self.lasers.unwrap_or(self.scan) }),
            "irregular" => Ok(Layout::Irregular { seed: self.seed }),
            other => Err(Error::options(
                format!("pairs is {other:?}"),
                "give confocal, one-laser, one-sensor, exhaustive or irregular",
            )),
        }
    }
}

/// The built-in scenes: name and text.
#[pyfunction]
pub fn scenes() -> Vec<(&'static str, &'static str)> {
    Scene::known().to_vec()
}

/// Renders a scene: the capture, and its truth as maps.
#[pyfunction]
pub fn simulate(
    py: Python<'_>,
    wanted: SimulationRequest,
) -> PyResult<(Bound<'_, PyDict>, Bound<'_, PyDict>)> {
    let (rendered, truth) = heard(py, None, move || {
        let scene = wanted.scene()?;
        let truth = simulator::truth(&scene, wanted.truth_pixels)?;
        let options = RenderOptions { noise: wanted.noise, seed: wanted.seed, ..RenderOptions::default() };
        let rendering = simulator::simulate(&scene, &options)?;
        rendering.capture.check()?;
        Ok((rendering.capture, truth))
    })?;
    Ok((capture::dictionary(py, rendered)?, maps::truth(py, truth)?))
}
