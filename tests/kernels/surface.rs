//! The surface's kernels against the float64 twins, on random input in poisoned buffers. The whole stage is tested in
//! `tests/solvers/surface.rs`.

use fixtures::device::surfaces::*;
use fixtures::device::*;
use glam::{DVec2, DVec3, dvec2, dvec3};
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::solve::passes::{FINISH, RESIDUAL};
use thirdbounce::solve::surface::{self, Placed};
use thirdbounce::solve::{Accumulation, COLUMNS_HOST};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Bond, Height, Pull, Raw, SurfaceWeights, Twin};
use thirdbounce::transport::{Geometry, Grid, Model, Reflectance};

/// Number of a neighbour among the eight, as in the kernels.
fn slot(way: [i32; 2]) -> usize {
    let k = (3 * (way[0] + 1) + way[1] + 1) as usize;
    if k > 4 { k - 1 } else { k }
}

/// Stencils as kernels store them, zero where there is no neighbour.
fn stencils(bonds: &[Vec<Bond>]) -> Vec<f64> {
    let mut all = vec![DVec2::ZERO; 8 * bonds.len()];
    for (pixel, bonds) in bonds.iter().enumerate() {
        bonds.iter().for_each(|b| all[8 * pixel + slot(b.way)] = b.stencil);
    }
    flat(&all)
}

fn flat(all: &[DVec2]) -> Vec<f64> {
    all.iter().flat_map(|v| v.to_array()).collect()
}

fn pitches(grid: &Grid) -> f64 {
    grid.pitch.x.max(grid.pitch.y)
}

#[test]
pub fn bonds_and_points() {
    let gpu = gpu();
    let grid = oblong();
    for (reflectance, each) in
        [(Reflectance::Cosine, 4), (Reflectance::Isotropic, 4), (Reflectance::Lambertian, 1)]
    {
        let model = Model { reflectance, ..scene(3, 40, 1) };
        let twin = Twin { model: &model, grid: &grid };
        let mut field = Field { each, ..both(&grid, 2) };
        // One more spike that leaves the grid on both sides.
        let [near, far] = [model.near_z(&grid), grid.n[2] - 1].map(|z| grid.position(DVec3::Z * z as f64).z);
        let middle = field.len() / 2;
        field.heights[middle].depth = f64::from(near as f32);
        field.heights[middle + 1].depth = f64::from(far as f32);
        let bonds = field.bonds(&twin);
        let counts: Vec<usize> = (0..9).map(|n| bonds.iter().filter(|b| b.len() == n).count()).collect();
        assert!(counts[0] > 0 && counts[1] > 0 && counts[8] > 0, "alone, in twos, among others: {counts:?}");
        let weights = || bonds.iter().flatten().map(|b| b.weight);
        assert!(weights().any(|w| w < 0.1) && weights().any(|w| w > 0.5), "some across an edge");
        assert!(field.len() > WORKGROUP as usize, "more than one group");

        let mut job = job(&gpu, &model, &grid, &Fit::of(&grid, each));
        field.write(&mut job);
        run_bonds(&mut job, field.len());
        let counts: Vec<u32> = read(&mut job, buffer::COUNTS, COUNTS as usize);
        assert_eq!(counts[COUNT_ACTIVE as usize] as usize, each * field.len());
        assert!(read::<u32>(&mut job, buffer::HEIGHT_MOMENTS, 4 * field.len()).iter().all(|m| *m == 0));
        let got = read_floats(&mut job, buffer::STENCILS, 16 * field.len());
        let e = error(got, stencils(&bonds));
        // For pixels on a slanted line the determinant cancels to a thousandth, about a hundred times the rounding
        // error.
        assert!(e < 3e-5, "{e}");
        let pixels: Vec<[u32; 4]> = read(&mut job, buffer::PIXELS, field.len());
        assert!(pixels.iter().zip(&field.heights).all(|(p, h)| f64::from(f32::from_bits(p[2])) == h.depth));

        // The weights of the prior follow what the second of these iterations left.
        let mut weights =
            SurfaceWeights { bend: 1.0, jump: 2.0, bend_share: 3.0, jump_share: 5.0, ..Default::default() };
        write_weights(&mut job, &weights);
        let mut rows = [0.125f32; 2 * TRACE_ROW as usize];
        rows[(TRACE_ROW + TRACE_OBJECTIVE) as usize] = 0.5;
        write(&mut job, buffer::TRACE, &rows);
        for (done, left) in [(0, None), (2, Some(0.5))] {
            let s = Schedule::of(|s| surface::bonds(s, job.plan.finest(), field.len(), done));
            job.perform(&s);
            left.into_iter().for_each(|left| weights.renew(left));
            let got = read_floats(&mut job, buffer::SURFACE_WEIGHTS, SURFACE_WEIGHTS as usize);
            assert_eq!([0, 1].map(|i| got[i]), [weights.bend, weights.jump], "after {done}");
        }

        write(&mut job, buffer::COUNTS, &[(each * field.len()) as u32, 0, 0, 0, 0, 0]);
        let s = Schedule::of(|s| surface::points(s, job.plan.finest(), field.len()));
        job.perform(&s);
        let (slopes, samples) = field.points(&twin, &bonds);
        let got = read_pairs(&mut job, buffer::SLOPES, field.len());
        let e = error(got.concat(), flat(&slopes));
        assert!(e < 1e-5, "{e}");
        let clamped = |at: f64| samples.iter().filter(|s| (s.point.z - at).abs() < 1e-9).count();
        assert!(each == 1 || clamped(near) > 1 && clamped(far) > 1);
        let got = read_raw(&mut job, buffer::SAMPLE_POINTS, samples.len());
        for (g, w) in got.iter().zip(&samples) {
            // Metres. A depth includes a slope (at most 5, accurate to 1e-5) times a quarter of a pixel.
            assert!(
                (dvec3(g[0], g[1], g[2]) - w.point).length() < 1e-5 * 5.0 * pitches(&grid),
                "{g:?} {w:?}"
            );
            assert!((g[3] - w.albedo).abs() <= 1e-6 * w.albedo, "{g:?} {w:?}");
        }
        if reflectance.has_normals() {
            let got = read_raw(&mut job, buffer::SAMPLE_NORMALS, samples.len());
            for (g, w) in got.iter().zip(&samples) {
                assert!((dvec3(g[0], g[1], g[2]) - w.normal).length() < 3e-5, "{g:?} {w:?}");
            }
        }
        let peak = samples.iter().fold(0.0f64, |a, s| a.max(s.albedo));
        let counts: Vec<u32> = read(&mut job, buffer::COUNTS, COUNTS as usize);
        let got = f64::from(f32::from_bits(counts[COUNT_PEAK_ALBEDO as usize]));
        assert!((got / peak - 1.0).abs() < 1e-6, "{got} {peak}");
        assert_eq!(counts[COUNT_FAULTS as usize], 0);
    }
    assert_valid(&gpu);
}

