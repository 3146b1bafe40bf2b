//! Files as instruments and their users leave them: scans without all of their markers, scanners that do not move evenly, laser pulses
//! that are not all in the file, text of any program, histograms of instruments.

use std::fmt::Write;
use std::path::Path;

use fixtures::captures::{assert_error, place};
use fixtures::files::{hdf5, scalar, vector};
use tag_fixtures::tags::{Writer, phu, write};
use thirdbounce::{Kind, Result};
use thirdbounce_tags::{Asked, Division, Histograms, Inputs, PileUp, Scan, Zero, histogram};

const TICK: f64 = 4e-12;
const PERIOD: f64 = 5e-8;
const LIGHT: f64 = 299_792_458.0;
/// Points of a side, and laser pulses of a point and of a line.
const SIDE: usize = 8;
const PULSES: i64 = 400;
const LINE: i64 = SIDE as i64 * PULSES;
/// Ticks of a bin.
const BIN: i64 = 32;

/// A photon: its point, how far along the point it comes, and its delay in ticks.
struct Photon {
    x: usize,
    y: usize,
    along: f64,
    delay: i64,
}

/// Photons of all points: direct light and light of a scene, at delays and in numbers that differ from point to point.
fn photons() -> Vec<Photon> {
    let mut state = 99u64;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    let mut all = vec![];
    for y in 0..SIDE {
        for x in 0..SIDE {
            for k in 0..120 + 15 * x {
                let delay = match k % 3 {
                    0 => 4000 + 300 * x as i64 + 150 * y as i64 + (40.0 * random()) as i64,
                    _ => 2000 + 60 * x as i64 + 20 * y as i64 + (20.0 * random()) as i64,
                };
                all.push(Photon { x, y, along: random(), delay });
            }
        }
    }
    all
}

/// The photons by their laser pulse; `pulse` returns its number from the row and the position along x, 0 to 1.
fn in_time(pulse: impl Fn(usize, f64) -> i64) -> Vec<(i64, i64)> {
    let at = |p: &Photon| (pulse(p.y, (p.x as f64 + p.along) / SIDE as f64), p.delay);
    let mut all: Vec<_> = photons().iter().map(at).collect();
    all.sort_unstable();
    all
}

/// A file of T3 records of photons and markers, both by their laser pulses.
fn t3(photons: &[(i64, i64)], markers: &[(i64, u16)]) -> Writer {
    let mut writer = Writer::new(0x0001_0307);
    let mut markers = markers.iter().peekable();
    for (sync, delay) in photons {
        while let Some((at, bits)) = markers.next_if(|m| m.0 <= *sync) {
            writer.marker(*bits, *at);
        }
        writer.photon(1, *sync, *delay as u32);
    }
    markers.for_each(|(at, bits)| writer.marker(*bits, *at));
    writer
}

fn asked(division: Option<Division>) -> Asked {
    let zero = Zero::At(0.0);
    Asked {
        division,
        zero,
        bin_width: Some(BIN as f64 * TICK * LIGHT),
        pile_up: PileUp::Off,
        ..Asked::default()
    }
}

fn lines(stop: Option<u32>, frame: Option<u32>) -> Option<Division> {
    Some(Division::Lines { start: 1, stop, frame })
}

fn grid() -> Scan {
    Scan::grid([SIDE, SIDE], 1.0, false).unwrap()
}

/// Share of the photons that are not in the point and bin where they belong, of a scan that was measured `times` times.
fn misplaced(found: &Histograms, times: f64) -> f64 {
    let c = &found.capture;
    let first = (c.t_start / c.bin_width).round() as i64;
    let mut counts: Vec<f64> = c.histograms.iter().map(|n| f64::from(*n)).collect();
    let all = photons();
    for p in &all {
        let bin = p.delay / BIN - first;
        if (0..c.bins as i64).contains(&bin) {
            counts[(p.x * SIDE + p.y) * c.bins + bin as usize] -= times;
        }
    }
    counts.iter().map(|n| n.abs()).sum::<f64>() / (2.0 * times * all.len() as f64)
}

