//! Shared by all fuzz targets: open bytes as a capture. An error is fine, a panic or a hang is a finding, and a capture
//! that opens must be valid.

use std::ops::ControlFlow;
use std::sync::Once;

use thirdbounce::capture::formats::hdf5::is_guarded;
use thirdbounce::capture::{Given, read_given};
use thirdbounce::tags::{self, Asked, Division, Inputs, Scan, Zero};

/// libFuzzer's hook ends the process at any panic. A panic of the HDF5 reader is caught and becomes an error.
static HOOK: Once = Once::new();

/// Opens bytes as a file with this name. Each process has its own folder, without other files, so several may run side
/// by side.
pub fn open(bytes: &[u8], name: &str, given: &Given) {
    HOOK.call_once(|| {
        let ends = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !is_guarded() {
                ends(panic);
            }
        }));
    });
    let folder = std::env::temp_dir().join(format!("thirdbounce-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the input");
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("the input is written");
    match read_given(&path, given) {
        Ok(opened) => opened.capture.check().expect("a capture that was opened is sound"),
        Err(error) => assert!(!error.what.is_empty() && !error.mend.to_string().is_empty()),
    }
}

/// Opens bytes as time tags, or histograms of an instrument, with this name, and makes captures of four points of them.
pub fn histogram(bytes: &[u8], name: &str) {
    let folder = std::env::temp_dir().join(format!("thirdbounce-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the input");
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("the input is written");
    let scan = Scan::grid([2, 2], 1.0, false).expect("a scan");
    let inputs = Inputs { sync: 0, markers: vec![100, 101, 102] };
    // Few and wide bins: delays of a damaged file may be of any length.
    let usual = Asked { inputs, bin_width: Some(0.1), until: Some(1e-7), ..Asked::default() };
    let divisions = [
        None,
        Some(Division::Pixels { marker: 1, frame: None }),
        Some(Division::Lines { start: 1, stop: Some(2), frame: Some(3) }),
        Some(Division::Pulses { each: 3, before: 1 }),
    ];
    for (number, division) in divisions.into_iter().enumerate() {
        let zero = if number % 2 == 0 { Zero::Direct } else { Zero::At(1e-9) };
        let asked = Asked { division, zero, ..usual.clone() };
        match tags::histogram(&path, &scan, &asked) {
            Ok(made) => made.capture.check().expect("a capture that was made is sound"),
            Err(error) => assert!(!error.what.is_empty() && !error.mend.to_string().is_empty()),
        }
        let wait = || ControlFlow::Break(());
        let passed = tags::passes(&path, &scan, &asked, &wait, &mut |_| ControlFlow::Continue(()));
        passed.unwrap_or_else(|error| assert!(!error.what.is_empty() && !error.mend.to_string().is_empty()));
    }
}

pub fn wall() -> Given {
    Given::default().with_wall(1.0)
}

pub fn wall_and_bins() -> Given {
    wall().with_bin_width(0.01)
}
