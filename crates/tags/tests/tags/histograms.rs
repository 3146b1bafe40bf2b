//! Histograms of scans: every photon in its point and bin.

use std::path::{Path, PathBuf};

use fixtures::captures::{assert_error, place, total};
use glam::DVec3;
use tag_fixtures::tags::{Writer, arrays, csv, is_t3, npz_of, write};
use thirdbounce::capture::{Capture, Flip, Turn, read};
use thirdbounce::files::array::Array;
use thirdbounce::{Kind, capture};
use thirdbounce_tags::{Asked, Division, Event, Histograms, Inputs, PileUp, Record, Scan, Zero, histogram};

const TICK: f64 = 4e-12;
const PERIOD: f64 = 1e-7;
const LIGHT: f64 = 299_792_458.0;
/// Ticks of a laser period, for T2.
const TICKS: i64 = 25_000;

/// Repeatable numbers below a bound.
fn random(seed: u64) -> impl FnMut(u64) -> u64 {
    let mut state = seed | 1;
    move |below| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state % below
    }
}

/// A measurement: photons (laser pulse, delay) and markers (laser pulse, bits), in order.
#[derive(Default)]
struct Made {
    photons: Vec<(i64, i64)>,
    markers: Vec<(i64, u16)>,
    pulses: i64,
}

impl Made {
    /// Photons at random in these laser pulses, at most one in each.
    fn new(pulses: i64, seed: u64) -> Made {
        let mut random = random(seed);
        let photon = |sync| match random(4) {
            0 => Some((sync, random(3000) as i64)),
            _ => None,
        };
        let photons = (0..pulses).filter_map(photon);
        Made { photons: photons.collect(), markers: vec![], pulses }
    }

    /// The file of a record type. Markers that come at one pulse with photons come after them, as instruments do.
    fn file(&self, number: i64) -> (Writer, Vec<u8>) {
        let mut writer = Writer::new(number);
        let t3 = is_t3(number);
        let (mut photons, mut markers) = (self.photons.iter().peekable(), self.markers.iter().peekable());
        for sync in 0..self.pulses {
            let start = 500 + sync * TICKS;
            writer.sync(start);
            while let Some((_, delay)) = photons.next_if(|p| p.0 == sync) {
                writer.photon(1, if t3 { sync } else { start + delay }, *delay as u32);
            }
            while let Some((_, bits)) = markers.next_if(|m| m.0 <= sync) {
                writer.marker(*bits, if t3 { sync } else { start + 4000 });
            }
        }
        let bytes = writer.file(TICK, PERIOD, &[]);
        (writer, bytes)
    }

    /// The histogram of each point, in bins of 8 ticks, by a function that tells the point of a laser pulse.
    fn wanted(&self, points: usize, point: impl Fn(i64) -> Option<usize>) -> Vec<Vec<f32>> {
        let mut all = vec![vec![0.0; 375]; points];
        for (sync, delay) in &self.photons {
            if let Some(point) = point(*sync) {
                all[point][(delay / 8) as usize] += 1.0;
            }
        }
        all
    }
}

fn asked(division: Division) -> Asked {
    let zero = Zero::At(0.0);
    Asked {
        division: Some(division),
        zero,
        bin_width: Some(32e-12 * LIGHT),
        pile_up: PileUp::Off,
        ..Asked::default()
    }
}

fn grid(columns: usize, rows: usize) -> Scan {
    Scan::grid([columns, rows], 1.0, false).unwrap()
}

/// The histogram of the point at column x and row y.
fn at(c: &Capture, x: usize, y: usize) -> &[f32] {
    let pair = x * c.scan[1] + y;
    &c.histograms[pair * c.bins..(pair + 1) * c.bins]
}

#[track_caller]
fn assert_same(made: &Histograms, wanted: &[Vec<f32>], columns: usize) {
    let c = &made.capture;
    for (point, wanted) in wanted.iter().enumerate() {
        let found = at(c, point % columns, point / columns);
        assert!(found == &wanted[..c.bins], "point {point}");
        assert!(wanted[c.bins..].iter().all(|n| *n == 0.0));
    }
    let all: f32 = wanted.iter().flatten().sum();
    assert_eq!((total(c), made.photons), (f64::from(all), all as u64));
    assert!(c.integer_counts && (c.bin_width / (32e-12 * LIGHT) - 1.0).abs() < 1e-9);
}