#[track_caller]
fn assert_placed(found: &Result<Histograms>, times: f64, most: f64) {
    let found = found.as_ref().unwrap();
    let share = misplaced(found, times);
    assert!(share <= most, "{share} of the photons are misplaced: {:#?}", found.notes);
}

#[track_caller]
fn assert_noted(found: &Result<Histograms>, words: &str) {
    let notes = found.as_ref().unwrap().notes.join("\n");
    assert!(notes.contains(words), "{words} is not in {notes}");
}

fn along(row: usize, from: f64) -> i64 {
    (row as f64 * LINE as f64 + from * LINE as f64) as i64
}

#[test]
fn a_return_without_a_marker_is_no_part_of_a_line() {
    let (_folder, path) = place("made.ptu");
    let whole = LINE * 3 / 2;
    let all = in_time(|row, x| row as i64 * whole + (x * LINE as f64) as i64);
    let starts: Vec<_> = (0..SIDE as i64).map(|row| (row * whole, 1)).collect();
    write(&path, t3(&all, &starts).file(TICK, PERIOD, &[]));
    let found = histogram(&path, &grid(), &asked(lines(None, None)));
    assert_placed(&found, 1.0, 0.02);
    assert_noted(&found, "photons cease");
    let line_time = Some(LINE as f64 * PERIOD);
    assert_placed(&histogram(&path, &grid(), &Asked { line_time, ..asked(lines(None, None)) }), 1.0, 0.0);
    // The header says it, and that marker 2 would end a line, which the file does not have.
    let mut writer = t3(&all, &starts);
    writer.reals = vec![("ImgHdr_TimePerPixel", 1e3 * PULSES as f64 * PERIOD)];
    let header = [("ImgHdr_LineStart", 1), ("ImgHdr_LineStop", 2), ("ImgHdr_PixX", 8), ("ImgHdr_PixY", 8)];
    write(&path, writer.file(TICK, PERIOD, &header));
    let found = histogram(&path, &grid(), &asked(None));
    assert_placed(&found, 1.0, 0.0);
    assert_noted(&found, "no marker 2");
    // Three lines before those of the scan.
    let before = 3 * LINE;
    let late: Vec<_> = in_time(along).into_iter().map(|(pulse, delay)| (pulse + before, delay)).collect();
    let starts: Vec<_> = (0..SIDE as i64 + 3).map(|row| (row * LINE, 1)).collect();
    let more = [(before + SIDE as i64 * LINE, 2)];
    write(&path, t3(&late, &[&starts[..], &more].concat()).file(TICK, PERIOD, &[]));
    let found = histogram(&path, &grid(), &asked(lines(None, None)));
    assert_noted(&found, "marker 1 begins 3 more than the 8 that the scan has");
    assert_noted(&found, "lines come before");
    assert!(misplaced(&found.unwrap(), 1.0) > 0.1);
    let given = Asked { lines_before: 3, ..asked(lines(None, None)) };
    assert_placed(&histogram(&path, &grid(), &given), 1.0, 0.0);
    // Without any return, that is said.
    let starts: Vec<_> = (0..SIDE as i64).map(|row| (row * LINE, 1)).collect();
    write(&path, t3(&in_time(along), &starts).file(TICK, PERIOD, &[]));
    let found = histogram(&path, &grid(), &asked(lines(None, None)));
    assert_placed(&found, 1.0, 0.0);
    assert_noted(&found, "a return of the scanner included");
}

