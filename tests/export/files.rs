//! Result files: their content, their orientation, and that they appear whole or not at all.

use std::path::Path;

use fixtures::captures::{assert_error, place, ramp};
use thirdbounce::Kind;
use thirdbounce::export::volume::VolumeArrays;
use thirdbounce::export::{self, npz, picture, ply, png as pictures, report, volume};
use thirdbounce::files::atomic;
use thirdbounce::maps::{Layer, Maps, Truth};
use thirdbounce::measure::Metrics;

/// 4 x 2 pixels; everything dark except (3, 1): the corner of largest x and y; and a dimmer (0, 0).
fn maps() -> Maps {
    let mut maps = Maps { mask_fraction: Some(0.0), ..Maps::empty([4, 2], [-1.0, 1.0, 0.0, 1.0]) };
    (maps.albedo[7], maps.depth[7], maps.normal[7]) = (2.0, 1.5, [0.0, 0.6, -0.8]);
    (maps.albedo[0], maps.depth[0], maps.normal[0]) = (1.0, 0.5, [0.0, 0.0, -1.0]);
    maps.set_mask(0.25);
    maps
}

/// Equal, NaN included.
fn same(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
}

#[test]
fn maps_come_back() {
    let (_folder, path) = place("maps.npz");
    npz::write_maps(&path, &maps()).unwrap();
    let back = npz::read_maps(&path).unwrap();
    let m = maps();
    assert!(same(&back.albedo, &m.albedo) && same(&back.depth, &m.depth));
    assert!(same(back.normal.as_flattened(), m.normal.as_flattened()));
    assert_eq!(
        (back.nx, back.ny, back.extent, back.mask, back.mask_fraction),
        (4, 2, m.extent, m.mask, Some(0.25))
    );
    assert_error(npz::read_truth(&path), Kind::Input, &["maps.npz", "gt_depth", "it holds albedo"]);
    assert_error(npz::read_maps(path.parent().unwrap()), Kind::Input, &["folder"]);
    assert_error(npz::read_maps(Path::new("missing.npz")), Kind::Input, &["missing.npz", "cannot be read"]);
}

/// `maps.save("x.mat")` and its like write that one file; MATLAB's indices are those of the npz.
#[test]
fn maps_are_saved_as_the_file_that_the_name_says() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut m = maps();
    m.depth_error = Some((0..8).map(|p| 0.001 * (p + 1) as f32).collect());
    for (name, head) in [
        ("x.npz", &b"PK"[..]),
        ("x.mat", b"MATLAB 5.0"),
        ("x.exr", b"\x76\x2f\x31\x01"),
        ("x.ply", b"ply\n"),
        ("x.PNG", b"\x89PNG"),
        ("x.svg", b"<svg"),
    ] {
        assert_eq!(export::save(&at(name), &m).unwrap(), [at(name)]);
        assert!(std::fs::read(at(name)).unwrap().starts_with(head), "{name}");
    }
    assert_error(export::save(&at("x.tiff"), &m), Kind::Options, &[".tiff", ".mat", "folder"]);
    assert!(!at("x.tiff").exists());
    assert!(export::save(&at("folder"), &m).unwrap().contains(&at("folder").join("maps.svg")));
    // A folder that is there may have any name.
    std::fs::create_dir(at("run.2")).unwrap();
    assert!(export::save(&at("run.2"), &m).unwrap().len() > 5);

    // The figure for papers is white with text as text; the maps alone have white where there is no surface.
    let svg = std::fs::read_to_string(at("x.svg")).unwrap();
    for part in ["fill=\"#fff\"", ">Albedo<", ">Depth<", ">Normals<", ">Expected depth error<", ">x, m<"] {
        assert!(svg.contains(part), "{part}");
    }
    let file = std::io::BufReader::new(std::fs::File::open(at("x.PNG")).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
    let (width, height) =
        (reader.info().width as usize, reader.next_frame(&mut rgb).unwrap().height as usize);
    assert_eq!((width, height), (4 * 512 + 3 * 16, 256));
    let pixel = |x: usize, y: usize| [0, 1, 2].map(|c| rgb[3 * (y * width + x) + c]);
    // In the depths (3, 1) is at the upper left, and (2, 1) beside it is no surface.
    assert!(pixel(528, 0) != [255; 3] && pixel(528 + 200, 0) == [255; 3]);
}