#[test]
fn pulses_of_a_point_are_divided_in_every_format() {
    let made = Made::new(6 * 500, 3);
    let wanted = made.wanted(6, |sync| Some((sync / 500) as usize));
    let by = asked(Division::Pulses { each: 500, before: 0 });
    let (_folder, path) = place("made.ptu");
    for number in [0x0001_0203, 0x0001_0303, 0x0001_0204, 0x0101_0204, 0x0001_0305, 0x0001_0207, 0x0001_0307]
    {
        let (_, bytes) = made.file(number);
        write(&path, bytes);
        let found = histogram(&path, &grid(3, 2), &by).unwrap();
        assert_same(&found, &wanted, 3);
        assert_eq!((found.left_out, found.pulses.map(|p| p[0])), (0, Some(500)));
    }
    // Arrays and text have ticks of a picosecond.
    let (writer, _) = made.file(0x0001_0207);
    let finer = |record: &Record| match *record {
        Record::Sync { time } => Record::Sync { time: 4 * time },
        Record::Photon { time, .. } => Record::Photon { channel: 9, time: 4 * time, delay: 0 },
        other => other,
    };
    let finer: Vec<_> = writer.wanted.iter().map(finer).collect();
    for (name, bytes) in [("tags.txt", csv(&finer).into_bytes()), ("tags.npz", npz_of(&arrays(&finer), true))]
    {
        let path = path.with_file_name(name);
        write(&path, bytes);
        assert_same(&histogram(&path, &grid(3, 2), &by).unwrap(), &wanted, 3);
        let other = Asked { inputs: Inputs { sync: 5, markers: vec![], ..Inputs::default() }, ..by.clone() };
        assert_error(histogram(&path, &grid(3, 2), &other), Kind::Input, &[name, "laser pulses"]);
    }
    // Histograms of the instrument itself.
    let mut counts = vec![0i64; 6 * 375];
    made.photons.iter().for_each(|(sync, delay)| counts[(sync / 500 * 375 + delay / 8) as usize] += 1);
    let path = path.with_file_name("made.npy");
    write(&path, Array::from_i64(&[6, 375], &counts).to_npy());
    let own = Asked { division: None, ..by.clone() };
    assert_same(&histogram(&path, &grid(3, 2), &own).unwrap(), &wanted, 3);
}