#[test]
fn lines_in_both_directions_are_turned_and_shifted() {
    let (_folder, path) = place("made.ptu");
    let (idle, first) = (2 * PULSES, 1000);
    let begin = |row: usize| first + row as i64 * (LINE + idle);
    let markers: Vec<_> = (0..SIDE).flat_map(|row| [(begin(row), 1), (begin(row) + LINE, 2)]).collect();
    let header = [
        ("ImgHdr_LineStart", 1),
        ("ImgHdr_LineStop", 2),
        ("ImgHdr_PixX", 8),
        ("ImgHdr_PixY", 8),
        ("ImgHdr_BiDirect", 1),
    ];
    let snake = Scan::grid([SIDE, SIDE], 1.0, true).unwrap();
    for (points, most) in [(0.0, 0.0), (0.4, 0.03), (1.0, 0.02), (-0.6, 0.03)] {
        let late = (points * PULSES as f64) as i64;
        let pulse = |row: usize, x: f64| {
            let (x, late) = if row % 2 == 1 { (1.0 - x, late) } else { (x, 0) };
            begin(row) + late + (x * LINE as f64) as i64
        };
        let writer = t3(&in_time(pulse), &markers);
        write(&path, writer.file(TICK, PERIOD, &header));
        // By the header, and by an option alone.
        assert_placed(&histogram(&path, &grid(), &asked(None)), 1.0, most);
        write(&path, writer.file(TICK, PERIOD, &[]));
        let found = histogram(&path, &snake, &asked(lines(Some(2), None)));
        assert_placed(&found, 1.0, most);
        let given = Asked { line_shift: Some(points), ..asked(lines(Some(2), None)) };
        assert_placed(&histogram(&path, &snake, &given), 1.0, 0.002);
        assert_error(histogram(&path, &grid(), &given), Kind::Options, &["in one direction", "`line_shift`"]);
        if points != 0.0 {
            assert_noted(&found, "points late");
        }
    }
    // Column by column: the rows of the grid above are the columns of this one.
    let columns = Scan::by_columns([SIDE, 2], 1.0, true).unwrap();
    let at = |i: usize| (columns.laser[i].x, columns.laser[i].y);
    assert!(at(0).0 == at(1).0 && at(0).1 < at(1).1 && at(2).0 > at(1).0 && at(2).1 == at(1).1);
}

#[test]
fn a_line_of_a_sine_has_points_of_equal_width_in_space() {
    let (_folder, path) = place("made.ptu");
    let quarter = 0.8 * std::f64::consts::FRAC_PI_2;
    let pulse = |row: usize, x: f64| {
        let phase = (quarter.sin() * (2.0 * x - 1.0)).asin();
        along(row, 0.5 + 0.5 * phase / quarter)
    };
    let markers: Vec<_> =
        (0..SIDE).flat_map(|row| [(along(row, 0.0), 1), (along(row, 1.0) - 1, 2)]).collect();
    let header = [
        ("ImgHdr_LineStart", 1),
        ("ImgHdr_LineStop", 2),
        ("ImgHdr_PixX", 8),
        ("ImgHdr_PixY", 8),
        ("ImgHdr_SinCorrection", 80),
    ];
    write(&path, t3(&in_time(pulse), &markers).file(TICK, PERIOD, &header));
    let found = histogram(&path, &grid(), &asked(None));
    assert_placed(&found, 1.0, 0.005);
    assert_noted(&found, "a sine over 80 %");
}

