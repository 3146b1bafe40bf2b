//! Time tags against an independent reader: `ptufile` of C. Gohlke.

use std::path::Path;
use std::process::Command;

use tag_fixtures::tags::{TYPES, is_t3, varied, write};
use thirdbounce_tags::{Inputs, Record, Tags};

fn read_by_ptufile(python: &Path, file: &Path) -> Vec<i64> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/ptu_records.py");
    let output = Command::new(python).arg(script).arg(file).output().expect("Python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout.as_chunks().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect()
}

pub fn ptufile_reads_the_same_records(python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    for (number, name) in TYPES {
        let path = folder.path().join("made.ptu");
        // Whole, and cut in the last record but one.
        let bytes = varied(number, 20_000).file(4e-12, 1e-7, &[]);
        for end in [bytes.len(), bytes.len() - 6] {
            write(&path, &bytes[..end]);
            let mut ours = vec![];
            let tags = Tags::open(&path, &Inputs::default()).unwrap();
            // ptufile counts inputs from 0, except those of PicoHarp's T2, and calls the sync of T2 channel 0, too.
            let first = if number == 0x0001_0203 { 0 } else { 1 };
            tags.records(|record| {
                ours.extend(match record {
                    Record::Sync { time } => [time, 0, 0, 0],
                    Record::Photon { channel, time, delay } => {
                        [time, i64::from(channel - first), i64::from(delay), 0]
                    }
                    Record::Marker { bits, time } => {
                        [time, -1, if is_t3(number) { -1 } else { 0 }, i64::from(bits)]
                    }
                });
            })
            .unwrap();
            let theirs = read_by_ptufile(python, &path);
            assert_eq!(ours.len(), theirs.len(), "{name}");
            assert!(ours.len() > 60_000 && ours == theirs, "{name}");
        }
    }
}
