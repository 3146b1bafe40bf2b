//! Stiff and extreme cases: whole runs of a build against those of a twin scene, and the passes of this build against the float64
//! reference.

use std::path::Path;

use fixtures::device::gpu;
use fixtures::extreme::{Case, cases as extreme, passes};
use glam::DVec3;
use thirdbounce::capture::{self, Capture};
use thirdbounce::engine::Accumulation;
use thirdbounce::maps::{Maps, percentile};
use thirdbounce::transport::{Geometry, Reflectance as Model};
use thirdbounce_benchmark::pages::Stability;
use thirdbounce_simulate::{Placement, Reflectance, RenderOptions, Scene, simulate};

use super::run::{Build, Run};

/// Options of all runs. Repeatable runs differ by the case alone.
const OPTIONS: [&str; 3] = ["--lateral", "64", "--deterministic"];

/// A capture whose maps are those of the figure before a wall of 1 m, times a scale; or that has no twin.
struct Twin {
    name: &'static str,
    capture: Capture,
    scale: Option<f64>,
    options: &'static [&'static str],
    /// A case of the float64 reference of the same kind.
    reference: Option<Case>,
}

/// Runs every case.
pub fn run(build: &Build, folder: &Path) -> Vec<Stability> {
    let figure = match figure(1.0) {
        Ok(figure) => figure,
        Err(e) => return vec![Stability { name: "figure".into(), error: Some(e), ..Stability::default() }],
    };
    let base = solved(build, folder, &figure, &[]);
    let mut all = vec![];
    for twin in twins(&figure) {
        eprintln!("stability: {}", twin.name);
        let mut row = Stability { name: twin.name.into(), ..Stability::default() };
        match (solved(build, folder, &twin.capture, twin.options), &base) {
            (Ok(run), Ok(base)) => {
                row.rise = Some(rise(&run));
                row.twin = twin.scale.map(|scale| apart(&base.maps, &run.maps, scale));
            }
            (Err(e), _) => row.error = Some(e),
            (_, Err(e)) => row.error = Some(format!("its twin: {e}")),
        }
        row.reference = twin.reference.as_ref().map(reference);
        all.push(row);
    }
    for (name, case) in [
        ("falloff over 1e7", extreme::near_far(Geometry::Confocal, Model::Cosine, false)),
        ("retroreflective patch, 1e6 times as bright, beside diffuse ones", extreme::retroreflector(1e6)),
    ] {
        all.push(Stability { name: name.into(), reference: Some(reference(&case)), ..Stability::default() });
    }
    all
}

/// The figure before a wall of `scale` metres, rendered at that size.
fn figure(scale: f64) -> Result<Capture, String> {
    let of = || -> thirdbounce::Result<Capture> {
        let mut scene = Scene::named("figure")?;
        let placement = Placement { scale, ..Placement::default() };
        for object in &mut scene.objects {
            object.mesh = object.mesh.clone().placed(&placement)?;
        }
        (scene.wall, scene.bin_width, scene.scan) = (scale, 0.01 * scale, 16);
        scene.reflectance = Reflectance::Lambertian;
        Ok(simulate(&scene, &RenderOptions::default())?.capture)
    };
    of().map_err(|e| e.to_string())
}