/// Random gradients at the points of a field whose depths have moved since its bonds were computed.
#[test]
pub fn combine() {
    let gpu = gpu();
    let grid = oblong();
    for (reflectance, each) in
        [(Reflectance::Lambertian, 4), (Reflectance::Retroreflective, 4), (Reflectance::Cosine, 1)]
    {
        let directed = reflectance.has_normals();
        let model = Model { reflectance, ..scene(3, 40, 1) };
        let twin = Twin { model: &model, grid: &grid };
        let mut field = Field { each, ..field(&grid, 31) };
        let mut job = job(&gpu, &model, &grid, &Fit::of(&grid, each));
        field.write(&mut job);
        run_bonds(&mut job, field.len());
        let bonds = field.bonds(&twin);
        let mut random = Random::new(32);
        for h in &mut field.heights {
            h.depth = f64::from((h.depth + random.uniform(-0.01, 0.01)) as f32);
        }
        field.write_heights(&mut job);
        let one = |s: &DVec2| s.to_array().map(|v| f64::from(v as f32));
        let slopes: Vec<[f64; 2]> = field.points(&twin, &bonds).0.iter().map(one).collect();
        write(&mut job, buffer::SLOPES, &slopes.iter().map(|s| s.map(|v| v as f32)).collect::<Vec<_>>());
        let slopes: Vec<DVec2> = slopes.into_iter().map(DVec2::from_array).collect();
        let gradient: Vec<Raw> = (0..each * field.len())
            .map(|_| std::array::from_fn(|k| random.uniform(-1.0, 1.0) * [20.0, 20.0, 20.0, 50.0][k]))
            .collect();
        write_raw(&mut job, buffer::GRADIENT, &gradient);
        let pulls: Vec<Pull> = gradient
            .iter()
            .zip(slopes.iter().flat_map(|s| std::iter::repeat_n(s, each)))
            .map(|(g, slope)| {
                let vector = dvec3(g[0], g[1], g[2]);
                match directed {
                    true => Pull { vector, albedo: vector.dot(slope.extend(-1.0).normalize()), depth: g[3] },
                    false => Pull { vector: DVec3::ZERO, albedo: g[0], depth: g[1] },
                }
            })
            .collect();
        // The prior alone, and together with data of the same size.
        for [bend, jump, sparse] in
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 16.0], [0.5, 0.25, 8.0], [0.0; 3]]
        {
            let mut weights =
                SurfaceWeights { bend, jump, sparse, faint: 8.0, iterations: 8.0, ..Default::default() };
            write_weights(&mut job, &weights);
            run_surface(&mut job, field.len(), 0, &["surface_combine"]);
            let want = twin::surface_combine(&twin, &bonds, &field.heights, &slopes, &pulls, &weights);
            let got = read_floats(&mut job, buffer::SURFACE_WEIGHTS, SURFACE_WEIGHTS as usize);
            weights.see(&want);
            let largest = [weights.largest.depth, weights.largest.albedo];
            assert!(
                error(got[SURFACE_LARGEST as usize..SURFACE_SPREAD as usize].iter().copied(), largest) < 3e-6
            );
            let got = read_raw(&mut job, buffer::HEIGHT_GRADIENT, field.len());
            let e =
                error(got.iter().flat_map(|g| [g[0], g[1]]), want.iter().flat_map(|c| c.slope.to_array()));
            assert!(e < 3e-6, "{reflectance:?} {weights:?}: slopes {e}");
            // The distance from a plane is a small difference of depths, which fp32 holds to 3e-8 m in pixels of 0.08
            // m.
            let e = error(got.iter().map(|g| g[2]), want.iter().map(|c| c.height.depth));
            assert!(e < 3e-6, "{reflectance:?} {weights:?}: depths {e}");
            let e = error(got.iter().map(|g| g[3]), want.iter().map(|c| c.height.albedo));
            assert!(e < 3e-6, "{reflectance:?} {weights:?}: albedos {e}");
            let sums = want.chunks(WORKGROUP as usize).map(|c| c.iter().map(|c| c.energy).sum::<f64>());
            let sums: Vec<f64> = sums.collect();
            let energy = read_floats(&mut job, buffer::L1_PARTIALS, sums.len());
            assert!(error(energy, sums.iter().copied()) < 3e-6);
            assert!(sums.iter().all(|s| (*s > 0.0) == (bend + jump + sparse > 0.0)));
        }
    }
    assert_valid(&gpu);
}