#[test]
fn markers_begin_points_also_late_and_out_of_order() {
    let mut made = Made::new(9100, 5);
    // Two rounds of 3 x 2 points of 700 pulses; marker 3 begins a round, marker 1 a point; a pause before the second round, and
    // one point more at the end.
    let begin = |round: i64, point: i64| 500 + round * 6500 - round * 2200 + point * 700;
    for round in 0..2 {
        for point in 0..6 {
            made.markers.push((begin(round, point), if point == 0 { 5 } else { 1 }));
        }
    }
    made.markers.push((begin(1, 6), 1));
    made.markers.sort_unstable();
    let point = |sync: i64| {
        let within = |round: i64| {
            (0..6).find(|p| (begin(round, *p)..begin(round, *p) + 700).contains(&sync)).map(|p| p as usize)
        };
        within(0).or_else(|| within(1))
    };
    let wanted = made.wanted(6, point);
    let (_folder, path) = place("made.ptu");
    for number in [0x0001_0303, 0x0001_0307] {
        let (mut writer, _) = made.file(number);
        // Late by some records, and two in the wrong order.
        let is_marker = |w: &u32| {
            w >> 31 == 1 && (w >> 25 & 63) < 16
                || number == 0x0001_0303 && w >> 28 == 15 && w >> 16 & 0xFFF > 0
        };
        let places: Vec<_> = (0..writer.words.len()).filter(|i| is_marker(&writer.words[*i])).collect();
        assert_eq!(places.len(), 13);
        for (i, place) in places.iter().enumerate().filter(|(i, _)| i % 3 == 1) {
            let to = place + 5 + i;
            // Not across an overflow: it would be another time.
            let crosses = writer.words[*place..=to].iter().any(|w| w >> 25 == 127 || w >> 16 == 0xF000);
            if !crosses {
                writer.words[*place..=to].rotate_left(1);
            }
        }
        write(&path, writer.file(TICK, PERIOD, &[]));
        for frame in [Some(3), None] {
            let found = histogram(&path, &grid(3, 2), &asked(Division::Pixels { marker: 1, frame })).unwrap();
            assert_same(&found, &wanted, 3);
            let notes = found.notes.join("\n");
            assert!(notes.contains("2 rounds of the scan are added up"), "{notes}");
            assert_eq!(found.pulses, Some([1400, 1400]), "{notes}");
        }
    }
    // A round that is not whole is left out.
    let wanted = made.wanted(6, |sync| point(sync).filter(|_| sync < begin(0, 6)));
    made.markers.retain(|m| m.0 != begin(1, 2));
    write(&path, made.file(0x0001_0307).1);
    let frames = asked(Division::Pixels { marker: 1, frame: Some(3) });
    let cut = Made { markers: made.markers[..10].to_vec(), ..made };
    write(&path, cut.file(0x0001_0307).1);
    let found = histogram(&path, &grid(3, 2), &frames).unwrap();
    assert!(found.notes.iter().any(|n| n.contains("1 of 2 rounds")), "{:?}", found.notes);
    assert_same(&found, &wanted, 3);
    assert_error(
        histogram(&path, &grid(4, 2), &frames),
        Kind::Input,
        &["made.ptu", "marker 1 begins 6 of the 8", "10 of marker 1, 2 of marker 3"],
    );
    assert_error(
        histogram(&path, &grid(3, 2), &asked(Division::Pixels { marker: 2, frame: None })),
        Kind::Input,
        &["marker 2 begins 0 of the 6"],
    );
    assert_error(
        histogram(&path, &grid(3, 2), &asked(Division::Pixels { marker: 17, frame: None })),
        Kind::Options,
        &["no marker 17"],
    );
}

#[test]
fn lines_are_divided_evenly() {
    let mut made = Made::new(8000, 7);
    // Lines of other lengths, with the way back between them; the first has no begin.
    let lines = [(1000, 1901), (2500, 3400), (4100, 5003)];
    made.markers.push((600, 2));
    for (from, to) in lines {
        made.markers.extend([(from, 1), (to, 2)]);
    }
    let point = |sync: i64| {
        let (row, (from, to)) =
            lines.iter().enumerate().find(|(_, (from, to))| (*from..*to).contains(&sync))?;
        Some(row * 4 + ((sync - from) * 4 / (to - from)) as usize)
    };
    let wanted = made.wanted(12, point);
    let (_folder, path) = place("made.ptu");
    let (writer, bytes) = made.file(0x0001_0307);
    write(&path, bytes);
    let lines = asked(Division::Lines { start: 1, stop: Some(2), frame: None });
    assert_same(&histogram(&path, &grid(4, 3), &lines).unwrap(), &wanted, 4);
    // The header of an image tells the markers.
    let header = [("ImgHdr_LineStart", 1), ("ImgHdr_LineStop", 2), ("ImgHdr_PixX", 4), ("ImgHdr_PixY", 3)];
    write(&path, writer.file(TICK, PERIOD, &header));
    let image = Asked { division: None, ..lines.clone() };
    let found = histogram(&path, &grid(4, 3), &image).unwrap();
    assert_same(&found, &wanted, 4);
    // Snake: every other row comes backwards.
    let snake = Scan::grid([4, 3], 1.0, true).unwrap();
    let turned = histogram(&path, &snake, &image).unwrap().capture;
    for y in 0..3 {
        for x in 0..4 {
            let from = if y == 1 { 3 - x } else { x };
            assert!(at(&turned, x, y) == at(&found.capture, from, y));
        }
    }
    // Mirrored, as captures are.
    let turn = Turn::of(Some(Flip::X), Some(90)).unwrap();
    let turned = histogram(&path, &grid(4, 3), &Asked { turn, ..image.clone() }).unwrap().capture;
    assert!(turned.histograms == found.capture.clone().turned(turn).histograms && turned.scan == [3, 4]);
    // Points of a file in any order are columns and rows, too.
    let list = path.with_file_name("points.csv");
    let text: Vec<_> = grid(4, 3).laser.iter().map(|p| format!("{},{},{}\n", p.x, p.y, p.z)).collect();
    write(&list, text.concat());
    let listed = histogram(&path, &Scan::read(&list).unwrap(), &image).unwrap().capture;
    assert!(listed.histograms == found.capture.histograms && listed.scan == [4, 3]);
    let no_lines = Scan { per_line: None, ..grid(5, 3) };
    assert_error(histogram(&path, &no_lines, &lines), Kind::Options, &["on a line"]);
}