#[test]
fn depth_error_is_written_where_it_is_known() {
    let (folder, path) = place("maps.npz");
    let mut m = two_layers();
    npz::write_maps(&path, &m).unwrap();
    assert_eq!(npz::read_maps(&path).unwrap().depth_error, None, "as in files of before");
    export::write_maps(folder.path(), &m).unwrap();
    let pictures = ["depth_error.png", "probability.png"].map(|name| folder.path().join(name));
    assert!(pictures.iter().all(|path| !path.exists()));

    m.depth_error = Some((0..8).map(|p| if p == 7 { 0.004 } else { f32::NAN }).collect());
    m.behind.as_mut().unwrap().depth_error = Some(vec![0.25; 8]);
    m.probability = Some((0..8).map(|p| p as f32 / 8.0).collect());
    let written = export::write_maps(folder.path(), &m).unwrap();
    assert!(pictures.iter().all(|path| written.contains(path)));
    let back = npz::read_maps(&path).unwrap();
    assert!(same(&back.depth_error.unwrap(), m.depth_error.as_ref().unwrap()));
    assert_eq!(back.behind.unwrap().depth_error, Some(vec![0.25; 8]));
    let mut npz = thirdbounce::files::archive::Npz::open(&path).unwrap();
    assert_eq!(npz.get("layers_depth_error").unwrap().unwrap().shape, [2, 4, 2]);
    let picture = exr::prelude::read_all_data_from_file(folder.path().join("maps.exr")).unwrap();
    let channels = &picture.layer_data[0].channel_data.list;
    // The pixel of largest x and y is at the left of the top row.
    let corner = |name: &str| {
        let channel = channels.iter().find(|c| c.name.to_string() == name).expect(name);
        channel.sample_data.levels_as_slice()[0].value_by_flat_index(0).to_f32()
    };
    let corners = ["depth_error.Z", "behind.depth_error.Z", "probability.Y"].map(corner);
    assert_eq!(corners, [0.004, 0.25, 0.875]);
    m.depth_error.as_mut().unwrap().pop();
    assert_error(npz::write_maps(&path, &m), Kind::Input, &["depth_error", "7 values"]);
}

#[test]
fn truth_comes_back() {
    let (_folder, path) = place("truth.npz");
    let m = maps();
    let truth = Truth {
        nx: 4,
        ny: 2,
        extent: m.extent,
        depth: m.depth,
        normal: m.normal,
        mask: m.mask,
        albedo: Some(m.albedo),
        behind: None,
    };
    npz::write_truth(&path, &truth).unwrap();
    let back = npz::read_truth(&path).unwrap();
    assert!(same(&back.depth, &truth.depth) && back.mask == truth.mask && back.extent == truth.extent);
    assert!(back.albedo == truth.albedo && truth.albedo.is_some());
    assert!(same(back.normal.as_flattened(), truth.normal.as_flattened()));
}

/// A second surface behind pixel 7, and a dim one behind pixel 0.
fn two_layers() -> Maps {
    let mut m = maps();
    let mut behind = Layer {
        albedo: vec![0.0; 8],
        depth: vec![f32::NAN; 8],
        normal: vec![[f32::NAN; 3]; 8],
        mask: vec![],
        depth_error: None,
    };
    (behind.albedo[7], behind.depth[7], behind.normal[7]) = (1.0, 2.5, [0.6, 0.0, -0.8]);
    (behind.albedo[0], behind.depth[0], behind.normal[0]) = (0.25, 1.5, [0.0, 0.0, -1.0]);
    m.behind = Some(behind);
    m.set_mask(0.25);
    m
}