#[test]
pub fn several_steps() {
    let gpu = gpu();
    // Steps by a pixel's own gradient, by gradients spread over 1.5 pixels, and by a Gaussian that leaves the maps.
    [0.0, 1.5, 6.0].into_iter().for_each(|spread| check_steps(&gpu, spread));
    assert_valid(&gpu);
}

fn check_steps(gpu: &Gpu, spread: f64) {
    let (model, grid) = (scene(3, 40, 1), oblong());
    let twin = Twin { model: &model, grid: &grid };
    let mut field = both(&grid, 42);
    let bonds = field.bonds(&twin);
    let mut job = job(gpu, &model, &grid, &Fit::of(&grid, 4));
    field.write(&mut job);
    run_bonds(&mut job, field.len());
    let weights = SurfaceWeights {
        bend: 0.0,
        jump: 0.0,
        rates: Height { depth: 0.25, albedo: 16.0 },
        iterations: 6.0,
        // Then small gradients of depth count as rounding, and none of albedo does.
        largest: Height { depth: 1.0 / 8192.0, albedo: 0.0 },
        spread,
        ..Default::default()
    };
    write_weights(&mut job, &weights);
    let mut moments = vec![[Height::default(); 2]; field.len()];
    let depths: Vec<f64> = field.heights.iter().map(|h| h.depth).collect();
    let mut random = Random::new(43);
    let (mut dark, mut ends) = (0, 0);
    let [near, far] = [model.near_z(&grid), grid.n[2] - 1].map(|z| grid.position(DVec3::Z * z as f64).z);
    for number in 1..=6 {
        // Gradients of all sizes. One pixel has none.
        let scale = 10f64.powi(4 * number as i32 - 14);
        let mut one =
            |k: usize| f64::from((scale * random.uniform(-0.7, 1.0) * [1.0, 1.0, 30.0, 9.0][k]) as f32);
        let mut gradient: Vec<Raw> = (0..field.len()).map(|_| std::array::from_fn(&mut one)).collect();
        let alone = bonds.iter().position(|b| b.is_empty()).unwrap();
        gradient[alone] = [0.0; 4];
        write_raw(&mut job, buffer::HEIGHT_GRADIENT, &gradient);
        let combined: Vec<twin::Combined> = gradient
            .iter()
            .map(|g| twin::Combined {
                slope: dvec2(g[0], g[1]),
                height: Height { depth: g[2], albedo: g[3] },
                energy: 0.0,
            })
            .collect();
        let gradient = twin::surface_gradient(&bonds, &combined);
        let before = field.heights.clone();
        let pull = twin::surface_pull(&twin, &field.columns, &depths, &gradient, &weights, number);
        twin::surface_step(&twin, &pull, &weights, number, &mut field.heights, &mut moments);
        assert!(spread > 0.0 || field.heights[alone] == before[alone]);
        run_surface(&mut job, field.len(), number as usize - 1, &["surface_pull", "surface_step"]);
        let got = read_heights(&mut job, field.len());
        // The step of a nearly balanced depth is a quotient of two small numbers, and its rate is one less a cosine, which
        // drivers need not round well.
        for (k, e) in [0, 1].map(|k| (k, error(halves(&got)[k].clone(), halves(&field.heights)[k].clone()))) {
            assert!(e < 5e-6, "spread {spread} step {number}, {k}: {e}");
        }
        dark += field.heights.iter().filter(|h| h.albedo == 0.0).count();
        ends += field.heights.iter().filter(|h| h.depth == near || h.depth == far).count();
    }
    assert!(dark > 10 && ends > 10, "{dark} at zero, {ends} at an end");
    let got = read_raw(&mut job, buffer::HEIGHT_MOMENTS, field.len());
    for k in 0..4 {
        let of = |m: &[Height; 2]| if k % 2 == 0 { m[k / 2].depth } else { m[k / 2].albedo };
        assert!(error(got.iter().map(|g| g[k]), moments.iter().map(of)) < 1e-5);
    }
}