fn twins(figure: &Capture) -> Vec<Twin> {
    let of = |name, capture, scale| Twin { name, capture, scale, options: &[], reference: None };
    let scaled = |scale: f64| {
        figure.clone().with(|c| {
            c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| *p *= scale);
            (c.bin_width, c.t_start) = (c.bin_width * scale, c.t_start * scale);
        })
    };
    let counts = |change: &dyn Fn(usize, f32) -> f32| {
        figure.clone().with(|c| c.histograms.iter_mut().enumerate().for_each(|(i, v)| *v = change(i, *v)))
    };
    let strongest = figure.histograms.iter().copied().fold(0.0, f32::max);
    let brightest = figure.histograms.iter().position(|v| *v == strongest).unwrap_or(0);
    let bins = figure.bins;
    // A fixed sequence of numbers from -1 to 1.
    let random = |i: usize| {
        ((i as u64).wrapping_mul(6_364_136_223_846_793_005) >> 33) as f32 / (1u64 << 30) as f32 - 1.0
    };
    let pairs = figure.pair_count();
    // 97 and the number of pairs have no common divisor.
    let order: Vec<usize> = (0..pairs).map(|i| i * 97 % pairs).collect();
    let at = |all: &[DVec3]| -> Vec<DVec3> { order.iter().map(|p| all[*p]).collect() };
    let shuffled = figure.clone().with(|c| {
        (c.laser, c.sensor, c.scan) = (at(&figure.laser), at(&figure.sensor), [pairs, 1]);
        c.histograms = order.iter().flat_map(|p| figure.histogram(*p).to_vec()).collect();
    });
    let single = brightest / bins;
    let one_pair = figure.clone().with(|c| {
        (c.laser, c.sensor, c.scan) = (vec![figure.laser[single]], vec![figure.sensor[single]], [1, 1]);
        c.histograms = figure.histogram(single).to_vec();
    });
    let reference = |name: &str| extreme::all().into_iter().find(|case| case.name == name);
    let mut all = vec![of("the same again", figure.clone(), Some(1.0))];
    let walls = [("wall of 1 mm", 1e-3), ("wall of 100 m", 100.0)];
    all.extend(walls.into_iter().filter_map(|(name, scale)| {
        let capture = self::figure(scale).ok()?;
        Some(Twin { reference: Some(extreme::wall_of(scale)), ..of(name, capture, Some(scale)) })
    }));
    all.extend([
        of("lengths × 1e-3", scaled(1e-3), Some(1e-3)),
        of("lengths × 100", scaled(100.0), Some(100.0)),
        of("counts × 7.3", counts(&|_, v| 7.3 * v), Some(1.0)),
        of("noise of 1e-5, relative", counts(&|i, v| v * (1.0 + 1e-5 * random(i))), Some(1.0)),
        of("pairs in another order", shuffled, Some(1.0)),
        Twin { options: &["--iterations", "10000"], ..of("10,000 iterations", figure.clone(), Some(1.0)) },
        Twin {
            reference: reference("saturated bins"),
            ..of("bins saturated at .2 of the strongest", counts(&|_, v| v.min(0.2 * strongest)), Some(1.0))
        },
        Twin {
            reference: reference("one photon"),
            ..of("one photon", counts(&|i, _| f32::from(u8::from(i == brightest))), None)
        },
        Twin { reference: reference("one pair"), ..of("one pair", one_pair, None) },
    ]);
    all
}

/// The relative errors of rendering and gradient against the float64 reference.
fn reference(case: &Case) -> [f64; 2] {
    let found = passes(&gpu(), case, Accumulation::Owned);
    [found.forward.largest, found.gradient]
}

fn solved(build: &Build, folder: &Path, capture: &Capture, options: &[&str]) -> Result<Run, String> {
    let file = folder.join("stability.npz");
    capture::write(capture, &file).map_err(|e| e.to_string())?;
    let options: Vec<String> = OPTIONS.iter().chain(options).map(|o| (*o).to_string()).collect();
    build.reconstruct(&file, &folder.join("stability"), &options)
}

/// IoU of both masks, and the 99th percentile of the differences of depth over the width of the wall, where both have one.
fn apart(base: &Maps, other: &Maps, scale: f64) -> [f64; 2] {
    let count = |of: &dyn Fn(bool, bool) -> bool| {
        base.mask.iter().zip(&other.mask).filter(|(a, b)| of(**a, **b)).count() as f64
    };
    let both = (0..base.depth.len().min(other.depth.len())).filter(|p| base.mask[*p] && other.mask[*p]);
    let differences: Vec<f32> =
        both.map(|p| (f64::from(other.depth[p]) / scale - f64::from(base.depth[p])).abs() as f32).collect();
    let width = base.extent[1] - base.extent[0];
    let far = percentile(&differences, 99.0).map_or(1.0, |d| f64::from(d) / width);
    [count(&|a, b| a && b) / count(&|a, b| a || b).max(1.0), far]
}

/// The largest relative rise of the objective between points of the trace with the same pixels and pairs.
fn rise(run: &Run) -> f64 {
    let trace = run.report["trace"].as_array().map_or(&[][..], Vec::as_slice);
    let number = |entry: &serde_json::Value, key: &str| entry[key].as_f64().unwrap_or(f64::NAN);
    let pairs =
        trace.windows(2).filter(|w| ["lateral", "pairs", "active"].iter().all(|key| w[0][key] == w[1][key]));
    pairs.map(|w| number(&w[1], "loss") / number(&w[0], "loss") - 1.0).fold(0.0, f64::max)
}
