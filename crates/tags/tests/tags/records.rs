//! Every record of every format, and files that are damaged.

use std::path::Path;

use fixtures::captures::{assert_error, place};
use tag_fixtures::tags::{TYPES, Writer, csv, is_t3, varied, write};
use thirdbounce::Kind;
use thirdbounce_tags::{Event, Inputs, Passed, Record, Scan, Survey, Tags, hold_tags};

fn all(path: &Path, inputs: &Inputs) -> (Vec<Record>, Passed) {
    let mut found = vec![];
    let passed = Tags::open(path, inputs).unwrap().records(|record| found.push(record)).unwrap();
    (found, passed)
}

#[test]
fn every_record_type_is_read_tag_for_tag() {
    let (_folder, path) = place("made.ptu");
    for (number, name) in TYPES {
        let writer = varied(number, 30_000);
        write(&path, writer.file(4e-12, 1e-7, &[]));
        let (found, passed) = all(&path, &Inputs::default());
        assert!(found == writer.wanted, "{name}");
        assert_eq!((passed.records, passed.unknown), (writer.words.len() as u64, 0), "{name}");
        assert_eq!(passed.notes, Vec::<String>::new(), "{name}");
        let tags = Tags::open(&path, &Inputs::default()).unwrap();
        assert_eq!(tags.tick, 4e-12);
        assert_eq!(tags.period, is_t3(number).then_some(1e-7), "{name}");
        assert!(tags.instrument.starts_with(&name[..7]), "{} {name}", tags.instrument);
        assert!(hold_tags(&path));
    }
}

#[test]
fn text_is_read_tag_for_tag() {
    let records: Vec<_> = varied(0x0001_0207, 20_000).wanted;
    // One marker at a time has a channel of its own.
    let one = |r: &Record| !matches!(r, Record::Marker { bits, .. } if bits.count_ones() > 1);
    let records: Vec<_> = records.into_iter().filter(one).collect();
    let inputs = Inputs { sync: 0, markers: (100..104).collect(), ..Inputs::default() };
    let (_folder, path) = place("tags.csv");
    write(&path, csv(&records));
    assert!(all(&path, &inputs).0 == records);
    let wrong = Inputs { sync: 1, markers: vec![1], ..Inputs::default() };
    assert_error(Tags::open(&path, &wrong).map(drop), Kind::Options, &["laser pulses channel 1"]);
    let inputs = Inputs { sync: 0, markers: vec![7, -7], ..Inputs::default() };
    let wanted = [
        Record::Sync { time: 10 },
        Record::Photon { channel: 1, time: 12, delay: 0 },
        Record::Marker { bits: 2, time: -13 },
    ];
    for text in [
        "0,10\n1,12\n-7,-13\n",
        "# made by hand\n\n0;10\r\n1; 12\r\n-7;-13",
        "index,Timestamp_ps,Channel\n0,10,0\n1,12.2,1\n2,-1.3e1,-7\n",
    ] {
        write(&path, text);
        assert_eq!(all(&path, &inputs).0, wanted, "{text}");
    }
    write(&path, "0,10\n1,12\n-7");
    let (found, passed) = all(&path, &inputs);
    assert!(found.len() == 2 && passed.notes[0].contains("line 3, the last, is cut"), "{passed:?}");
    let long = "1,9".to_string() + &"9".repeat(18) + "\n";
    for (text, words) in [
        ("0,10\n1,x\n2,3\n", "line 2"),
        ("one,two\n0,1\n", "line 1"),
        ("0\n1\n", "a text of numbers"),
        (&*long, "line 1"),
        (&*"1".repeat(5000), "a text of numbers"),
    ] {
        write(&path, text);
        let read = Tags::open(&path, &inputs).and_then(|tags| tags.records(|_| {}));
        assert_error(read.map(drop), Kind::Input, &["tags.csv", words]);
    }
}

#[test]
fn points_are_read_from_text() {
    let (_folder, path) = place("points.csv");
    let read = |text: &str| {
        write(&path, text);
        Scan::read(&path)
    };
    let scan = read("# by hand\nx,y,z\n0,0,0\n0 0.1 0\n0.1;0;0\n0.1\t0.1\t0\n").unwrap();
    assert!(scan.points() == 4 && scan.is_confocal());
    let apart = read("0,0,0,1,0,0\n0,0.1,0,1,0,0").unwrap();
    assert!(!apart.is_confocal() && apart.sensor[1].x == 1.0);
    for (text, words) in [("", "no point"), ("0,0\n0,x", "line 2"), ("1", "line 1"), ("1,2,inf", "line 1")] {
        assert_error(read(text), Kind::Input, &["points.csv", words]);
    }
    for grid in [[0, 3], [1, 1], [usize::MAX, 2]] {
        assert!(Scan::grid(grid, 1.0, false).is_err());
    }
    assert!(Scan::grid([2, 2], f64::NAN, false).is_err());
}

