//! Files that grow while they are read: text, T2 and dumps, with markers of points, lines and rounds.

use std::fs::OpenOptions;
use std::io::Write;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fixtures::captures::{assert_error, histogram, place};
use fixtures::tags::{Writer, arrays, csv, dump, npz_of, write};
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, METRES_PER_PICOSECOND};
use thirdbounce::tags::{Asked, Division, Inputs, PileUp, Scan, Zero, passes};

const BIN: usize = 16;
/// Laser pulses of a point; the last one brings no photon.
const EACH: i64 = 37;

/// Ticks after laser pulse `sync` of its photon.
fn delay(sync: i64) -> i64 {
    if sync % 3 == 0 { 1200 + 20 * (sync % EACH) } else { 400 + sync % 3 }
}

/// Three rounds of four points, and one point more: marker 1 begins each, marker 2 ends it, marker 3 begins each round.
fn scanned() -> Writer {
    let mut writer = Writer::new(0x0001_0207);
    for point in 0..13 {
        for i in 0..EACH {
            let sync = EACH * point + i;
            let time = 500 + 20_000 * sync;
            writer.sync(time);
            match i {
                0 if point % 4 == 0 => [4, 1].map(|bits| writer.marker(bits, time + 1)).into_iter().collect(),
                0 => writer.marker(1, time + 1),
                36 => writer.marker(2, time + 1),
                _ => {}
            }
            if i + 1 < EACH {
                writer.photon(2, time + delay(sync), 0);
            }
        }
    }
    writer
}

/// The histogram of these laser pulses, in bins of 16 ticks.
fn wanted(pulses: std::ops::Range<i64>, bins: usize) -> Vec<f32> {
    let mut histogram = vec![0.0; bins];
    for sync in pulses.filter(|sync| sync % EACH < EACH - 1) {
        histogram[delay(sync) as usize / BIN] += 1.0;
    }
    histogram
}

/// The passes of a file to which the rest of `bytes` is written bit by bit.
fn grown(name: &str, bytes: &[u8], scan: &Scan, asked: &Asked) -> Vec<Capture> {
    let (_folder, path) = place(name);
    let (begun, rest) = bytes.split_at(bytes.len() / 5);
    write(&path, begun);
    let (done, mut seen) = (AtomicBool::new(false), vec![]);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut file = OpenOptions::new().append(true).open(&path).unwrap();
            // Parts end anywhere, also within a record or a line.
            for part in rest.chunks(rest.len() / 9 + 1) {
                std::thread::sleep(Duration::from_millis(10));
                file.write_all(part).unwrap();
            }
            done.store(true, Ordering::Release);
        });
        let mut last = false;
        let last = std::cell::Cell::from_mut(&mut last);
        // Once more after the last part was written: it may have come between the read and this.
        let wait = || match last.replace(done.load(Ordering::Acquire)) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        passes(&path, scan, asked, &wait, &mut |pass| {
            seen.push(pass);
            ControlFlow::Continue(())
        })
        .unwrap();
    });
    seen
}

#[test]
fn every_format_and_kind_of_marker_is_followed() {
    let writer = scanned();
    let files = [
        ("scan.ptu", writer.file(1e-12, 2e-8, &[])),
        ("scan.csv", csv(&writer.wanted).into_bytes()),
        ("scan.dump", dump(&writer.wanted)),
    ];
    let usual = Asked {
        inputs: Inputs { sync: 0, markers: vec![100, 101, 102] },
        zero: Zero::At(0.0),
        bin_width: Some(BIN as f64 * METRES_PER_PICOSECOND),
        pile_up: PileUp::Off,
        ..Asked::default()
    };
    let points = Scan::grid([2, 2], 1.0, false).unwrap();
    let lines = Scan::grid([2, 4], 1.0, false).unwrap();
    for (name, bytes) in &files {
        for rounds in [None, Some(3)] {
            let asked =
                Asked { division: Some(Division::Pixels { marker: 1, frame: rounds }), ..usual.clone() };
            let seen = grown(name, bytes, &points, &asked);
            assert_eq!(seen.len(), 2, "{name}, {rounds:?}");
            for (pass, c) in seen.iter().enumerate() {
                for point in 0..4 {
                    let begin = EACH * (4 * pass + point) as i64;
                    let pair = point % 2 * 2 + point / 2;
                    assert_eq!(
                        histogram(c, pair),
                        wanted(begin..begin + EACH, c.bins),
                        "{name}, {rounds:?}, {pass} {point}"
                    );
                }
            }
            let division = Some(Division::Lines { start: 1, stop: Some(2), frame: rounds });
            let seen = grown(name, bytes, &lines, &Asked { division, ..usual.clone() });
            assert_eq!(seen.len(), 2, "{name}, {rounds:?}");
            for (pass, c) in seen.iter().enumerate() {
                for point in 0..8 {
                    let begin = EACH * (4 * pass + point / 2) as i64 + 18 * (point % 2) as i64;
                    let pair = point % 2 * 4 + point / 2;
                    assert_eq!(
                        histogram(c, pair),
                        wanted(begin..begin + 18, c.bins),
                        "{name}, {rounds:?}, {pass} {point}"
                    );
                }
            }
        }
    }
    let (_folder, path) = place("scan.npz");
    write(&path, npz_of(&arrays(&writer.wanted), true));
    let asked = Asked { division: Some(Division::Pixels { marker: 1, frame: None }), ..usual };
    let refused =
        passes(&path, &points, &asked, &|| ControlFlow::Break(()), &mut |_| ControlFlow::Continue(()));
    assert_error(refused, Kind::Options, &["scan.npz", "whole when they are written"]);
}

#[test]
fn a_long_pause_is_taken_pass_by_pass() {
    let mut writer = Writer::new(0x0001_0307);
    for sync in 0..200 {
        writer.photon(1, sync, 100);
    }
    // 10 passes have light; then come five million without any, and photons again.
    for sync in 0..3000 {
        writer.photon(1, 100_000_000 + sync, 100);
    }
    let (_folder, path) = place("pause.ptu");
    write(&path, writer.file(16e-12, 1e-7, &[]));
    let asked = Asked {
        division: Some(Division::Pulses { each: 5, before: 0 }),
        zero: Zero::At(0.0),
        bin_width: Some(0.1),
        ..Asked::default()
    };
    let scan = Scan::grid([2, 2], 1.0, false).unwrap();
    let (start, mut lit, mut all) = (std::time::Instant::now(), 0, 0);
    passes(&path, &scan, &asked, &|| ControlFlow::Break(()), &mut |pass| {
        all += 1;
        lit += usize::from(pass.histograms.iter().any(|n| *n > 0.0));
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(lit, 10);
    assert!(all > 2000 && start.elapsed().as_secs() < 60, "{all} passes in {:?}", start.elapsed());
}