#[test]
fn both_layers_come_back() {
    let (_folder, path) = place("layers.npz");
    let m = two_layers();
    let is_there = |mask: &[bool]| mask.iter().filter(|m| **m).count();
    assert_eq!(is_there(&m.behind.as_ref().unwrap().mask), 1, "the white of the first layer decides");
    let same_layer = |a: &Layer, b: &Layer| {
        same(&a.depth, &b.depth) && same(a.normal.as_flattened(), b.normal.as_flattened()) && a.mask == b.mask
    };
    npz::write_maps(&path, &m).unwrap();
    let back = npz::read_maps(&path).unwrap();
    let [one, two] = [&back, &m].map(|m| m.behind.as_ref().unwrap());
    assert!(same_layer(one, two) && one.albedo == two.albedo && back.mask == m.mask);
    let mut npz = thirdbounce::files::archive::Npz::open(&path).unwrap();
    assert_eq!(npz.get("layers_normal").unwrap().unwrap().shape, [2, 4, 2, 3]);
    assert!(same(&npz.get("layers_depth").unwrap().unwrap().to_f32()[..8], &m.depth));
    npz::write_maps(&path, &maps()).unwrap();
    assert_eq!(npz::read_maps(&path).unwrap().behind, None);

    let Maps { nx, ny, extent, depth, normal, mask, behind, .. } = m.clone();
    let truth = Truth { nx, ny, extent, depth, normal, mask, albedo: None, behind };
    npz::write_truth(&path, &truth).unwrap();
    let back = npz::read_truth(&path).unwrap().behind.unwrap();
    assert!(same_layer(&back, m.behind.as_ref().unwrap()));
    assert_eq!(back.albedo, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);

    // Points: two of the first layer, one behind.
    let cloud = path.with_extension("ply");
    ply::write(&cloud, &m).unwrap();
    let bytes = std::fs::read(&cloud).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("element vertex 3\n"));
    let depth = f32::from_le_bytes(bytes[bytes.len() - 35 + 8..bytes.len() - 35 + 12].try_into().unwrap());
    assert_eq!(depth, 2.5);
    let mut cut = m.clone();
    cut.behind.as_mut().unwrap().depth.pop();
    assert_error(npz::write_maps(&path, &cut), Kind::Input, &["second layer's depth", "7 values"]);
    export::exr::write(&path.with_extension("exr"), &m).unwrap();
    let picture = exr::prelude::read_all_data_from_file(path.with_extension("exr")).unwrap();
    let names: Vec<String> =
        picture.layer_data[0].channel_data.list.iter().map(|c| c.name.to_string()).collect();
    assert!(names.contains(&"behind.mask.Y".into()) && names.len() == 13, "{names:?}");
}

#[test]
fn volumes_come_back() {
    let (_folder, path) = place("volume.npz");
    let mut v = VolumeArrays {
        size: [2, 3, 4],
        extent: [-1.0, 1.0, -1.0, 1.0, 0.5, 2.0],
        albedo: (0..24).map(|v| v as f32).collect(),
        normal: Some((0..24).map(|v| [0.0, v as f32, -1.0]).collect()),
    };
    volume::write(&path, &v).unwrap();
    assert_eq!(volume::read(&path).unwrap(), v);
    v.normal = None;
    volume::write(&path, &v).unwrap();
    assert_eq!(volume::read(&path).unwrap(), v);
    volume::write(&path.with_extension("h5"), &v).unwrap();
    let file = rust_hdf5::H5File::open(path.with_extension("h5")).unwrap();
    let albedo = file.dataset("albedo").unwrap();
    assert_eq!((albedo.shape(), albedo.read_raw::<f32>().unwrap()), (vec![2, 3, 4], v.albedo.clone()));
    v.albedo.pop();
    assert_error(volume::write(&path, &v), Kind::Input, &["23 albedos", "[2, 3, 4]"]);
}

/// Width, height and pixels of a PNG.
fn decode(path: &Path) -> (usize, usize, Vec<u8>) {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut rgb).unwrap();
    (info.width as usize, info.height as usize, rgb)
}