#[test]
fn markers_that_are_missing_or_too_many_are_told() {
    let (_folder, path) = place("made.ptu");
    let frame = SIDE as i64 * LINE + 500;
    let times = |frames: i64| -> Vec<(i64, i64)> {
        let one = in_time(along);
        (0..frames)
            .flat_map(|f| one.iter().map(move |(sync, delay)| (1000 + f * frame + sync, *delay)))
            .collect()
    };
    let of_frames = |frames: i64, marked: &dyn Fn(i64) -> bool| -> Vec<(i64, u16)> {
        let begin = |f: i64, row: usize| {
            (1000 + f * frame + along(row, 0.0), if row == 0 && marked(f) { 5 } else { 1 })
        };
        (0..frames).flat_map(|f| (0..SIDE).map(move |row| begin(f, row))).collect()
    };
    // The first of three frames has no marker of its own, and an earlier, incomplete one has none either.
    let framed = asked(lines(None, Some(3)));
    let three = times(3);
    for early in [&[][..], &[(100, 1), (100 + LINE / 10, 1)]] {
        let markers = [early, &of_frames(3, &|f| f > 0)].concat();
        write(&path, t3(&three, &markers).file(TICK, PERIOD, &[]));
        assert_placed(&histogram(&path, &grid(), &framed), 3.0, 0.0);
    }
    // A single frame without any.
    write(&path, t3(&times(1), &of_frames(1, &|_| false)).file(TICK, PERIOD, &[]));
    let found = histogram(&path, &grid(), &framed);
    assert_placed(&found, 1.0, 0.0);
    assert_noted(&found, "no marker 3");
    // A start of a line too many.
    let extra = [&[(1000 - LINE / 10, 1)][..], &of_frames(1, &|_| false)].concat();
    let writer = t3(&times(1), &extra);
    write(&path, writer.file(TICK, PERIOD, &[]));
    let error = histogram(&path, &grid(), &asked(lines(None, None)));
    assert_error(
        error,
        Kind::Input,
        &["of 320 laser pulses, number 1 of 8, where 3200 are usual", "9 of marker 1"],
    );
    // A file that is cut: that comes first, and the counts agree.
    let whole = t3(&times(1), &of_frames(1, &|f| f == 0)).file(TICK, PERIOD, &[]);
    let header = whole.windows(10).position(|w| w == b"Header_End").unwrap() + 48;
    write(&path, &whole[..header + (whole.len() - header) / 2 - 1]);
    let error = histogram(&path, &grid(), &asked(lines(None, Some(3)))).unwrap_err();
    let what = error.what.split(": ").skip(1).collect::<Vec<_>>().join(": ");
    assert!(
        what.starts_with("the file ends after ") && what.contains("marker 1 begins 4 of the 8"),
        "{error}"
    );
    assert!(error.hint.to_string().contains("4 of marker 1, 1 of marker 3"), "{error}");
}

/// Laser pulses of channel 0 that are kept, photons of channel 1 and the starts of points on channel 2, picoseconds.
fn tags(keep: impl Fn(i64, bool) -> bool) -> Vec<(i32, i64)> {
    let all = in_time(along);
    let mut with_photon: Vec<i64> = all.iter().map(|p| p.0).collect();
    with_photon.dedup();
    let end = SIDE as i64 * LINE;
    let syncs = (0..end + 10).filter(|s| keep(*s, with_photon.binary_search(s).is_ok()));
    let first = 1_700_000_000;
    let mut tags: Vec<(i32, i64)> = syncs.map(|sync| (0, first + sync * 50_000)).collect();
    tags.extend(all.iter().map(|(sync, delay)| (1, first + sync * 50_000 + delay * 4)));
    tags.extend((0..(SIDE * SIDE) as i64).map(|p| (2, first + p * PULSES * 50_000 + 10)));
    tags.sort_by_key(|tag| (tag.1, tag.0));
    tags
}

fn of_points() -> Asked {
    let inputs = Inputs { markers: vec![2], ..Inputs::default() };
    Asked { inputs, ..asked(Some(Division::Pixels { marker: 1, frame: None })) }
}

fn text(tags: &[(i32, i64)], line: impl Fn(usize, i32, i64) -> String) -> String {
    tags.iter().enumerate().map(|(i, (channel, time))| line(i, *channel, *time) + "\n").collect()
}

