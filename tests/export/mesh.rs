//! The surface mesh: closed where points are, facing the wall, near the truth; also for a simulated figure. A letter keeps its
//! hand from a mesh file through simulation and solve to pictures, points and mesh.

use fixtures::device;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

use fixtures::captures::place;
use glam::{DVec3, Vec3, dvec3, vec3};
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Problem, Watch, default_volume};
use thirdbounce::export::{mesh, ply, png};
use thirdbounce::maps::{Layer, Maps};
use thirdbounce::methods::SolverOptions;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::transport::Grid;
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

struct Mesh {
    vertices: Vec<Vec3>,
    normals: Vec<Vec3>,
    albedo: Vec<f32>,
    triangles: Vec<[usize; 3]>,
}

/// Written and read again, with what must hold of every mesh.
fn mesh(maps: &Maps) -> Mesh {
    let (_folder, path) = place("mesh.ply");
    mesh::write(&path, maps).unwrap();
    let mut file = std::fs::File::open(&path).unwrap();
    use ply_rs_bw::ply::{DefaultElement, Property};
    let parsed = ply_rs_bw::parser::Parser::<DefaultElement>::new().read_ply(&mut file).unwrap();
    let float = |v: &DefaultElement, name: &str| match v[name] {
        Property::Float(value) => value,
        _ => panic!("{name} is no float"),
    };
    let vector = |v: &DefaultElement, names: [&str; 3]| Vec3::from_array(names.map(|name| float(v, name)));
    let corners = |f: &DefaultElement| match &f["vertex_indices"] {
        Property::ListInt(corners) => [corners[0], corners[1], corners[2]].map(|c| c as usize),
        _ => panic!("no list of indices"),
    };
    let vertices = &parsed.payload["vertex"];
    let mesh = Mesh {
        vertices: vertices.iter().map(|v| vector(v, ["x", "y", "z"])).collect(),
        normals: vertices.iter().map(|v| vector(v, ["nx", "ny", "nz"])).collect(),
        albedo: vertices.iter().map(|v| float(v, "albedo")).collect(),
        triangles: parsed.payload["face"].iter().map(corners).collect(),
    };
    assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    let mut edges: BTreeMap<[usize; 2], i32> = BTreeMap::new();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.vertices[v]);
        assert!((b - a).cross(c - a).z < 0.0, "a triangle faces away from the wall");
        for k in 0..3 {
            // Neighbours pass their edge in opposite directions.
            assert!(
                edges.insert([t[k], t[(k + 1) % 3]], 1).is_none(),
                "two triangles on one side of an edge"
            );
        }
    }
    mesh
}

impl Mesh {
    /// Closed lines of edges with one triangle: the rim, and one more for every hole.
    fn rims(&self) -> usize {
        let edges: std::collections::BTreeSet<[usize; 2]> =
            self.triangles.iter().flat_map(|t| (0..3).map(|k| [t[k], t[(k + 1) % 3]])).collect();
        let mut next: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for [a, b] in edges.iter().filter(|[a, b]| !edges.contains(&[*b, *a])) {
            next.entry(*a).or_default().push(*b);
            next.entry(*b).or_default().push(*a);
        }
        let mut rims = 0;
        while let Some((start, _)) = next.first_key_value() {
            let mut open = vec![*start];
            rims += 1;
            while let Some(v) = open.pop() {
                open.extend(next.remove(&v).unwrap_or_default());
            }
        }
        rims
    }

    fn centres(&self) -> impl Iterator<Item = Vec3> {
        self.triangles.iter().map(|t| t.map(|v| self.vertices[v]).iter().sum::<Vec3>() / 3.0)
    }

    fn distance(&self, point: Vec3) -> f32 {
        let near = self.vertices.iter().copied().chain(self.centres());
        near.map(|v| v.distance_squared(point)).fold(f32::INFINITY, f32::min).sqrt()
    }
}

fn empty(n: usize, extent: [f64; 4]) -> Maps {
    Maps { mask_fraction: Some(0.0), ..Maps::empty([n, n], extent) }
}

