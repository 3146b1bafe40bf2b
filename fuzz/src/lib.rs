//! Shared by all fuzz targets: open bytes as a capture. An error is fine, a panic or a hang is a finding, and a capture
//! that opens must be valid.

use std::path::PathBuf;
use std::sync::Once;

use tag_fixtures::tags::{WAYS, in_a_way};
use thirdbounce::capture::formats::hdf5::is_guarded;
use thirdbounce::capture::{ReadOptions, read_given};

/// libFuzzer's hook ends the process at any panic. A panic of the HDF5 reader is caught and becomes an error.
static HOOK: Once = Once::new();

fn quiet() {
    HOOK.call_once(|| {
        let ends = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !is_guarded() {
                ends(panic);
            }
        }));
    });
}

/// Bytes as a file with this name. Each process has its own folder, without other files, so several may run side by side.
fn written(bytes: &[u8], name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("thirdbounce-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the input");
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("the input is written");
    path
}

/// Opens bytes as a capture with this name.
pub fn open(bytes: &[u8], name: &str, given: &ReadOptions) {
    quiet();
    let path = written(bytes, name);
    match read_given(&path, given) {
        Ok(opened) => opened.capture.check().expect("a capture that was opened is sound"),
        Err(error) => assert!(!error.what.is_empty() && !error.hint.to_string().is_empty()),
    }
}

/// Opens bytes as time tags, or histograms of an instrument, with this name, and makes a capture of four points of them.
pub fn histogram(bytes: &[u8], name: &str) {
    quiet();
    // One way for an input: a mutation gets another one, and eight times as many inputs are tried.
    let way = bytes.iter().fold(0, |sum: usize, byte| sum.wrapping_add(usize::from(*byte)));
    in_a_way(&written(bytes, name), way % WAYS);
}

pub fn wall() -> ReadOptions {
    ReadOptions::default().with_wall(1.0)
}

pub fn wall_and_bins() -> ReadOptions {
    wall().with_bin_width(0.01)
}