#[test]
fn laser_pulses_that_are_not_all_in_the_file_give_the_same_delays() {
    let (_folder, path) = place("made.csv");
    let plain = |tags: &[(i32, i64)]| text(tags, |_, channel, time| format!("{channel},{time}"));
    let with = |change: &dyn Fn(&mut Inputs)| {
        let mut asked = of_points();
        change(&mut asked.inputs);
        histogram(&path, &grid(), &asked)
    };
    write(&path, plain(&tags(|_, _| true)));
    assert_placed(&with(&|_| {}), 1.0, 0.0);
    // Every eighth, in text and in T2 records whose header says so.
    write(&path, plain(&tags(|sync, _| sync % 8 == 0)));
    assert_error(with(&|_| {}), Kind::Input, &["repeat 8 times", "`sync_divider` 8"]);
    assert_placed(&with(&|inputs| inputs.divider = Some(8)), 1.0, 0.01);
    let ptu = path.with_extension("ptu");
    let mut writer = Writer::new(0x0001_0207);
    for (channel, time) in tags(|sync, _| sync % 8 == 0) {
        let time = time / 4;
        match channel {
            0 => writer.sync(time),
            1 => writer.photon(1, time, 0),
            _ => writer.marker(1, time),
        }
    }
    write(&ptu, writer.file(TICK, PERIOD, &[("HWSync_Divider", 8)]));
    let found = histogram(&ptu, &grid(), &of_points());
    assert_placed(&found, 1.0, 0.01);
    assert_noted(&found, "every 8th laser pulse");
    // The pulse of each photon, and the one after each photon.
    write(&path, plain(&tags(|_, has| has)));
    let found = with(&|_| {});
    assert_placed(&found, 1.0, 0.02);
    assert_noted(&found, "numbered by time, 50.0000 ns apart");
    let after: Vec<i64> = in_time(along).iter().map(|p| p.0 + 1).collect();
    write(&path, plain(&tags(|sync, _| after.binary_search(&sync).is_ok())));
    assert_error(with(&|_| {}), Kind::Input, &["after each photon only", "`sync_after` 50ns"]);
    assert_placed(&with(&|inputs| inputs.filtered = Some(PERIOD)), 1.0, 0.005);
}

#[test]
fn text_is_read_as_programs_write_it() {
    let (_folder, path) = place("made.csv");
    let all = tags(|_, has| has);
    let read = |bytes: &[u8], unit: Option<f64>| {
        write(&path, bytes);
        let mut asked = of_points();
        asked.inputs.unit = unit;
        histogram(&path, &grid(), &asked)
    };
    let plain = text(&all, |_, channel, time| format!("{channel},{time}"));
    let with = |head: &str, line: &dyn Fn(usize, i32, i64) -> String| head.to_string() + &text(&all, line);
    let ns = |time: i64| format!("{}.{:03}", time / 1000, time % 1000);
    let wide: Vec<u8> =
        std::iter::once(0xFEFF).chain(plain.encode_utf16()).flat_map(u16::to_be_bytes).collect();
    let little: Vec<u8> = plain.encode_utf16().flat_map(u16::to_le_bytes).collect();
    for (name, bytes) in [
        ("a mark", [b"\xEF\xBB\xBF", plain.as_bytes()].concat()),
        ("UTF-16", wide),
        ("UTF-16 without mark", little),
        ("CR", plain.replace('\n', "\r").into_bytes()),
        ("CR LF", plain.replace('\n', "\r\n").into_bytes()),
        ("quotes", with("\"channel\",\"time\"\n", &|_, c, t| format!("\"{c}\",\"{t}\"")).into_bytes()),
        ("ns", with("channel,time_ns\n", &|_, c, t| format!("{c},{}", ns(t))).into_bytes()),
        ("ns in a comment", with("# Time [ns]; Channel\n", &|_, c, t| format!("{};{c}", ns(t))).into_bytes()),
        (
            "decimal commas",
            with("channel;time_ns\n", &|_, c, t| format!("{c};{}", ns(t).replace('.', ","))).into_bytes(),
        ),
        ("s", with("time_s,channel\n", &|_, c, t| format!("0.{t:012},{c}")).into_bytes()),
        ("pandas", with(",channel,time_ps\n", &|i, c, t| format!("{i},{c},{t}")).into_bytes()),
        ("index", with("index,channel,time\n", &|i, c, t| format!("{i},{c},{t}")).into_bytes()),
        ("index without names", with("", &|i, c, t| format!("{i},{c},{t}")).into_bytes()),
        ("time first", with("", &|_, c, t| format!("{t} {c}")).into_bytes()),
        (
            "both",
            with("time_s,time_ps,channel\n", &|_, c, t| format!("0.{:06},{t},{c}", t / 1_000_000))
                .into_bytes(),
        ),
    ] {
        let found = read(&bytes, None);
        assert!(found.as_ref().is_ok_and(|found| misplaced(found, 1.0) < 0.02), "{name}: {found:?}");
    }
    // Nanoseconds that nothing names: refused, and read with their unit. Whole ones are reported.
    let unnamed = with("", &|_, c, t| format!("{c},{}", ns(t)));
    assert_error(
        read(unnamed.as_bytes(), None),
        Kind::Input,
        &["MHz, if times are in picoseconds", "`tag_unit`"],
    );
    assert_placed(&read(unnamed.as_bytes(), Some(1e-9)), 1.0, 0.02);
    let whole = with("", &|_, c, t| format!("{c},{}", t / 1000));
    assert_noted(&read(whole.as_bytes(), Some(1e-9)), "multiples of 1000 ps");
    let seconds = with("", &|_, c, t| format!("{c},0.{t:012}"));
    assert_error(read(seconds.as_bytes(), None), Kind::Input, &["at one time", "`tag_unit`"]);
    // A spreadsheet, other columns, another order.
    let excel = with("channel,time_ps\n", &|_, c, t| format!("{c},{:.6}E+09", t as f64 / 1e9));
    assert_error(read(excel.as_bytes(), None), Kind::Input, &["rounded to 1000 ps", "spreadsheet"]);
    let three = with("", &|_, c, t| format!("{c},7,{t}"));
    assert_error(read(three.as_bytes(), None), Kind::Input, &["3 columns have no names"]);
    let mut swapped = all.clone();
    (0..swapped.len() - 1).step_by(37).for_each(|i| swapped.swap(i, i + 1));
    let found = read(text(&swapped, |_, c, t| format!("{c},{t}")).as_bytes(), None);
    assert_placed(&found, 1.0, 0.02);
    assert_noted(&found, "tags were out of order and are put in order");
    let mut sorted = all.clone();
    sorted.sort_by_key(|tag| tag.0);
    assert_error(
        read(text(&sorted, |_, c, t| format!("{c},{t}")).as_bytes(), None),
        Kind::Input,
        &["not in the order of time", "sorted by channel"],
    );
}