#[test]
fn a_ball_is_one_smooth_sheet() {
    // Of 0.3 m radius, 50 pixels of 16 mm; depths in steps of 6 mm as those of a voxel grid, normals some 6° off.
    let (n, radius, middle) = (50, 0.3, dvec3(0.02, -0.03, 0.8));
    let mut maps = empty(n, [-0.4, 0.4, -0.4, 0.4]);
    let pixel = 0.8 / n as f64;
    let mut noise = device::Random::new(3);
    let mut points = Vec::new();
    for p in 0..n * n {
        let [x, y] = maps.centre(p / n, p % n);
        let aside = (dvec3(x, y, middle.z) - middle).length();
        if aside > 0.9 * radius {
            continue;
        }
        let z = middle.z - (radius * radius - aside * aside).sqrt();
        let normal = (dvec3(x, y, z) - middle) / radius;
        let mut wobble = || noise.uniform(-0.12, 0.12);
        let off = (normal + dvec3(wobble(), wobble(), wobble())).normalize();
        maps.depth[p] = ((z / 0.006).round() * 0.006) as f32;
        maps.normal[p] = off.as_vec3().to_array();
        maps.albedo[p] = 0.5;
        points.push(vec3(x as f32, y as f32, z as f32));
    }
    maps.set_mask(0.3);
    let mesh = mesh(&maps);
    let off = |v: &Vec3| (v.as_dvec3().distance(middle) - radius).abs();
    let (sum, worst) = mesh.vertices.iter().map(off).fold((0.0, 0.0f64), |(s, w), d| (s + d, w.max(d)));
    let mean = sum / mesh.vertices.len() as f64;
    assert!(mean < 0.1 * pixel && worst < 0.6 * pixel, "{mean} m, at most {worst} m off");
    assert_eq!(mesh.rims(), 1, "holes");
    let far = points.iter().map(|p| f64::from(mesh.distance(*p))).fold(0.0, f64::max);
    assert!(far < pixel, "a point is {far} m from the mesh");
    assert!(mesh.albedo.iter().all(|a| (a - 0.5).abs() < 1e-6));
    let angle = |(v, n): (&Vec3, &Vec3)| {
        ((v.as_dvec3() - middle).normalize()).dot(n.as_dvec3()).clamp(-1.0, 1.0).acos().to_degrees()
    };
    let angles: f64 = mesh.vertices.iter().zip(&mesh.normals).map(angle).sum();
    let angles = angles / mesh.vertices.len() as f64;
    assert!(angles < 7.5, "normals are {angles} degrees off");
    println!("mean {mean:.6} worst {worst:.6} far {far:.6} angle {angles:.2}");
}

#[test]
fn rounding_of_positions_turns_no_triangle() {
    // Ten kilometres aside, where float32 positions stand 1 mm apart: steep narrow triangles are turned by rounding.
    let (n, radius, middle) = (50, 0.3, dvec3(1e4, 1e4, 0.8));
    let mut maps = empty(n, [middle.x - 0.4, middle.x + 0.4, middle.y - 0.4, middle.y + 0.4]);
    for p in 0..n * n {
        let [x, y] = maps.centre(p / n, p % n);
        let aside = (x - middle.x).hypot(y - middle.y);
        if aside < radius {
            let z = middle.z - (radius * radius - aside * aside).sqrt();
            (maps.albedo[p], maps.depth[p]) = (0.5, z as f32);
            maps.normal[p] = ((dvec3(x, y, z) - middle) / radius).as_vec3().to_array();
        }
    }
    maps.set_mask(0.3);
    assert!(mesh(&maps).triangles.len() > 1000);
}