#[test]
fn pictures_have_x_to_the_left_and_y_up() {
    let (_folder, path) = place("picture.png");
    let dark = picture::BACKGROUND;
    let at = |(width, _, rgb): &(usize, usize, Vec<u8>), x: usize, y: usize| -> [u8; 3] {
        rgb[3 * (y * width + x)..][..3].try_into().unwrap()
    };
    let written = |picture: picture::Picture| {
        pictures::write(&path, &picture).unwrap();
        decode(&path)
    };
    let p = written(pictures::albedo_of(&maps()));
    assert_eq!((p.0, p.1), (512, 256));
    assert_eq!(at(&p, 0, 0), [255; 3], "the largest x and y: left, top");
    assert_eq!(at(&p, 111, 100), [255; 3], "its whole square of 128");
    let dim = at(&p, 511, 255);
    assert!(dim[0] > 120 && dim[0] < 135, "{dim:?}");
    assert_eq!((at(&p, 511, 0), at(&p, 0, 255)), ([0; 3], [0; 3]));

    let p = written(pictures::normal_of(&maps()));
    assert_eq!(at(&p, 0, 0), [128, 204, 230]);
    assert_eq!((at(&p, 511, 255), at(&p, 511, 0)), ([128, 128, 255], dark));

    let p = written(pictures::depth_of(&maps()));
    assert!(p.0 > 512 && p.1 == 256);
    assert_eq!(
        (at(&p, 0, 0), at(&p, 511, 255), at(&p, 511, 0)),
        (picture::colour(1.0), picture::colour(0.0), dark)
    );
    // The bar: far at the top, near at the bottom, and ink of the labels beside it.
    assert_eq!((at(&p, 530, 12), at(&p, 530, 243)), (picture::colour(1.0), picture::colour(0.0)));
    let ink = |rows: std::ops::Range<usize>| {
        rows.flat_map(|y| (560..p.0).map(move |x| (x, y))).any(|(x, y)| at(&p, x, y) == picture::INK)
    };
    assert!(ink(12..26) && ink(228..244) && !ink(100..150));

    // Files have axes: the same pixels in a frame, labels to the left and below.
    let plain = written(pictures::albedo_of(&maps()));
    pictures::write_albedo(&path, &maps()).unwrap();
    let p = decode(&path);
    let (left, top) = (0..p.0 * p.1)
        .map(|i| (i % p.0, i / p.0))
        .find(|(x, y)| at(&p, *x, *y) == picture::INK && (0..400).all(|k| at(&p, x + k, *y) == picture::INK))
        .map(|(x, y)| (x + 1, y + 1))
        .unwrap();
    for (x, y) in [(0, 0), (111, 100), (511, 255), (511, 0), (0, 255), (300, 30)] {
        assert_eq!(at(&p, left + x, top + y), at(&plain, x, y), "{x} {y}");
    }
    let inked =
        |mut area: Box<dyn Iterator<Item = (usize, usize)>>| area.any(|(x, y)| at(&p, x, y) == picture::INK);
    assert!(inked(Box::new((0..left - 6).flat_map(|x| (0..p.1).map(move |y| (x, y))))), "labels of y");
    assert!(inked(Box::new((top + 264..p.1).flat_map(|y| (left..p.0).map(move |x| (x, y))))), "labels of x");
}

#[test]
fn empty_and_large_maps_make_pictures() {
    let (folder, _) = place("");
    let mut empty = maps();
    empty.albedo.fill(0.0);
    empty.depth.fill(f32::NAN);
    empty.set_mask(0.2);
    export::write_maps(folder.path(), &empty).unwrap();
    let width = |name: &str| decode(&folder.path().join(name)).0;
    assert_eq!(width("depth.png"), width("albedo.png"), "no depth, no colour bar");
    let n = 700;
    let large = Maps {
        nx: n,
        ny: n,
        albedo: vec![1.0; n * n],
        depth: vec![1.0; n * n],
        normal: vec![[0.0, 0.0, -1.0]; n * n],
        mask: vec![true; n * n],
        ..empty
    };
    pictures::write_albedo(&folder.path().join("albedo.png"), &large).unwrap();
    assert!((n..n + 100).contains(&width("albedo.png")));
}

