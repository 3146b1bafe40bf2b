//! Writes the first inputs, the fixtures of the tests, to corpus/TARGET; an argument replaces the folder `corpus`:
//! `cargo run --bin corpus [FOLDER]`.

use std::path::{Path, PathBuf};

use fixtures::{readers, tags};
use thirdbounce::capture::{Pulse, read_given, write};

fn main() {
    let here = || Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let corpus = std::env::args_os().nth(1).map_or_else(here, PathBuf::from);
    let scratch = std::env::temp_dir().join(format!("thirdbounce-corpus-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).expect("a folder to work in");
    let put = |target: &str, from: &Path| {
        let folder = corpus.join(target);
        std::fs::create_dir_all(&folder).expect("the corpus folder");
        let name = from.file_name().expect("a file");
        std::fs::copy(from, folder.join(name)).expect("the input is written");
    };
    let targets = [
        "znlos",
        "netf",
        "stanford",
        "lct",
        "one_array",
        "ccsocr",
        "general",
        "phasor",
        "kilometre",
        "convolutional",
        "lit",
        "npz",
    ];
    for (name, file, opened, given) in readers::every_reader(&scratch) {
        if let Some(target) = targets.iter().find(|t| name.starts_with(**t)) {
            put(target, &file);
        }
        // The same capture, written in our own formats.
        let mut capture = read_given(&opened, &given).expect("a whole fixture").capture;
        for (target, ending) in [("npz", "npz"), ("ytal", "h5")] {
            let path = scratch.join(format!("from_{name}.{ending}"));
            write(&capture, &path).expect("it is written");
            put(target, &path);
        }
        let path = scratch.join(format!("from_{name}_pulse.npz"));
        capture.pulse = Some(Pulse::gaussian(3.0 * capture.bin_width).expect("a width"));
        write(&capture, &path).expect("it is written");
        put("npz", &path);
    }
    for (target, name, bytes) in tags::every_reader() {
        let path = scratch.join(name);
        std::fs::write(&path, bytes).expect("it is written");
        put(target, &path);
    }
    std::fs::remove_dir_all(&scratch).expect("the folder goes");
    println!("wrote {}", corpus.display());
}
