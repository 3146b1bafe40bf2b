//! Real captures, read and put to use.

use std::path::{Path, PathBuf};

use fixtures::captures::{angles, changed, place, total};
use fixtures::command::succeed;
use thirdbounce::capture::{Capture, ReadOptions, auto_gate, read, read_given, recorded_gate, write};
use thirdbounce::export::npz;
use thirdbounce::job;
use thirdbounce::settings::Settings;

/// Captures whose records begin before the hidden light.
fn has_direct_light(name: &str) -> bool {
    ["su_", "diffuse_s_"].iter().any(|start| name.starts_with(start))
}

pub fn real_captures_are_read_and_gated(data: &Path) {
    let mut seen = 0;
    for entry in std::fs::read_dir(data).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if path.extension().is_none_or(|e| e != "npz") || name.starts_with("truth_") {
            continue;
        }
        let c = read(&path).unwrap();
        seen += 1;
        assert_eq!(c.is_confocal(), name.contains("_confocal"), "{name}");
        assert_eq!(c.is_planar(), !name.contains("bumpwall"), "{name}");
        match auto_gate(&c) {
            Some(found) => {
                assert!(has_direct_light(&name), "{name}: {found:?}");
                // Of S U, their own code zeroes paths below 0.72 m; its letters begin at 1.1 m, the matt S at 0.95 m.
                assert!((0.5..0.9).contains(&found.gate.from), "{found:?}");
            }
            None => assert!(!has_direct_light(&name), "{name}"),
        }
        let mut whole = c.clone();
        let recorded = recorded_gate(&mut whole).map(|(found, filled)| {
            assert!(filled == 0 && whole == c, "{name}");
            [found.gate.from, found.gate.to].map(|path| (100.0 * path).round())
        });
        assert_eq!(recorded, name.starts_with("z_captured").then_some([75.0, 180.0]), "{name}");
        let [x0, x1, _, _] = c.wall_extent();
        assert!(x1 - x0 > 0.5 && x1 - x0 < 2.1, "{name}");
    }
    assert!(seen > 0);
}

pub fn npz_and_ytal_twins_agree(data: &Path) {
    for name in ["z_confocal_32", "spheres_confocal_32", "z_bumpwall_confocal_32"] {
        let (plain, native) = (
            read(&data.join(format!("{name}.npz"))).unwrap(),
            read(&data.join(format!("native/{name}.hdf5"))).unwrap(),
        );
        assert!(plain.histograms == native.histograms, "{name}");
        assert_eq!(
            (plain.scan, plain.bins, plain.bin_width, plain.t_start),
            (native.scan, native.bins, native.bin_width, native.t_start)
        );
        assert_eq!((&plain.laser, &plain.sensor), (&native.laser, &native.sensor), "{name}");
        if plain.sensor_normal.is_some() {
            assert_eq!(plain.sensor_normal, native.sensor_normal, "{name}");
        }
    }
}

pub fn real_truth_is_read(data: &Path) {
    let truth = npz::read_truth(&data.join("truth_z_confocal_32.npz")).unwrap();
    assert_eq!((truth.nx, truth.ny, truth.extent), (128, 128, [-0.5, 0.5, -0.5, 0.5]));
    let depth = (0..truth.depth.len()).find(|&p| truth.mask[p]).map(|p| truth.depth[p]).unwrap();
    assert!((depth - 0.6).abs() < 1e-3, "{depth}");
}

pub fn normals_of_a_captured_wall_agree_with_its_own(data: &Path) {
    let c = read(&data.join("z_bumpwall_confocal_32.npz")).unwrap();
    let bare = changed(&c, |c| (c.laser_normal, c.sensor_normal) = (None, None));
    let (with, _) = bare.with_normals().unwrap();
    let (mean, most) = angles(&with.laser_normal.unwrap(), c.laser_normal.as_ref().unwrap());
    println!("mean {mean:.3}, most {most:.3} degrees");
    assert!(mean < 1.0 && most < 3.0, "mean {mean:.2}, most {most:.2} degrees");
    assert_eq!(c.with_normals().unwrap(), (c, None));
}

pub fn real_captures_go_from_any_form_to_any(data: &Path) {
    let native = data.join("native");
    let wall = |size: f64| ReadOptions::default().with_wall(size);
    let fine = wall(0.8).with_bin_width(0.0015);
    let all = [
        ("stanford_statue64_meas.mat", ReadOptions::default()),
        ("lct_data_s_u.mat", ReadOptions::default()),
        ("ccsocr_statue", wall(2.0)),
        ("z_v73.mat", fine),
        ("z_bumpwall_confocal_32.hdf5", ReadOptions::default()),
    ];
    for (name, given) in all {
        let c = read_given(&native.join(name), &given).unwrap().capture;
        for ending in ["npz", "hdf5", "mat"] {
            let (_folder, path) = place(&format!("made.{ending}"));
            let back = match write(&c, &path) {
                Ok(_) if ending == "mat" => {
                    let [x0, x1, ..] = [c.laser[0].x, c.laser[c.pair_count() - 1].x];
                    let given = wall(x1 - x0).with_bin_width(c.bin_width);
                    read_given(&path, &given).unwrap().capture
                }
                Ok(_) => read(&path).unwrap(),
                Err(e) => {
                    // Only the Stanford form cannot hold a curved wall.
                    assert!(ending == "mat" && name.contains("bumpwall"), "{name} as {ending}: {e}");
                    continue;
                }
            };
            assert!(back.histograms == c.histograms, "{name} as {ending}");
            assert_eq!((back.scan, back.bins, back.bin_width), (c.scan, c.bins, c.bin_width), "{name}");
            assert!(
                back.laser.iter().zip(&c.laser).all(|(a, b)| a.distance(*b) < 1e-6),
                "{name} as {ending}"
            );
        }
        // Counts to the last one, real numbers to float32.
        let kept = |small: Capture| {
            let off = (total(&small) / total(&c) - 1.0).abs();
            assert!(off == 0.0 || !c.integer_counts && off < 1e-6, "{name}: off by {off}");
        };
        kept(c.binned(3).unwrap());
        kept(c.summed(2).unwrap());
    }
}