#[test]
fn exr_has_named_layers() {
    use exr::meta;
    use exr::prelude::{AttributeValue, Text, Vec2, read_all_flat_layers_from_file};
    let (_folder, path) = place("maps.exr");
    export::exr::write(&path, &maps()).unwrap();
    let image = read_all_flat_layers_from_file(&path).unwrap();
    assert_eq!(image.layer_data.len(), 1);
    let layer = &image.layer_data[0];
    let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["Y", "albedo.Y", "depth.Z", "mask.Y", "normal.X", "normal.Y", "normal.Z"]);
    assert_eq!(layer.size, Vec2(4, 2));
    let value = |name: &str, column: usize, row: usize| {
        let channel = layer.channel_data.list.iter().find(|c| c.name.eq(name)).unwrap();
        channel.sample_data.values_as_f32().nth(row * 4 + column).unwrap()
    };
    assert_eq!((value("albedo.Y", 0, 0), value("depth.Z", 0, 0), value("normal.Y", 0, 0)), (2.0, 1.5, 0.6));
    assert_eq!((value("Y", 3, 1), value("depth.Z", 3, 1), value("normal.Z", 3, 1)), (1.0, 0.5, -1.0));
    assert!(value("depth.Z", 3, 0).is_nan());
    assert_eq!([(0, 0), (3, 0), (3, 1)].map(|(column, row)| value("mask.Y", column, row)), [1.0, 0.0, 1.0]);
    let extent = meta::attribute::FloatRect { min: Vec2(-1.0, 0.0), max: Vec2(1.0, 1.0) };
    assert_eq!(layer.attributes.other.get(&Text::from("extent")), Some(&AttributeValue::FloatRect(extent)));
}