#[test]
fn points_are_read_with_decimal_commas() {
    let (_folder, path) = place("points.csv");
    for text in ["\u{feff}x;y;z\n0,1;0,2;0\n0,3;0,2;0\n", "0,1 0,2 0\n0,3 0,2 0\n", "0.1, 0.2\n.3, 0.2\n"] {
        write(&path, text);
        let scan = Scan::read(&path).unwrap();
        assert_eq!((scan.points(), scan.laser[0].x, scan.laser[1].x), (2, 0.1, 0.3), "{text}");
    }
    write(&path, "0,15,0,25,0,10\n0,35,0,25,0,10\n");
    assert_error(Scan::read(&path), Kind::Input, &["six whole numbers", "semicolons"]);
}

/// Histograms of the photons in bins of 32 ticks, `[point][bin]`, points row by row.
fn stored() -> Vec<Vec<u32>> {
    let mut all = vec![vec![0; 300]; SIDE * SIDE];
    photons().iter().for_each(|p| all[p.y * SIDE + p.x][(p.delay / BIN) as usize] += 1);
    all
}

fn check_stored(path: &Path, bytes: impl AsRef<[u8]>, says_width: bool) {
    write(path, bytes);
    assert_placed(&histogram(path, &grid(), &asked(None)), 1.0, 0.0);
    let unsaid = histogram(path, &grid(), &Asked { bin_width: None, ..asked(None) });
    match says_width {
        true => assert_placed(&unsaid, 1.0, 0.0),
        false => assert_error(unsaid, Kind::Options, &["how wide its bins", "`bin_width`"]),
    }
}

