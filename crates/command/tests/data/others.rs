//! Files of h5py and scipy (write_inputs.py) hold the numbers that these wrote, in every layout that we know.

use std::path::Path;
use std::process::Command;

use thirdbounce::capture::formats::variables::Variables;
use thirdbounce::capture::read;
use thirdbounce::files::archive::Npz;

pub fn what_h5py_and_scipy_write_is_read(python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/write_inputs.py");
    let written = Command::new(python).arg(script).arg(folder.path()).output().expect("Python runs");
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    let (mut wrong, mut arrays) = (vec![], 0);
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() || path.extension().is_some_and(|e| e == "npz") {
            continue;
        }
        let file = Variables::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let mut beside = Npz::open(&path.with_extension("npz")).unwrap();
        let names = beside.names();
        assert!(
            file.have(&names.iter().map(String::as_str).collect::<Vec<_>>()),
            "{path:?}: {:?}",
            file.names()
        );
        for name in names {
            let array = beside.get(&name).unwrap().unwrap();
            let (shape, values) = (array.shape.clone(), array.to_f64());
            let single: Vec<f32> = values.iter().map(|v| *v as f32).collect();
            let numbers = file.numbers(&name).map(|read| read == Some((shape.clone(), values)));
            // Counts are no booleans.
            let counts = (name != "flag")
                .then(|| file.counts(&name).map(|read| (read.shape, read.values) == (shape, single)));
            arrays += 1;
            for (how, is_right) in [("numbers", Some(numbers)), ("counts", counts)] {
                let Some(is_right) = is_right else { continue };
                if !is_right.as_ref().is_ok_and(|right| *right) {
                    wrong.push(format!("{path:?}, {name} as {how}: {is_right:?}"));
                }
            }
        }
    }
    let [one, other] =
        ["h5py.mat", "scipy.mat"].map(|name| read(&folder.path().join("captures").join(name)).unwrap());
    assert!(one.histograms.iter().any(|n| *n > 3.0) && one.pair_count() == 48);
    assert!(one.histograms == other.histograms && one.laser == other.laser && one.t_start == other.t_start);
    assert!(arrays > 150, "{arrays} arrays");
    assert!(wrong.is_empty(), "{} of {arrays}:\n{}", wrong.len(), wrong.join("\n"));
}