/// Direct light of each point at its own delay, light of a scene 500 ticks later, dark counts.
fn confocal(path: &Path) -> (Scan, Vec<f64>) {
    let scan = grid(4, 4);
    let device = DVec3::new(0.2, -0.1, -1.3);
    let delays: Vec<f64> =
        scan.laser.iter().map(|p| (2.0 * p.distance(device) / LIGHT + 3e-9) / TICK).collect();
    let mut random = random(19);
    let mut writer = Writer::new(0x0001_0307);
    for sync in 0..16 * 4000i64 {
        let point = (sync / 4000) as usize;
        let jitter = (0..4).map(|_| random(9) as f64 - 4.0).sum::<f64>() / 2.0;
        let delay = match random(20) {
            0 => delays[point] + jitter,
            1 if sync % 3 == 0 => delays[point] + 500.0 + jitter,
            2 if sync % 5 == 0 => random(6000) as f64,
            _ => continue,
        };
        writer.photon(2, sync, delay as u32);
    }
    write(path, writer.file(TICK, PERIOD, &[]));
    (scan, delays)
}

#[test]
fn the_direct_peak_is_path_zero() {
    let (_folder, path) = place("made.ptu");
    let (scan, delays) = confocal(&path);
    let direct = Asked {
        zero: Zero::Direct,
        pile_up: PileUp::Auto,
        ..asked(Division::Pulses { each: 4000, before: 0 })
    };
    let found = histogram(&path, &scan, &direct).unwrap();
    let c = &found.capture;
    assert!(c.t_start < -2.0 && c.t_end() > 2.0, "{} {}", c.t_start, c.t_end());
    for (point, delay) in delays.iter().enumerate() {
        let reported = found.direct.as_ref().unwrap()[point % 4 * 4 + point / 4];
        assert!((reported - delay * TICK * LIGHT).abs() < 1e-3, "{reported}");
        let histogram = at(c, point % 4, point / 4);
        for path in [0.0, 500.0 * TICK * LIGHT] {
            let near = |b: &usize| (c.t_start + (*b as f64 + 0.5) * c.bin_width - path).abs() < 0.03;
            let all = || (0..c.bins).filter(near);
            let sum: f64 = all().map(|b| f64::from(histogram[b])).sum();
            let moment: f64 =
                all().map(|b| f64::from(histogram[b]) * (c.t_start + (b as f64 + 0.5) * c.bin_width)).sum();
            assert!(
                sum > 20.0 && (moment / sum - path).abs() < 0.3 * c.bin_width,
                "{point}: {}",
                moment / sum - path
            );
        }
    }
    // Each pulse gave one photon at most: pile-up is taken out when the capture is read.
    assert_eq!(c.cycles, Some(4000.0));
    assert!(found.notes.iter().any(|n| n.contains("4000 laser pulses")), "{:?}", found.notes);
    let off = histogram(&path, &scan, &Asked { pile_up: PileUp::Off, ..direct.clone() }).unwrap();
    assert_eq!(off.capture.cycles, None);
    // The capture is one like others.
    let npz = path.with_extension("npz");
    capture::write(c, &npz).unwrap();
    assert!(read(&npz).unwrap().histograms == c.histograms);
    // Nothing direct: an error, or a delay that is given.
    let apart = Scan { sensor: vec![DVec3::X; 16], ..scan.clone() };
    assert_error(histogram(&path, &apart, &direct), Kind::Options, &["no direct peak"]);
    let at = Asked { zero: Zero::At(3e-9), until: Some(12e-9), ..direct.clone() };
    let given = histogram(&path, &apart, &at).unwrap();
    assert!(given.direct.is_none() && (given.capture.t_end() - 9e-9 * LIGHT).abs() < 0.02);
    for (wrong, words) in [
        (Asked { zero: Zero::At(1e-6), ..direct.clone() }, "no path is left"),
        (Asked { channel: Some(1), ..direct.clone() }, "2 ("),
        (Asked { division: None, ..direct.clone() }, "no marker"),
        (Asked { bin_width: Some(-1.0), ..direct.clone() }, "bin width is -1"),
        (Asked { until: Some(f64::NAN), ..direct.clone() }, "NaN"),
        (asked(Division::Pulses { each: 0, before: 0 }), "0 laser pulses"),
        (asked(Division::Pulses { each: 5000, before: 0 }), "the file ends after 6"),
        (asked(Division::Pulses { each: u64::MAX, before: 0 }), "laser pulses"),
    ] {
        assert_error(histogram(&path, &scan, &wrong), Kind::Options, &[words]);
    }
    let missing = PathBuf::from("/nowhere/made.ptu");
    assert_error(histogram(&missing, &scan, &direct), Kind::Input, &["/nowhere/made.ptu: cannot be read"]);
}