#[test]
fn histograms_of_instruments_are_read() {
    let (_folder, path) = place("made.dat");
    let all = stored();
    let width = BIN as f64 * TICK;
    let rows = |separator: &str, head: &dyn Fn(usize) -> String| {
        (0..300).fold(String::new(), |mut text, bin| {
            let counts: Vec<String> = all.iter().map(|point| point[bin].to_string()).collect();
            writeln!(text, "{}{}", head(bin), counts.join(separator)).unwrap();
            text
        })
    };
    let ns = vec![format!("{:.4}", 1e9 * width); all.len()].join("\t");
    let head = "#PicoHarp 300  Histogram Data\n#channels per curve\n300\n#memory block no.\n0\t1\n#ns/bin\n";
    check_stored(&path, format!("{head}{ns}\n#counts\n{}", rows("\t", &|_| String::new())), true);
    let names: Vec<String> = (0..all.len()).map(|i| format!("Untitled {i}")).collect();
    let head = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\nChannels\t64\nDelta_X\t";
    let of_time = |bin: usize| format!("{:.6E}\t", bin as f64 * width);
    let table = format!("X_Value\t{}\tComment\n{}", names.join("\t"), rows("\t", &of_time));
    check_stored(&path, format!("{head}{width:E}\n***End_of_Header***\t\n{table}"), true);
    check_stored(&path, rows(",", &|_| String::new()), false);
    check_stored(&path, rows("  ", &|_| String::new()), false);
    check_stored(&path, rows(";", &|bin| format!("{bin};")), false);
    check_stored(
        &path,
        all.iter().fold(String::new(), |text, p| format!("{text}{p:?}\n")).replace(['[', ']'], ""),
        false,
    );
    check_stored(&path, phu(&all, width), true);
    // Two readings of the zones of a sensor, and the bytes of three channels one after the other.
    let line = |zone: usize, counts: &[u32]| {
        let counts: Vec<String> = counts.iter().take(128).map(u32::to_string).collect();
        format!("#Raw,{zone},{}\n", counts.join(","))
    };
    let zones: String =
        (0..2).flat_map(|_| all.iter().enumerate().map(|(zone, p)| line(zone, &p[20..]))).collect();
    write(&path, &zones);
    let found = histogram(&path, &grid(), &asked(None)).unwrap();
    let wanted: u32 = all.iter().map(|p| 2 * p[20..148].iter().sum::<u32>()).sum();
    assert_eq!((found.photons, found.capture.bins), (u64::from(wanted), 128));
    let byte = |zone: usize| -> Vec<u32> {
        (0..128).map(|bin| ((1000 * (zone % 10) + bin) >> (8 * (zone / 10))) as u32 & 255).collect()
    };
    write(&path, (0..30).map(|zone| line(zone, &byte(zone))).collect::<String>());
    let nine = Scan::grid([3, 3], 1.0, false).unwrap();
    let found = histogram(&path, &nine, &asked(None)).unwrap();
    assert_eq!(
        found.photons,
        (1..10).map(|zone| (0..128).map(|bin| 1000 * zone + bin).sum::<u64>()).sum::<u64>()
    );
    assert!(found.notes.iter().any(|note| note.contains("reference")), "{:?}", found.notes);
    assert_error(
        histogram(&path, &grid(), &asked(None)),
        Kind::Input,
        &["#Raw lines", "does not fit 64 points"],
    );
}

#[test]
fn photon_hdf5_is_read() {
    let (_folder, path) = place("made.h5");
    let all = in_time(along);
    let column = |name: &str, of: &dyn Fn(&(i64, i64)) -> i64| {
        vector(name, &all.iter().map(|p| of(p) as f64).collect::<Vec<_>>())
    };
    let mut times = column("photon_data/timestamps", &|p| p.0);
    let mut delays = column("photon_data/nanotimes", &|p| p.1);
    (times.dims, delays.dims) = (vec![all.len()], vec![all.len()]);
    hdf5(
        &path,
        &[
            times,
            delays,
            scalar("photon_data/timestamps_unit", PERIOD),
            scalar("photon_data/tcspc_unit", TICK),
        ],
    );
    let by = asked(Some(Division::Pulses { each: PULSES as u64, before: 0 }));
    let found = histogram(&path, &grid(), &by);
    assert_placed(&found, 1.0, 0.0);
    assert_eq!(found.unwrap().instrument, "Photon-HDF5");
}