#[test]
pub fn extract() {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 1), oblong());
    let field = both(&grid, 51);
    let mut job = job(&gpu, &model, &grid, &Fit::of(&grid, 4));
    field.write(&mut job);
    run_bonds(&mut job, field.len());
    let columns = grid.n[0] * grid.n[1];
    let before: Vec<f32> = (0..8 * columns).map(|i| i as f32).collect();
    let of_layers = field.pixels().of_layers(columns);
    assert!(of_layers.iter().all(|n| *n > 20), "{of_layers:?}");
    for layer in 0..2 {
        let pixels = if layer == 0 { 0..of_layers[0] } else { of_layers[0]..field.len() };
        let in_maps: Vec<usize> =
            field.columns[pixels.clone()].iter().map(|c| *c as usize % columns).collect();
        write(&mut job, buffer::COLUMNS, &before);
        let s = Schedule::of(|s| surface::extract(s, job.plan.finest(), of_layers, layer));
        job.perform(&s);
        let got: Vec<[f32; 8]> = job.executor.read(COLUMNS_HOST, ..columns);
        let slopes = read_pairs(&mut job, buffer::SLOPES, field.len()).into_iter().map(DVec2::from_array);
        let want = twin::surface_extract(&field.heights, &slopes.collect::<Vec<_>>());
        let want = &want[pixels.clone()];
        let of = |k: usize| in_maps.iter().map(|c| f64::from(got[*c][k])).collect::<Vec<f64>>();
        assert_eq!(of(0), want.iter().map(|c| c.albedo).collect::<Vec<_>>());
        assert_eq!(of(1), want.iter().map(|c| c.depth).collect::<Vec<_>>());
        assert!(of(3).iter().all(|v| *v == 1.0));
        for k in 0..3 {
            let normals = want.iter().map(|c| c.normal[k]);
            assert!(error(of(4 + k), normals) < 1e-6);
        }
        for c in (0..columns).filter(|c| !in_maps.contains(c)) {
            assert_eq!(got[c], before[8 * c..8 * c + 8], "pixels without surface are unchanged");
        }
    }
    assert_valid(&gpu);
}

/// The whole schedule, with the stage's own weights: every iteration starts from the result of the previous one.
#[test]
pub fn iterations_in_a_row() {
    let gpu = gpu();
    let cases = [
        (Geometry::Confocal, Reflectance::Cosine, false, Accumulation::Owned, 4),
        (Geometry::TwoPoints, Reflectance::Lambertian, true, Accumulation::Fixed, 1),
        (Geometry::Product, Reflectance::Isotropic, false, Accumulation::Fixed32, 4),
    ];
    for (geometry, reflectance, curved, accumulation, each) in cases {
        check_iterations(&gpu, geometry, reflectance, curved, accumulation, each);
    }
    assert_valid(&gpu);
}