#[test]
fn a_detector_that_records_more_photons_of_a_pulse_has_no_pile_up() {
    let (_folder, path) = place("made.ptu");
    let mut random = random(23);
    let mut writer = Writer::new(0x0001_0307);
    for sync in 0..4000i64 {
        for _ in 0..random(3) {
            writer.photon(1, sync, random(1000) as u32);
        }
    }
    write(&path, writer.file(TICK, PERIOD, &[]));
    let pulses = Asked { pile_up: PileUp::Auto, ..asked(Division::Pulses { each: 1000, before: 0 }) };
    assert_eq!(histogram(&path, &grid(2, 2), &pulses).unwrap().capture.cycles, None);
    let on = Asked { pile_up: PileUp::On, ..pulses };
    let made = histogram(&path, &grid(2, 2), &on);
    assert!(made.as_ref().is_err_and(|e| e.what.contains("more photons than laser pulses")) || made.is_ok());
}

#[test]
fn lines_never_shift_where_there_are_more_than_the_header_has() {
    // Rounds of four lines, with a pause after each; the header has three.
    let mut made = Made::new(30_000, 11);
    let lines = || (0..12).map(|line| 500 + line / 4 * 9000 + line % 4 * 700);
    made.markers.extend(lines().map(|sync| (sync, 1)));
    let (_folder, path) = place("made.ptu");
    let header = [("ImgHdr_LineStart", 1), ("ImgHdr_PixX", 2), ("ImgHdr_PixY", 3)];
    let image = Asked { division: None, ..asked(Division::Pulses { each: 1, before: 0 }) };
    write(&path, made.file(0x0001_0307).0.file(TICK, PERIOD, &header));
    assert_error(histogram(&path, &grid(2, 3), &image), Kind::Input, &["comes 4 times", "the scan has 3"]);
    let point = |sync: i64| {
        let begin = lines().rev().find(|begin| *begin <= sync).filter(|begin| sync < begin + 700)?;
        Some(((begin - 500) % 9000 / 700 * 2 + (sync - begin) / 350) as usize)
    };
    assert_same(&histogram(&path, &grid(2, 4), &image).unwrap(), &made.wanted(8, point), 2);
    // With a marker of frames the rest of each round is left out, and a note says so.
    made.markers.iter_mut().step_by(4).for_each(|(_, bits)| *bits = 5);
    let framed = [&header[..], &[("ImgHdr_Frame", 3)]].concat();
    write(&path, made.file(0x0001_0307).0.file(TICK, PERIOD, &framed));
    let found = histogram(&path, &grid(2, 3), &image).unwrap();
    assert_same(&found, &made.wanted(6, |sync| point(sync).filter(|point| *point < 6)), 2);
    assert!(
        found.notes.iter().any(|n| n.contains("more than the 3") && n.contains("3 rounds")),
        "{:?}",
        found.notes
    );
    made.markers.clear();
    write(&path, made.file(0x0001_0307).0.file(TICK, PERIOD, &header));
    assert_error(histogram(&path, &grid(2, 3), &image), Kind::Input, &["no marker"]);
}

