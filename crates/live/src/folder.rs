//! Frames as captures that appear in a folder.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use super::stream::{Arrived, FrameCounts, begin as begin_thread};
use thirdbounce::capture::formats::variables::Variables;
use thirdbounce::capture::formats::{Opened, ReadOptions};
use thirdbounce::capture::{self, Capture};
use thirdbounce::files::archive::Npz;
use thirdbounce::files::stamp::Stamp;
use thirdbounce::glam::DVec3;
use thirdbounce::{Error, Result};
use thirdbounce_command::found::{is_capture, is_capture_file, paths_in, stem};

/// Time between two looks at the folder.
const BETWEEN: Duration = Duration::from_millis(20);

/// A file that is incomplete may still be written, and one that is no capture be renamed: both are given up after this time without
/// a change.
const STILL: Duration = Duration::from_secs(2);

/// Files of a folder within the folder whose stamps are compared.
const MOST_STAMPS: usize = 64;

/// A folder in which captures of a scan appear.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameFolder {
    folder: PathBuf,
    /// Points and bins of all frames.
    scan: Capture,
    reading: ReadOptions,
    /// Frames that are left out.
    left_out: BTreeSet<PathBuf>,
}

impl FrameFolder {
    /// Files that are there now are frames, too, unless `new_only`.
    ///
    /// # Errors
    /// No such folder.
    pub fn new(folder: &Path, scan: &Capture, reading: ReadOptions, new_only: bool) -> Result<FrameFolder> {
        let there = entries(folder).map_err(|e| {
            let hint = "give a folder in which captures appear, or - for a stream on the standard input";
            Error::input(format!("{} is no folder that can be read: {e}", folder.display()), hint)
        })?;
        let left_out = there.into_iter().filter(|path| new_only && is_frame(path)).collect();
        Ok(FrameFolder { folder: folder.into(), scan: scan.outline(), reading, left_out })
    }
}

/// The file's stamp, or those of the files of a capture of several.
type Stamps = Vec<Option<Stamp>>;

/// What was found at a path.
enum FileState {
    /// A frame.
    Frame,
    /// Incomplete, or no capture, and unchanged since.
    Waiting(Stamps, Instant),
    /// Failed, or no capture: looked at again when it changes.
    GivenUp(Stamps),
}

struct FolderWatch {
    frames: FrameFolder,
    seen: BTreeMap<PathBuf, FileState>,
    number: u64,
}

/// Begins to look at a folder.
pub(super) fn begin(frames: FrameFolder, give: SyncSender<Arrived>) -> Result<()> {
    begin_thread(move || {
        let seen = frames.left_out.iter().map(|path| (path.clone(), FileState::Frame)).collect();
        let mut heard = give.send(Arrived::Skipped(frames.left_out.len() as u64));
        let mut watch = FolderWatch { frames, seen, number: 0 };
        while heard.is_ok() {
            let mut others = vec![];
            for path in entries(&watch.frames.folder).unwrap_or_default() {
                match watch.look(&path) {
                    Some(Arrived::Others(names)) => others.extend(names),
                    Some(arrived) => heard = heard.and_then(|()| give.send(arrived)),
                    None => {}
                }
            }
            if !others.is_empty() {
                heard = heard.and_then(|()| give.send(Arrived::Others(others)));
            }
            std::thread::sleep(BETWEEN);
        }
    })
}

impl FolderWatch {
    /// What has come of a path since the last look.
    fn look(&mut self, path: &Path) -> Option<Arrived> {
        let seen = self.seen.get(path);
        if matches!(seen, Some(FileState::Frame)) {
            return None;
        }
        let stamps = stamps(path);
        let settled = match seen {
            Some(FileState::GivenUp(before)) if *before == stamps => return None,
            Some(FileState::Waiting(before, since)) if *before == stamps => {
                if since.elapsed() < STILL {
                    return None;
                }
                true
            }
            _ => false,
        };
        let read = is_frame(path).then(|| self.read(path));
        // What comes while a file is read is a change.
        let is_changed = self::stamps(path) != stamps;
        let (seen, arrived) = match read {
            Some(Ok((counts, warning))) if !is_changed => {
                self.number += 1;
                (FileState::Frame, Some(Arrived::Counts(stem(path), counts, warning)))
            }
            Some(Err(error)) if !is_changed && (settled || is_complete(path)) => {
                let place = format!("{}: ", path.display());
                let error = if error.what.starts_with(&place) { error } else { error.at(path.display()) };
                (FileState::GivenUp(stamps), Some(Arrived::Failed(Some(stem(path)), error)))
            }
            None if settled && !is_changed => {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                (FileState::GivenUp(stamps), Some(Arrived::Others(vec![name])))
            }
            _ => (FileState::Waiting(stamps, Instant::now()), None),
        };
        self.seen.insert(path.into(), seen);
        arrived
    }

    /// The counts of a frame, and what differs from the scan.
    fn read(&self, path: &Path) -> Result<(FrameCounts, Option<String>)> {
        let frame = read_frame(path, &self.frames.reading)?.capture;
        let (scan, number) = (&self.frames.scan, self.number);
        let warning = moved(scan, &frame);
        let differs = warning.is_some() || frame.pair_count() != scan.pair_count();
        let partial = differs.then(|| of_pairs(scan, &frame)).flatten();
        if let Some((values, measured)) = partial.filter(|(_, measured)| measured.contains(&false)) {
            let missing = measured.iter().filter(|measured| !**measured).count();
            let warning = format!(
                "{missing} of its {} pairs were not measured and keep earlier counts",
                measured.len()
            );
            return Ok((FrameCounts { frame: number, values, measured: Some(measured) }, Some(warning)));
        }
        let [pairs, bins] = [scan.pair_count(), scan.bins];
        if [frame.pair_count(), frame.bins] != [pairs, bins] {
            return Err(Error::input(
                format!(
                    "{} pairs of {} bins, the scan has {pairs} of {bins}",
                    frame.pair_count(),
                    frame.bins
                ),
                "let only frames of the scan appear in the folder",
            ));
        }
        Ok((FrameCounts { frame: number, values: frame.histograms, measured: None }, warning))
    }
}

