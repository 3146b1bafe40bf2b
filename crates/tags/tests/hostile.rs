//! Hostile files over all readers: an error or a sound capture, no abort, no panic, and little memory for what is refused. A binary
//! of its own with one test, because memory is counted on all threads. Another seed: `THIRDBOUNCE_SEED=7`.

use std::path::Path;

use fixtures::allocations::{Counting, peak_of};
use tag_fixtures::hostile::{Opened, hostile};
use tag_fixtures::tags::{WAYS, in_a_way};
use thirdbounce::capture::read_given;
use thirdbounce::export::npz::read_truth;
use thirdbounce_tags::{self as tags, Asked, Division, Scan, Zero};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const FILES: u64 = 100;
/// Most bytes that a refused file may take.
const MOST: u64 = 200 << 20;

/// Makes a capture of all delays: the latest photon decides how many bins there are.
fn histogram(path: &Path) -> Result<(), thirdbounce::Error> {
    let asked = Asked {
        division: Some(Division::Pulses { each: 1, before: 0 }),
        zero: Zero::At(0.0),
        ..Asked::default()
    };
    tags::histogram(path, &Scan::grid([2, 2], 1.0, false)?, &asked).map(drop)
}

#[test]
fn hostile_files_are_refused_in_little_memory() {
    let first = std::env::var("THIRDBOUNCE_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0u64);
    let folder = tempfile::tempdir().unwrap();
    let (mut refused, mut largest) = (0, (0, String::new()));
    for seed in first * FILES..(first + 1) * FILES {
        let (what, opened) = hostile(folder.path(), seed);
        let (done, peak) = peak_of(|| match &opened {
            Opened::Capture(path, given) => read_given(path, given)
                .map(|read| read.capture.check().expect("a capture that is read is sound")),
            Opened::Tags(path) => {
                in_a_way(path, seed as usize % WAYS);
                histogram(path)
            }
            Opened::Truth(path) => read_truth(path).map(drop),
        });
        if let Err(error) = done {
            refused += 1;
            assert!(!error.what.is_empty() && !error.hint.to_string().is_empty(), "{what}");
            assert!(peak < MOST, "{what}: {} MiB before it was refused: {error}", peak >> 20);
            largest = largest.max((peak, what));
        }
        std::fs::remove_dir_all(folder.path().join(seed.to_string())).unwrap();
    }
    assert!(refused > FILES / 2, "only {refused} of {FILES} were refused: are the files hostile?");
    println!("{refused} of {FILES} refused, {} MiB at most: {}", largest.0 >> 20, largest.1);
}

/// Calls that take memory without asking for it, which a reader may make only where the size is bounded. Such a line says so.
#[test]
fn readers_take_memory_by_asking_for_it() {
    const CALLS: [&str; 7] =
        ["vec![0", "vec![DVec3", "Vec::with_capacity(", ".try_reserve", "repeat_n(", "fs::read(", "; pairs]"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = vec![];
    for folder in ["capture/src/readers", "base/src/files", "tags/src"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
            let lines: Vec<&str> = code.lines().collect();
            for (number, line) in lines.iter().enumerate() {
                let is_code = !line.trim_start().starts_with("//");
                // A comment may stand on the line behind.
                let next =
                    lines.get(number + 1).is_some_and(|next| next.trim_start().starts_with("// bounded"));
                let asked = next || line.contains("host::") || line.contains("// bounded");
                if is_code && !asked && CALLS.iter().any(|call| line.contains(call)) {
                    found.push(format!("{}:{}: {}", path.display(), number + 1, line.trim()));
                }
            }
        }
    }
    assert!(found.is_empty(), "ask `host` for them, or say `// bounded` and why:\n{}", found.join("\n"));
}
