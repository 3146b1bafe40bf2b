//! The C port of the two inner loops, which `benches/isa` has compilers for NVIDIA translate, against the float64 twins: what
//! is counted there is the arithmetic that runs.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use fixtures::device::*;
use glam::DVec3;
use thirdbounce::transport::kernels::PADDING;
use thirdbounce::transport::twin::{self, Sample, Twin};
use thirdbounce::transport::{Grid, Model};

/// Histograms and gradients by the port, compiled by the system's C compiler.
fn ported(model: &Model, grid: &Grid, samples: &[Sample], residual: &[f64]) -> (Vec<f32>, Vec<[f32; 4]>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = folder.path().join("loops");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/isa/loops_main.c");
    let compiled = Command::new("cc")
        .args(["-std=gnu11", "-O1", "-Wall", "-Wextra", "-Werror", "-o"])
        .args([&program, &source])
        .arg("-lm")
        .status();
    assert!(compiled.expect("cc, which Rust links with").success());

    let scene = model.scene(grid);
    let mut input: Vec<u8> = vec![];
    input.extend_from_slice(bytemuck::cast_slice(&[scene.reference, scene.place_scale, scene.place_offset]));
    let counts = [scene.stride, scene.bins, model.pairs() as u32, samples.len() as u32];
    input.extend_from_slice(bytemuck::cast_slice(&counts));
    let points: Vec<[f32; 4]> =
        samples.iter().map(|s| [s.point.x, s.point.y, s.point.z, s.albedo].map(|v| v as f32)).collect();
    let vectors: Vec<[f32; 4]> =
        samples.iter().map(|s| [s.normal.x, s.normal.y, s.normal.z, 0.0].map(|v| v as f32)).collect();
    for words in [&points, &vectors, &model.wall.words()] {
        input.extend_from_slice(bytemuck::cast_slice(words));
    }
    let padding = [0.0f32; PADDING as usize];
    for row in residual.chunks(model.bins) {
        let row: Vec<f32> = padding.into_iter().chain(row.iter().map(|r| *r as f32)).collect();
        input.extend_from_slice(bytemuck::cast_slice(&row));
    }
    input.extend_from_slice(bytemuck::cast_slice(&padding));

    let mut child =
        Command::new(&program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it starts");
    child.stdin.take().expect("piped").write_all(&input).expect("it reads");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success());
    let words: Vec<f32> =
        output.stdout.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let (cells, gradients) = words.split_at(words.len() - 4 * samples.len());
    let gradients = gradients.chunks_exact(4).map(|g| [g[0], g[1], g[2], g[3]]).collect();
    (model.bins_of(cells), gradients)
}

#[test]
fn the_c_port_computes_what_the_kernels_compute() {
    let (model, grid) = (model(5, 64, 3), grid());
    let twin = Twin { model: &model, grid: &grid };
    let samples = away_from_edges(&twin, &samples(&model, &grid, 0.5, 4));
    assert!(samples.len() > 400, "{}", samples.len());
    let mut random = Random::new(6);
    let residual: Vec<f64> = (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 1.0)).collect();
    let (histograms, gradients) = ported(&model, &grid, &samples, &residual);

    let e = error(histograms.into_iter().map(f64::from), twin::rendered(&twin, &samples));
    assert!(e < 1e-5, "forward: {e}");
    let want = gathered("surface_gather", &twin, &samples, &residual, true);
    let want: Vec<DVec3> = want.iter().map(|g| DVec3::new(g[0], g[1], g[2])).collect();
    let flat = |k: usize| gradients.iter().map(move |g| f64::from(g[k]));
    for (k, e) in [(1, 0), (2, 1), (3, 2)].map(|(k, axis)| (k, error(flat(k), want.iter().map(|w| w[axis]))))
    {
        assert!(e < 3e-5, "gradient, component {k}: {e}");
    }
    let along = samples.iter().zip(&want).map(|(s, w)| s.normal.dot(*w));
    let e = error(flat(0), along);
    assert!(e < 3e-5, "gradient along the vector: {e}");
}