#[test]
fn a_jump_is_not_bridged_and_nothing_gives_an_empty_file() {
    let mut maps = empty(24, [0.0, 0.24, 0.0, 0.24]);
    for p in 0..24 * 24 {
        (maps.albedo[p], maps.normal[p]) = (1.0, [0.0, 0.0, -1.0]);
        maps.depth[p] = if p / 24 < 12 { 0.5 } else { 0.6 };
    }
    maps.set_mask(0.3);
    let sheets = mesh(&maps);
    for t in &sheets.triangles {
        let z = t.map(|v| sheets.vertices[v].z);
        assert!(
            z.iter().all(|z| (z - z.round()).abs() > 0.0 && (z - 0.5).abs().min((z - 0.6).abs()) < 0.01),
            "{z:?}"
        );
    }
    assert_eq!(sheets.rims(), 2);
    // A point beyond all cells is left out.
    maps.depth[24 * 18 + 12] = f32::MAX;
    let without = mesh(&maps);
    assert!(without.triangles.len() > 900 && without.vertices.iter().all(|v| v.z < 0.7));
    maps.mask.fill(false);
    assert!(mesh(&maps).triangles.is_empty());
}

#[test]
fn what_lies_behind_is_part_of_the_mesh() {
    let mut maps = empty(24, [0.0, 0.24, 0.0, 0.24]);
    let Maps { albedo, depth, normal, mask, .. } = maps.clone();
    let mut behind = Layer { albedo, depth, normal, mask, depth_error: None };
    for p in 0..24 * 24 {
        let front = (6..18).contains(&(p / 24)) && (6..18).contains(&(p % 24));
        (maps.albedo[p], maps.normal[p]) = (1.0, [0.0, 0.0, -1.0]);
        maps.depth[p] = if front { 0.5 } else { 0.6 };
        if front {
            (behind.albedo[p], behind.depth[p], behind.normal[p]) = (0.5, 0.6, [0.0, 0.0, -1.0]);
        }
    }
    maps.behind = Some(behind);
    maps.set_mask(0.3);
    let both = mesh(&maps);
    let lies = |z: f32| both.vertices.iter().filter(|v| (v.z - z).abs() < 0.005).count();
    assert!(lies(0.5) > 100 && lies(0.6) > 400, "{} {}", lies(0.5), lies(0.6));
    assert_eq!(both.rims(), 2, "the wall has no hole behind the plate");
    let middle =
        both.vertices.iter().zip(&both.albedo).filter(|(v, _)| (v.x - 0.12).hypot(v.y - 0.12) < 0.03);
    assert!(middle.clone().all(|(v, a)| (a - if v.z < 0.55 { 1.0 } else { 0.5 }).abs() < 0.01));
    assert!(middle.count() > 20);
}

/// Maps after 40 iterations, and the width of a voxel.
fn solved(capture: &Capture, lateral: usize) -> (Maps, f64) {
    let options = SurfaceOptions::default().with(|o| {
        o.lateral = lateral;
        o.iterations = 40;
    });
    let volume = default_volume(capture, options.min_depth).unwrap();
    let grid = Grid::new(volume, options.lateral, capture.bin_width).unwrap();
    let voxel = grid.pitch.x;
    let mut go = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut go, maps_every: None, maps_at: &[] };
    let solver = SolverOptions::from(options);
    let mut maps = solver.solve(&device::gpu(), &Problem::new(capture, grid), &mut watch).unwrap().maps;
    maps.set_mask(0.3);
    (maps, voxel)
}