#[test]
fn ply_holds_the_masked_points() {
    let (_folder, path) = place("points.ply");
    ply::write(&path, &maps()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
    assert!(header.contains("element vertex 2\n") && header.contains("property uint8 blue\n"));
    assert_eq!(bytes.len() - end, 2 * (8 * 4 + 3));
    let point: Vec<f32> = bytes[end + 35..]
        .chunks_exact(4)
        .take(8)
        .map(|c| f32::from_le_bytes(c.try_into().unwrap()))
        .collect();
    // The centre of pixel (3, 1): x 0.5 to 1, y 0.5 to 1.
    assert_eq!(point, [0.75, 0.75, 1.5, 0.0, 0.6, -0.8, 2.0, 2.0]);
    assert_eq!(bytes[bytes.len() - 1], 255);
}

fn a_report() -> report::Report {
    let entry = report::TraceEntry {
        iteration: 10,
        seconds: 0.5,
        lateral: 32,
        active: 7,
        loss: 0.25,
        ..Default::default()
    };
    let metrics = Metrics { fraction: Some(0.2), iou: Some(0.8), ..Default::default() };
    report::Report {
        verdict: None,
        version: "0.1.0".into(),
        device: report::Device { name: "made".into(), driver: "none".into(), kind: "cpu".into() },
        settings: serde_json::json!({ "iterations": 60, "solver": "surface" }),
        warnings: vec![],
        capture: ramp().summary(),
        plan: report::PlanReport {
            variants: vec!["confocal".into()],
            buffers: [("voxels".to_string(), 64)].into(),
            ..Default::default()
        },
        trace: vec![entry.clone(), report::TraceEntry { metrics: Some(metrics.clone()), ..entry }],
        totals: Default::default(),
        metrics: Some(metrics),
    }
}

#[test]
fn reports_come_back() {
    let (_folder, path) = place("report.json");
    let mut r = a_report();
    report::write(&path, &r).unwrap();
    assert_eq!(report::read(&path).unwrap(), r);
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    for key in ["version", "device", "settings", "capture", "plan", "trace", "totals", "metrics"] {
        assert!(json.get(key).is_some(), "{key}");
    }
    assert_eq!(json["trace"][1]["iou"], 0.8);
    assert!(json["trace"][0].get("iou").is_none());
    assert_eq!(json["plan"]["buffers"]["voxels"], 64);
    // A diverged run still has a readable report.
    r.trace[0].loss = f64::NAN;
    report::write(&path, &r).unwrap();
    assert!(report::read(&path).unwrap().trace[0].loss.is_nan());
    std::fs::write(&path, "{}").unwrap();
    assert_error(report::read(&path), Kind::Input, &["report.json", "not a report"]);
}

#[test]
fn equal_results_give_equal_bytes() {
    let files = || {
        let (folder, _) = place("");
        let inner = folder.path().join("made/when/missing");
        let mut paths = export::write_maps(&inner, &maps()).unwrap();
        paths.push(inner.join("report.json"));
        report::write(&inner.join("report.json"), &a_report()).unwrap();
        assert_eq!(std::fs::read_dir(&inner).unwrap().count(), paths.len(), "nothing else is left");
        paths.iter().map(|p| std::fs::read(p).unwrap()).collect::<Vec<_>>()
    };
    assert!(files() == files());
}

#[test]
fn a_failed_write_keeps_the_old_file() {
    let (folder, path) = place("result");
    std::fs::write(&path, "old").unwrap();
    let failed = atomic::replace(&path, |temporary| {
        std::fs::write(temporary, "half").unwrap();
        Err(thirdbounce::Error::output("made to fail", "nothing"))
    });
    assert_error(failed, Kind::Output, &["made to fail"]);
    let panicked = std::panic::catch_unwind(|| {
        atomic::replace(&path, |t| {
            std::fs::write(t, "half").unwrap();
            panic!("made to panic")
        })
    });
    assert!(panicked.is_err());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    atomic::write(&path, b"new").unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
}

/// What another program reads from, and what a link names, may not be replaced by a file of ours: least of all `/dev/null`.
#[cfg(unix)]
#[test]
fn links_pipes_and_devices_stay() {
    use std::os::unix::fs::{FileTypeExt, symlink};
    let (folder, file) = place("file");
    let at = |name: &str| folder.path().join(name);
    let kind = |path: &Path| std::fs::symlink_metadata(path).unwrap().file_type();

    std::fs::write(&file, "old").unwrap();
    symlink(&file, at("link")).unwrap();
    atomic::write(&at("link"), b"new").unwrap();
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "new");
    assert!(kind(&at("link")).is_symlink());

    let pipe = at("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read_to_string(pipe).unwrap()
    });
    atomic::write(&pipe, b"through").unwrap();
    assert!(kind(&pipe).is_fifo());
    assert_eq!(reader.join().unwrap(), "through");

    symlink("/dev/null", at("null")).unwrap();
    atomic::write(&at("null"), b"nowhere").unwrap();
    assert!(kind(&at("null")).is_symlink() && kind(Path::new("/dev/null")).is_char_device());
    symlink("/dev/full", at("full")).unwrap();
    assert_error(atomic::write(&at("full"), b"x"), Kind::Output, &["full", "the disk is full"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 5, "no temporary file is left");
}

#[test]
fn impossible_places_are_errors() {
    let (folder, path) = place("file");
    std::fs::write(&path, "here").unwrap();
    assert_error(export::write_maps(&path, &maps()), Kind::Output, &["file", "not a folder"]);
    assert_error(
        export::write_maps(&path.join("deeper"), &maps()),
        Kind::Output,
        &["deeper", "cannot be written"],
    );
    assert_error(atomic::write(folder.path(), b""), Kind::Output, &["is a folder"]);
    assert_error(atomic::write(Path::new("/"), b""), Kind::Output, &["file name"]);
    let long = folder.path().join("n".repeat(300));
    assert_error(atomic::write(&long, b""), Kind::Output, &["cannot be written"]);
    assert_error(atomic::write(Path::new("/proc/none/file"), b""), Kind::Output, &["/proc/none"]);
    let mut short = maps();
    short.mask.pop();
    assert_error(export::write_maps(folder.path(), &short), Kind::Input, &["mask holds 7 values"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
