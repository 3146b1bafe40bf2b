//! The test files of scipy's own MATLAB reader, as its wheel holds them: every variable is read, or refused by its kind.

use std::path::Path;

use thirdbounce::capture::formats::variables::Variables;
use thirdbounce::capture::{ReadOptions, read_given};

/// Files that are damaged on purpose, by parts of their names.
const DAMAGED: [&str; 3] = ["corrupted", "malformed", "bad_miu"];

pub fn files_of_scipy_are_read_or_named(folder: &Path) {
    let mut seen = 0;
    let mut read = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.extension().is_none_or(|ending| ending != "mat") {
            continue;
        }
        seen += 1;
        let is_damaged = DAMAGED.iter().any(|part| name.contains(part));
        let sound = |text: String| assert!(is_damaged || !text.contains("damaged"), "{name}: {text}");
        let given = ReadOptions::default().with_wall(1.0).with_bin_width(0.01);
        if let Err(e) = read_given(&path, &given) {
            sound(e.to_string());
        }
        match Variables::open(&path) {
            Ok(file) => {
                for variable in file.names() {
                    match file.numbers(&variable) {
                        Ok(found) => read += usize::from(found.is_some()),
                        Err(e) => sound(e.to_string()),
                    }
                }
            }
            Err(e) if name.contains("_4.") || name.contains("_4_") => {
                assert!(e.to_string().contains("version 4"), "{name}: {e}")
            }
            Err(e) => sound(e.to_string()),
        }
    }
    assert!(seen > 100 && read > 40, "{read} arrays of {seen} files");
}