#[test]
fn a_letter_of_a_mesh_file_is_read_in_pictures_points_and_mesh() {
    // An F for a viewer at +z, who sees +x on the right: stem and two bars. The scene turns it half round, to the wall.
    let (_folder, path) = place("f.obj");
    let boxes = [[-0.2, -0.08, -0.3, 0.3], [-0.08, 0.2, 0.18, 0.3], [-0.08, 0.12, -0.03, 0.09]];
    let corners = boxes.map(|[x0, x1, y0, y1]| {
        format!("v {x0} {y0} 0\nv {x1} {y0} 0\nv {x1} {y1} 0\nv {x0} {y1} 0\nf -4 -3 -2 -1\n")
    });
    std::fs::write(&path, corners.concat()).unwrap();
    let scene = Scene { scan: 16, ..Scene::named(path.to_str().unwrap()).unwrap() };
    let options = RenderOptions { noise: 0.05, ..RenderOptions::default() };
    let (maps, _) = solved(&simulate(&scene, &options).unwrap().capture, 32);
    // Below the bars only the stem is left: at x = 0.14, and so on the left of the picture.
    let [x0, x1, y0, y1] = maps.extent;
    let shown = png::albedo_of(&maps);
    let grey = |right: f64, up: f64| {
        let column = (right - -x1) / (x1 - x0) * shown.width as f64;
        let row = (y1 - up) / (y1 - y0) * shown.height as f64;
        shown.rgb[3 * (row as usize * shown.width + column as usize)]
    };
    assert!(grey(-0.14, -0.2) > 60 && grey(0.14, -0.2) < 30, "{} {}", grey(-0.14, -0.2), grey(0.14, -0.2));
    assert!(grey(-0.14, 0.24) > 60 && grey(0.14, 0.24) > 60, "{} {}", grey(-0.14, 0.24), grey(0.14, 0.24));
    // Points and mesh are right-handed: turned half round about y, they are the F of the file.
    let is_letter = |points: &[Vec3], what: &str| {
        let near = |right: f32, up: f32| {
            points.iter().filter(|p| (-p.x - right).abs() < 0.04 && (p.y - up).abs() < 0.04).count()
        };
        assert!(near(-0.14, -0.2) > 0 && near(-0.14, 0.24) > 0 && near(0.1, 0.24) > 0, "{what}: a stroke");
        assert_eq!(near(0.14, -0.2), 0, "{what} is mirrored");
        assert!(points.iter().all(|p| (p.z - 0.8).abs() < 0.1), "{what}: z runs into the scene");
    };
    is_letter(&mesh(&maps).vertices, "mesh");
    let file = path.with_extension("ply");
    ply::write(&file, &maps).unwrap();
    let bytes = std::fs::read(&file).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let points = bytes[end..].chunks_exact(35).map(|p| vec3(float(p), float(&p[4..]), float(&p[8..])));
    is_letter(&points.collect::<Vec<_>>(), "points");
}

#[test]
fn a_reconstructed_figure_is_met_to_less_than_a_voxel() {
    let scene = Scene { scan: 16, ..Scene::named("figure").unwrap() };
    let capture =
        simulate(&scene, &RenderOptions { noise: 0.05, ..RenderOptions::default() }).unwrap().capture;
    let (maps, voxel) = solved(&capture, 64);
    let mesh = mesh(&maps);

    let real = truth(&scene, 128).unwrap();
    let there = (0..real.depth.len()).filter(|p| real.mask[*p]);
    let seen: Vec<(DVec3, DVec3)> = there
        .map(|p| {
            let [x, y] = real.centre(p / real.ny, p % real.ny);
            (dvec3(x, y, f64::from(real.depth[p])), DVec3::from_array(real.normal[p].map(f64::from)))
        })
        .collect();
    // True points stand 8 mm apart: near one, what counts is the way to the plane through it.
    let off = |v: Vec3| {
        let v = v.as_dvec3();
        let nearest = seen.iter().min_by(|a, b| a.0.distance_squared(v).total_cmp(&b.0.distance_squared(v)));
        let (at, normal) = nearest.unwrap();
        if at.distance(v) < 0.012 { (v - at).dot(*normal).abs() } else { at.distance(v) }
    };
    let count = mesh.triangles.len() as f64;
    let to_truth = mesh.centres().map(off).sum::<f64>() / count;
    let far: Vec<f64> = seen.iter().map(|(p, _)| f64::from(mesh.distance(p.as_vec3()))).collect();
    let from_truth = far.iter().sum::<f64>() / far.len() as f64;
    let within = far.iter().filter(|d| **d < voxel).count() as f64 / far.len() as f64;
    println!(
        "{count} triangles, {} rims; mesh to truth {:.2} mm, truth to mesh {:.2} mm, {within:.3} within a voxel of \
         {:.2} mm",
        mesh.rims(),
        1e3 * to_truth,
        1e3 * from_truth,
        1e3 * voxel
    );
    assert!(count > 1000.0 && to_truth < 0.6 * voxel && from_truth < 0.6 * voxel && within > 0.9);
}