#[test]
fn times_become_delays_from_the_laser_pulse() {
    let (_folder, path) = place("made.ptu");
    for (number, name) in TYPES {
        let mut writer = Writer::new(number);
        let t3 = is_t3(number);
        let period = 50_000;
        // Photons before the first laser pulse have no delay.
        if !t3 {
            writer.photon(2, 5, 0);
        }
        let mut wanted = vec![];
        for sync in 0..3000 {
            let start = 1000 + sync * period;
            writer.sync(start);
            if sync % 7 == 0 {
                writer.marker(5, if t3 { sync } else { start + 40 });
                wanted.push(Event::Marker { bits: 5, sync });
            }
            if sync % 3 == 0 {
                let delay = sync % 4000;
                writer.photon(1, if t3 { sync } else { start + delay }, delay as u32);
                wanted.push(Event::Photon { channel: 1, sync, delay });
            }
        }
        write(&path, writer.file(4e-12, 2e-7, &[]));
        let mut found = vec![];
        let tags = Tags::open(&path, &Inputs::default()).unwrap();
        let passed = tags.events(|event| found.push(event)).unwrap();
        assert!(found == wanted, "{name}");
        assert_eq!(passed.without_sync, u64::from(!t3), "{name}");
        let survey = Survey::of(&tags).unwrap();
        assert!((survey.period.unwrap() / 2e-7 - 1.0).abs() < 1e-9, "{name}: {:?}", survey.period);
        assert_eq!(survey.channels[0].photons, 1000);
        assert_eq!((survey.markers.len(), survey.out_of_order), (429, 0));
    }
}

#[test]
fn what_is_missing_at_the_end_is_told() {
    let (_folder, path) = place("made.ptu");
    let writer = varied(0x0001_0307, 1000);
    let whole = writer.file(4e-12, 1e-7, &[]);
    let records = writer.words.len();
    for cut in [1, 3, 4, 402] {
        write(&path, &whole[..whole.len() - cut]);
        let (found, passed) = all(&path, &Inputs::default());
        assert!(writer.wanted.starts_with(&found) && found.len() < writer.wanted.len());
        let left = records - cut.div_ceil(4);
        let note = format!("the file ends after {left} of its {records} records");
        assert!(passed.notes[0].starts_with(&note), "{:?}", passed.notes);
    }
    // More than the header says is not read: some programs append data of their own.
    let mut more = whole.clone();
    more.extend([0xFF; 64]);
    write(&path, &more);
    assert!(all(&path, &Inputs::default()).0 == writer.wanted);
    // A measurement that was ended by force does not know its records.
    let at = whole.windows(24).position(|w| w == b"TTResult_NumberOfRecords").unwrap() + 40;
    let mut unsaid = whole.clone();
    unsaid[at..at + 8].fill(0);
    unsaid.extend([1, 2]);
    write(&path, &unsaid);
    let (found, passed) = all(&path, &Inputs::default());
    assert!(found == writer.wanted && passed.notes[0].contains("2 bytes"), "{:?}", passed.notes);
}

#[test]
fn damaged_files_are_refused_and_never_panic() {
    let (_folder, path) = place("made.ptu");
    let mut state = 77u64;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize
    };
    for number in [0x0001_0203, 0x0001_0303, 0x0001_0204, 0x0001_0307] {
        let good = varied(number, 300).file(4e-12, 1e-7, &[]);
        let header = good.windows(10).position(|w| w == b"Header_End").unwrap() + 48;
        for length in (0..header).step_by(7) {
            write(&path, &good[..length]);
            let opened = Tags::open(&path, &Inputs::default()).map(drop);
            let error = opened.expect_err("a header that is cut");
            assert!(error.what.starts_with(&path.display().to_string()), "{error}");
            assert!(error.kind == Kind::Input && !error.hint.to_string().is_empty());
        }
        for _ in 0..300 {
            let mut bad = good.clone();
            for _ in 0..1 + random() % 4 {
                let at = random() % bad.len();
                bad[at] = random() as u8;
            }
            write(&path, &bad);
            if let Ok(tags) = Tags::open(&path, &Inputs::default()) {
                let mut last = 0;
                let heard = |event| {
                    if let Event::Photon { delay, .. } = event {
                        last = delay;
                    }
                };
                drop(tags.events(heard));
                drop(Survey::of(&tags));
                std::hint::black_box(last);
            }
        }
    }
    for (name, text, words) in [
        ("other.ptu", "not a file of tags", "no file of time tags"),
        ("empty.csv", "", "is empty"),
        ("curves.phu", "PQHISTO\0", "PicoQuant histograms (.phu)"),
        ("tags.dump", "\u{1}0000000000", "no file of time tags"),
        ("old.pt3", "PicoHarp 300\0", "(.pt3 or .pt2), which is not read"),
        ("old.ht3", "HydraHarp\0", "(.ht3 or .ht2), which is not read"),
        ("a.sdt", "\u{1}", "Becker & Hickl histograms"),
        ("a.spc", "\u{1}", "tttrlib"),
        ("a.ttbin", "\u{1}", "getTimestamps"),
        ("a.bin", "\u{1}", "a raw dump"),
        ("missing.ptu", "-", "no such file"),
    ] {
        let path = path.with_file_name(name);
        if text != "-" {
            write(&path, text);
        }
        assert_error(Tags::open(&path, &Inputs::default()).map(drop), Kind::Input, &[name, words]);
    }
    // A pipe is refused before its writer is waited for.
    let pipe = path.with_file_name("pipe.ptu");
    if std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()) {
        assert_error(Tags::open(&pipe, &Inputs::default()).map(drop), Kind::Input, &["regular file"]);
        assert!(!hold_tags(&pipe));
    }
    let unknown = Writer::new(0x0001_0309).file(4e-12, 1e-7, &[]);
    write(&path, unknown);
    assert_error(Tags::open(&path, &Inputs::default()).map(drop), Kind::Input, &["0x00010309"]);
}