fn check_iterations(
    gpu: &Gpu,
    geometry: Geometry,
    reflectance: Reflectance,
    curved: bool,
    accumulation: Accumulation,
    each: usize,
) {
    let grid = oblong();
    let mut field = Field { each, ..both(&grid, 61) };
    let model = variant(&scene(5, 48, 9), geometry, reflectance, curved, 62);
    let model = measured(&model, &grid, &field, 63);
    let twin = Twin { model: &model, grid: &grid };
    let o = Fit::of(&grid, each).with(|o| {
        o.accumulation = accumulation;
        o.sparsity = 0.05;
    });
    let mut job = job(gpu, &model, &grid, &o);
    let placed = Placed { pixels: field.len(), most: 60.0, explained: 2.0, left: 2.0 };
    let mut words = surface::weights(&model, job.plan.finest(), placed, &o.options, 12);
    words[SURFACE_SPREAD as usize] = 1.25;
    let mut weights = SurfaceWeights::from(words);
    assert!(weights.bend > 0.0 && weights.jump > 0.0 && weights.iterations == 12.0);
    assert!(weights.sparse > 0.0 && weights.faint == f64::from(6.0f32));
    write(&mut job, buffer::SURFACE_WEIGHTS, &words);
    field.write(&mut job);
    zero_histograms(&mut job);
    let bonds = field.bonds(&twin);
    let mut s = Schedule::of(|s| surface::start_of(s, job.plan.finest(), field.len(), each));
    s.set(buffer::COUNTS, COUNT_FAULTS, 0);
    s.set(buffer::COUNTS, COUNT_PEAK_ALBEDO, 0);
    const ROWS: usize = 8;
    for i in 0..ROWS {
        surface::iteration(&mut s, &job.plan, job.plan.finest(), field.len(), [i, i, 12]);
    }
    // A comparison without a step is closed by the shared pass.
    let last = *job.plan.finest();
    surface::render(&mut s, &job.plan, &last, field.len(), &RESIDUAL);
    s.dispatch(&FINISH, [1, 1, 1], 1)
        .bind(buffer::SCENE, last.scene)
        .with(Push { iteration: ROWS as u32, ..Default::default() });
    job.perform(&s);
    let mut moments = vec![[Height::default(); 2]; field.len()];
    let mut want: Vec<[f64; 3]> = vec![];
    let first = field.heights.clone();
    let depths: Vec<f64> = first.iter().map(|h| h.depth).collect();
    for i in 0..=ROWS {
        let (slopes, samples) = field.points(&twin, &bonds);
        let (residual, [data, plain]) = twin::residual_weighted(&twin, &twin::forward(&twin, &samples));
        if i == ROWS {
            // The prior is that of the last step.
            want.push([data, plain, want[ROWS - 1][2]]);
            break;
        }
        let pulls = twin::surface_gather(&twin, &samples, &residual);
        let combined = twin::surface_combine(&twin, &bonds, &field.heights, &slopes, &pulls, &weights);
        let energy = combined.iter().map(|c| c.energy).sum::<f64>();
        weights.see(&combined);
        want.push([data, plain, energy]);
        let gradient = twin::surface_gradient(&bonds, &combined);
        let number = i as u32 + 1;
        let pull = twin::surface_pull(&twin, &field.columns, &depths, &gradient, &weights, number);
        twin::surface_step(&twin, &pull, &weights, number, &mut field.heights, &mut moments);
    }
    let rows: Vec<[u32; TRACE_ROW as usize]> = job.executor.read(buffer::TRACE, ..=ROWS);
    let what = format!("{geometry:?} {reflectance:?}");
    let loss = |w: &[f64; 3]| w[0] + w[2];
    assert!(loss(&want[ROWS - 1]) < 0.9 * loss(&want[0]), "{what}: {want:?}");
    // A point next to a bin's centre may fall to either side of it, which changes one of about a thousand parts of a
    // gradient. Adam takes as large a step for a small gradient as for a large one.
    for (row, want) in rows.iter().zip(&want) {
        let got = [TRACE_OBJECTIVE, TRACE_DATA, TRACE_L1].map(|i| f64::from(f32::from_bits(row[i as usize])));
        for k in 0..3 {
            assert!((got[k] / want[k] - 1.0).abs() < 1e-3, "{what}: {got:?} {want:?}");
        }
        assert_eq!(
            [row[TRACE_ACTIVE as usize] as usize, row[TRACE_FAULTS as usize] as usize],
            [each * field.len(), 0]
        );
    }
    let got = halves(&read_heights(&mut job, field.len()));
    let (want, first) = (halves(&field.heights), halves(&first));
    for k in 0..2 {
        let moved = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>();
        let share = moved(&got[k], &want[k]) / moved(&want[k], &first[k]);
        assert!(share < 1e-3, "{what}: {k} differs by {share} of the way");
    }
}