#[test]
fn tags_out_of_order_are_counted_where_they_belong_and_noted() {
    let made = Made::new(6 * 500, 3);
    let wanted = made.wanted(6, |sync| Some((sync / 500) as usize));
    let by = asked(Division::Pulses { each: 500, before: 0 });
    let (_folder, path) = place("made.ptu");
    let mut writer = made.file(0x0001_0307).0;
    let pair = |w: &[u32]| w.iter().all(|w| w >> 31 == 0) && w[0] & 1023 != w[1] & 1023;
    let at = writer.words.windows(2).position(pair).unwrap();
    writer.words.swap(at, at + 1);
    write(&path, writer.file(TICK, PERIOD, &[]));
    let found = histogram(&path, &grid(3, 2), &by).unwrap();
    assert_same(&found, &wanted, 3);
    assert!(found.notes.iter().any(|n| n.starts_with("1 photons were out of order")), "{:?}", found.notes);
    // A laser pulse behind a later one.
    let text = path.with_extension("csv");
    write(&text, "0,10000\n1,12000\n0,210000\n0,110000\n1,220000\n0,310000\n");
    let tags = thirdbounce_tags::Tags::open(&text, &Inputs { sync: 0, markers: vec![], ..Inputs::default() })
        .unwrap();
    let mut delays = vec![];
    let notes = tags.events(|event| delays.push(event)).unwrap().notes.join("\n");
    assert!(notes.contains("1 tags were out of order and are put in order"), "{notes}");
    let photon = |sync, delay| Event::Photon { channel: 1, sync, delay };
    assert_eq!(delays, [photon(0, 2000), photon(2, 10_000)]);
}

#[test]
fn records_decide_where_the_header_contradicts_itself() {
    let (_folder, path) = place("made.ptu");
    let made = Made::new(1000, 3);
    let wanted = made.wanted(6, |sync| Some((sync / 100) as usize).filter(|point| *point < 6));
    let by = asked(Division::Pulses { each: 100, before: 0 });
    let scan = |asked: &Asked| histogram(&path, &grid(3, 2), asked);
    // The type of T3 records in the header becomes that of T2, and the other way round, with either mode.
    for (number, of_header, mode) in [
        (0x0001_0306, 0x0001_0206, 3),
        (0x0001_0307, 0x0001_0307, 2),
        (0x0001_0203, 0x0001_0303, 2),
        (0x0001_0203, 0x0001_0203, 3),
        (0x0001_0303, 0x0001_0303, 2),
    ] {
        let header = [("Measurement_Mode", mode), ("TTResultFormat_TTTRRecType", of_header)];
        write(&path, made.file(number).0.file(TICK, PERIOD, &header));
        let found = scan(&by).unwrap();
        let words = format!("the records are those of T{}", number >> 8 & 15);
        assert!(
            found.notes.iter().any(|n| n.contains("contradicts itself") && n.contains(&words)),
            "{:?}",
            found.notes
        );
        if number != 0x0001_0303 || of_header == number {
            let first: Vec<f32> = wanted.iter().flatten().copied().collect();
            assert_eq!(total(&found.capture), f64::from(first.iter().sum::<f32>()), "{number:x}");
        }
    }
    // A header that agrees with itself and not with its records.
    let header = [("Measurement_Mode", 2), ("TTResultFormat_TTTRRecType", 0x0001_0206)];
    write(&path, made.file(0x0001_0306).0.file(TICK, PERIOD, &header));
    assert_error(
        scan(&by),
        Kind::Input,
        &["TimeHarp 260 P, T2", "no record is a laser pulse", "`records` t3"],
    );
    let inputs = Inputs { t3: Some(true), ..Inputs::default() };
    assert!(scan(&Asked { inputs, ..by }).is_ok());
}
