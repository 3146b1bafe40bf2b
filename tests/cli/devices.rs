//! Several devices on the command line.

use fixtures::command::*;
use thirdbounce::export::npz;
use thirdbounce::maps::Maps;

const QUICK: [&str; 4] = ["--lateral", "16", "--iterations", "12"];

#[test]
fn several_devices_share_a_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let capture = path("z.npz");
    succeed(&["simulate", "letter-Z", "--out", &capture, "--scan", "16", "--bin-width", "0.02"]);
    let run = |name: &str, more: &[&str]| {
        let out = path(name);
        thirdbounce(&[&["reconstruct", &capture, "--out", &out][..], &QUICK, more].concat())
    };
    let maps = |name: &str, device: &str| -> (Maps, String) {
        // A long surface makes more of rounding.
        let done = run(name, &["--device", device, "--surface-iterations", "8"]);
        assert!(done.status.success(), "{}", stderr(&done));
        (npz::read_maps(&folder.path().join(name).join("maps.npz")).expect("maps"), stderr(&done))
    };
    let (one, _) = maps("one", "0");
    let (two, told) = maps("two", "0,0");
    assert!(told.contains("2 devices share the pairs") && told.contains("exchanges of"), "{told}");
    let brightest = one.albedo.iter().fold(0.0f32, |a, b| a.max(*b));
    assert!(brightest > 0.0);
    for (a, b) in one.albedo.iter().zip(&two.albedo) {
        assert!((a - b).abs() < 1e-3 * brightest, "{a} {b}");
    }
    for (device, more, words) in [
        ("0,nowhere", &[][..], "no device is called \"nowhere\""),
        ("0,0", &["--solver", "paper"], "paper runs on one"),
        ("0,0", &["--checkpoint", &path("state")], "name one --device"),
    ] {
        let done = run("refused", &[&["--device", device], more].concat());
        assert_ne!(done.status.code(), Some(0), "{device}");
        assert!(stderr(&done).contains(words), "{words:?} is not in\n{}", stderr(&done));
        assert!(!folder.path().join("refused").join("report.json").exists(), "nothing is half written");
    }
}