/// Reads a capture with its notes, and scales its wall.
///
/// # Errors
/// Those of [`capture::read_given`].
pub fn read_frame(path: &Path, reading: &ReadOptions) -> Result<Opened> {
    let mut opened = capture::read_given(path, reading)?;
    reading.wall.map_or(Ok(()), |size| opened.capture.set_wall(size))?;
    Ok(opened)
}

/// How the points and bins of a frame differ from those of the scan: by more than half a bin, which is a bin of path there and back.
fn moved(scan: &Capture, frame: &Capture) -> Option<String> {
    let limit = scan.bin_width / 2.0;
    let apart = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let apart = apart(&scan.laser, &frame.laser).max(apart(&scan.sensor, &frame.sensor));
    let last = |c: &Capture| c.t_start + c.bin_width * c.bins as f64;
    let bins = [frame.t_start - scan.t_start, last(frame) - last(scan)].map(f64::abs);
    let what = if apart > limit {
        format!("its wall points are up to {:.1} mm from those of the scan", 1e3 * apart)
    } else if bins.iter().any(|off| *off > limit) {
        format!(
            "its bins are {:.3} mm wide from {:.4} m, those of the scan {:.3} mm from {:.4} m",
            1e3 * frame.bin_width,
            frame.t_start,
            1e3 * scan.bin_width,
            scan.t_start
        )
    } else {
        return None;
    };
    Some(format!(
        "{what}, with which it is solved. If the setup was moved, start again with a new capture of the scan"
    ))
}

/// The counts of the scan's pairs in a frame that lacks some, such as dead ones that the reader left out, and which it has; `None` where
/// most differ.
fn of_pairs(scan: &Capture, frame: &Capture) -> Option<(Vec<f32>, Vec<bool>)> {
    let key = |of: &Capture, p: usize| [of.laser[p], of.sensor[p]].map(|v| v.to_array().map(f64::to_bits));
    let places: HashMap<_, usize> = (0..frame.pair_count()).map(|p| (key(frame, p), p)).collect();
    let found: Vec<_> = (0..scan.pair_count()).map(|p| places.get(&key(scan, p)).copied()).collect();
    let measured: Vec<bool> = found.iter().map(Option::is_some).collect();
    let is_scan = frame.bins == scan.bins && 2 * measured.iter().filter(|m| **m).count() > measured.len();
    let dark = vec![0.0; scan.bins];
    let counts = found.iter().flat_map(|place| place.map_or(&dark[..], |p| frame.histogram(p)));
    is_scan.then(|| (counts.copied().collect(), measured))
}

/// What a folder holds, sorted, without hidden files.
fn entries(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut all = paths_in(folder)?;
    let is_hidden = |path: &PathBuf| path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
    all.retain(|path| !is_hidden(path));
    Ok(all)
}

fn is_frame(path: &Path) -> bool {
    if path.is_dir() { is_capture(path) } else { is_capture_file(path) }
}

/// The stamps of a path; none of a file that is no capture by its name.
fn stamps(path: &Path) -> Stamps {
    if !path.is_dir() {
        return if is_capture_file(path) { vec![Stamp::of(path)] } else { vec![] };
    }
    let inside = std::fs::read_dir(path).into_iter().flatten().flatten().take(MOST_STAMPS);
    let mut all: Stamps = inside.map(|entry| Stamp::of(&entry.path())).collect();
    all.sort();
    all
}

/// Whether the file was written to its end: its archive, or its list of arrays, is whole.
fn is_complete(path: &Path) -> bool {
    path.is_file() && (Npz::open(path).is_ok() || Variables::open(path).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_bin_of_wall_or_of_time_is_a_warning() {
        let points = || vec![DVec3::ZERO, DVec3::X];
        let scan = Capture::new([2, 1], points(), points(), 100, 0.01, vec![]);
        assert_eq!(moved(&scan, &scan), None);
        let changed = |change: &dyn Fn(&mut Capture)| {
            let mut frame = scan.clone();
            change(&mut frame);
            moved(&scan, &frame).unwrap_or_default()
        };
        assert_eq!(changed(&|frame| frame.sensor[1].y += 0.004), "");
        assert!(changed(&|frame| frame.sensor[1].y += 0.006).contains("wall points are up to 6.0 mm"));
        assert!(changed(&|frame| frame.t_start = 0.1).contains("10.000 mm wide from 0.1000 m"));
        assert!(changed(&|frame| frame.bin_width = 0.011).contains("11.000 mm wide"));
    }

    #[test]
    fn a_frame_without_a_dead_pair_has_the_others() {
        let points: Vec<DVec3> = (0..4).map(|i| DVec3::X * f64::from(i)).collect();
        let scan = Capture::new([4, 1], points.clone(), points, 2, 0.01, (0..8).map(|i| i as f32).collect());
        let frame = scan.keep(&[0, 1, 3], [3, 1]);
        let of_three = Some((vec![0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 6.0, 7.0], vec![true, true, false, true]));
        assert_eq!(of_pairs(&scan, &frame), of_three);
        assert_eq!(of_pairs(&scan, &scan.keep(&[0, 3], [2, 1])), None, "half of the pairs");
    }
}