pub fn real_captures_raise_no_false_warning(data: &Path) {
    let entries = std::fs::read_dir(data).unwrap().map(|entry| entry.unwrap().path());
    let is_capture = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy();
        name.ends_with(".npz") && !name.starts_with("truth_")
    };
    let mut all: Vec<(PathBuf, Settings)> =
        entries.filter(is_capture).map(|path| (path, Settings::default())).collect();
    let native = data.join("native");
    let wall = Settings { wall: Some(0.8), bin_width: Some(0.0015), ..Settings::default() };
    all.push((native.join("z_v73.mat"), wall));
    for name in [
        "stanford_statue64_meas.mat",
        "lct_data_s_u.mat",
        "lct_data_exit_sign.mat",
        "km_mannequin.mat",
        "znlos_bunny_32.mat",
    ] {
        all.push((native.join(name), Settings::default()));
    }
    assert!(all.len() > 12, "{all:?}");
    for (path, settings) in all {
        let loaded = job::load(&path, &settings).unwrap_or_else(|e| panic!("{e}"));
        // Counters that were full are no mistake of the file.
        let warnings: Vec<_> = loaded.warnings.iter().filter(|w| !w.contains("counter")).collect();
        assert!(warnings.is_empty(), "{}: {warnings:?}", path.display());
        // None of these captures was enlarged, scaled or reversed.
        let of_faults =
            ["multiples of", "enlarged", "runs backwards", "in place of missing ones", "upside down"];
        let is_false = |note: &&String| of_faults.iter().any(|words| note.contains(words));
        let notes: Vec<_> = loaded.notes.iter().filter(is_false).collect();
        assert!(notes.is_empty(), "{}: {notes:?}", path.display());
    }
    // Half the width for the whole is seen where faces are round or walls are not flat; letters are flat.
    let mut c = read(&data.join("spheres_confocal_32.npz")).unwrap();
    let [x0, x1, ..] = c.wall_extent();
    c.set_wall(0.5 * (x1 - x0)).unwrap();
    assert!(c.warnings().join("").contains("half its width"));
}

/// The network alone takes a third of the plate and its dark print for holes.
pub fn the_exit_sign_is_whole(data: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let capture = data.join("native/lct_data_exit_sign.mat").display().to_string();
    let of = |solver: &str| {
        let out = folder.path().join(solver);
        let out = out.display().to_string();
        succeed(&["reconstruct", &capture, "--out", &out, "--solver", solver, "--lateral", "128", "--quiet"]);
        let maps = npz::read_maps(&Path::new(&out).join("maps.npz")).unwrap();
        // By the brightest half where the method has haze.
        let least = 0.5 * maps.albedo.iter().copied().fold(0.0, f32::max);
        let is_plate = |p: &usize| maps.depth[*p].is_finite() && maps.albedo[*p] > least;
        let lit: Vec<bool> = (0..maps.albedo.len()).map(|p| is_plate(&p)).collect();
        (maps.mask, lit)
    };
    let ((mask, _), (_, plate)) = (of("surface"), of("lct"));
    let count = plate.iter().filter(|p| **p).count();
    let both = plate.iter().zip(&mask).filter(|(plate, mask)| **plate && **mask).count();
    assert!(both as f64 > 0.9 * count as f64, "{both} of {count}");
}

/// The model that trials choose, of captures that reflect in a known way.
pub fn trials_tell_how_captured_things_reflect(data: &Path) {
    let folder = tempfile::tempdir().unwrap();
    for (name, model) in [
        ("z_captured_confocal_64.npz", "lambertian"),
        ("spheres_confocal_32.npz", "lambertian"),
        // A pulse of a quarter of the wall, columns whose gates open late.
        ("native/km_mannequin.mat", "lambertian"),
    ] {
        let [capture, out] = [data.join(name), folder.path().join(model)].map(|p| p.display().to_string());
        // The trials are whole, the solve after them is not.
        let short = ["--iterations", "1", "--lateral", "64", "--quiet"];
        succeed(&[&["reconstruct", &capture, "--out", &out][..], &short].concat());
        let report = std::fs::read(Path::new(&out).join("report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        assert_eq!(report["settings"]["model"], model, "{name}");
    }
}
