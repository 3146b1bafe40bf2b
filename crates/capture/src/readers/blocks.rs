//! Reads a large HDF5 array block by block, on several threads. A block is made of whole chunks, so no chunk is decoded
//! twice.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use super::glance::{self, Glance};
use super::hdf5::{Hdf5, Hdf5Array, guarded};
use super::scatter::{ArrayPart, ArraySelection, Filled, Scattered};
use crate::error::Result;

/// Values of all blocks in work at a time, unless a chunk is larger: at most, and at least. They take up to 20 bytes each
/// while they are decoded.
const AT_ONCE: [usize; 2] = [4 << 20, 256 << 10];
/// Between these bounds, blocks are this part of what is kept, so that they add little to its memory.
const OF_KEPT: usize = 16;
/// More threads would wait for the disk, and each needs a block.
const MOST_THREADS: usize = 8;
/// A block grows along one more axis only by this factor or more, as that makes its runs shorter.
const WORTH: usize = 4;
/// The bins are cut into several parts where the places alone make fewer parts than this.
const PARTS: usize = 4;

/// How an array [T, ...] is cut into blocks.
struct Cut {
    shape: Vec<usize>,
    /// Shape of a block; blocks at the end may be smaller.
    block: Vec<usize>,
}

/// Reads the wanted pairs and bins of an array.
///
/// # Errors
/// `Kind::Input` if a part of the array is damaged.
pub(super) fn read(file: &Hdf5, array: &Hdf5Array, wanted: &ArraySelection) -> Result<Scattered> {
    let threads = rayon::current_num_threads().min(MOST_THREADS);
    let [most, least] = AT_ONCE;
    let kept = wanted.from.len() * wanted.bins.len();
    read_with(file, array, wanted, threads, (kept / OF_KEPT).clamp(least, most))
}

/// Reads as [`read`] does, on at most this many threads, with `at_once` values in work.
fn read_with(
    file: &Hdf5,
    array: &Hdf5Array,
    wanted: &ArraySelection,
    threads: usize,
    at_once: usize,
) -> Result<Scattered> {
    let cut = Cut::of(array, at_once / threads);
    wanted.scatter(cut.parts(), |parts| {
        let threads = threads.min(parts.len());
        let queue = Mutex::new(parts.into_iter());
        let failed = AtomicBool::new(false);
        let next = || {
            let part = queue.lock().unwrap_or_else(|e| e.into_inner()).next();
            part.filter(|_| !failed.load(Ordering::Relaxed))
        };
        let work = |file: &Hdf5| {
            let mut filled = Vec::new();
            while let Some(part) = next() {
                let done = guarded(|| cut.fill(file, array, part));
                failed.fetch_or(done.is_err(), Ordering::Relaxed);
                filled.push(done?);
            }
            Ok(filled)
        };
        if threads == 1 {
            return work(file);
        }
        let path = file.path();
        let all: Result<Vec<Vec<Filled>>> = thread::scope(|scope| {
            // An open file serves one thread only, so each opens it.
            let threads = (0..threads).map(|_| scope.spawn(|| work(&Hdf5::open(path)?)));
            let threads: Vec<_> = threads.collect();
            let lost = || Err(super::hdf5::damaged("a thread that read it ended early"));
            threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| lost())).collect()
        });
        Ok(all?.into_iter().flatten().collect())
    })
}

/// Looks at all counts of an array, of which only a block is in memory at a time.
///
/// # Errors
/// `Kind::Input` if a part of the array is damaged, or if there is no signal.
pub(super) fn look(file: &Hdf5, array: &Hdf5Array) -> Result<()> {
    let mut glance = Glance::default();
    parts(file, array, &mut |_, counts| glance.take(counts))?;
    glance.finish(&array.name)
}

/// Calls `visit` with every value of an array of three axes, and its place along each.
///
/// # Errors
/// `Kind::Input` if a part of the array is damaged.
pub(super) fn visit(file: &Hdf5, array: &Hdf5Array, visit: &mut dyn FnMut([usize; 3], f32)) -> Result<()> {
    parts(file, array, &mut |ranges, counts| {
        let [first, rows, columns] = ranges else { return };
        let inner = rows.len() * columns.len();
        for (at, value) in counts.iter().enumerate() {
            let place = [
                first.start + at / inner,
                rows.start + at % inner / columns.len(),
                columns.start + at % columns.len(),
            ];
            visit(place, *value);
        }
    })
}

/// Receives the counts of a block, and where it lies along each axis.
type Take<'t> = dyn FnMut(&[Range<usize>], &[f32]) + 't;

/// Calls `take` with all counts of an array, of which only a block is in memory at a time, and where the block lies.
fn parts(file: &Hdf5, array: &Hdf5Array, take: &mut Take) -> Result<()> {
    let cut = Cut::of(array, glance::AT_ONCE);
    let wide: usize = (1..cut.shape.len()).map(|axis| cut.cells(axis)).product();
    for cell in 0..wide {
        let ranges = cut.ranges(cell);
        for bins in (0..cut.cells(0)).map(|cell| cut.range(0, cell)) {
            let counts = cut.block(file, array, &bins, &ranges)?;
            let all: Vec<_> = std::iter::once(bins).chain(ranges.iter().cloned()).collect();
            take(&all, &counts);
        }
    }
    Ok(())
}

impl Cut {
    /// Blocks of whole chunks with about `most` values, at least one chunk.
    fn of(array: &Hdf5Array, most: usize) -> Cut {
        let shape = array.shape.clone();
        let mut block: Vec<usize> = match &array.chunk {
            Some(chunk) => chunk.iter().zip(&shape).map(|(c, s)| *c.min(s)).collect(),
            None => vec![1; shape.len()],
        };
        let step = block.clone();
        // Chunks one after the other along the bins fill a block without being cut up, and then along the slowest axes
        // in the longest runs. Values without chunks are read in their order.
        let axes: Vec<usize> = match array.chunk {
            Some(_) => (0..shape.len()).collect(),
            None => (0..shape.len()).rev().collect(),
        };
        for axis in axes {
            let room = most / block.iter().product::<usize>();
            if room >= WORTH {
                block[axis] = (step[axis] * room).min(shape[axis]);
            }
        }
        Cut { shape, block }
    }

    /// The cells of an axis.
    fn cells(&self, axis: usize) -> usize {
        self.shape[axis].div_ceil(self.block[axis])
    }

    /// The range of a cell of an axis.
    fn range(&self, axis: usize, cell: usize) -> Range<usize> {
        let from = cell * self.block[axis];
        from..(from + self.block[axis]).min(self.shape[axis])
    }

    /// Into how many parts the bins are cut.
    fn cuts(&self) -> usize {
        let wide: usize = (1..self.shape.len()).map(|axis| self.cells(axis)).product();
        PARTS.div_ceil(wide).min(self.cells(0))
    }

    /// The parts of the array: ranges of bins, and places. A part is one block wide and as many long as its bins take.
    fn parts(&self) -> Vec<(Range<usize>, Vec<usize>)> {
        let (long, cuts) = (self.cells(0), self.cuts());
        let wide: usize = (1..self.shape.len()).map(|axis| self.cells(axis)).product();
        let bins = |cut: usize| {
            let [from, to] = [cut, cut + 1].map(|c| c * long / cuts * self.block[0]);
            from..to.min(self.shape[0])
        };
        (0..wide * cuts).map(|part| (bins(part % cuts), self.places(part / cuts))).collect()
    }

    /// The ranges of a cell along the axes behind the first.
    fn ranges(&self, mut cell: usize) -> Vec<Range<usize>> {
        let mut ranges: Vec<Range<usize>> = (1..self.shape.len())
            .rev()
            .map(|axis| {
                let at = cell % self.cells(axis);
                cell /= self.cells(axis);
                self.range(axis, at)
            })
            .collect();
        ranges.reverse();
        ranges
    }

    /// The places of a cell, in the order of its values.
    fn places(&self, cell: usize) -> Vec<usize> {
        let mut places = vec![0]; // bounded: one element
        for (range, length) in self.ranges(cell).into_iter().zip(&self.shape[1..]) {
            places = places.into_iter().flat_map(|p| range.clone().map(move |i| p * length + i)).collect();
        }
        places
    }

    /// Reads the blocks of a part.
    fn fill(&self, file: &Hdf5, array: &Hdf5Array, mut part: ArrayPart) -> Result<Filled> {
        let ranges = self.ranges(part.index / self.cuts());
        for first in part.bins.clone().step_by(self.block[0]) {
            let bins = first..(first + self.block[0]).min(part.bins.end);
            part.take(first, &self.block(file, array, &bins, &ranges)?);
        }
        Ok(part.finish())
    }

    /// Reads these bins of a cell.
    fn block(
        &self,
        file: &Hdf5,
        array: &Hdf5Array,
        bins: &Range<usize>,
        ranges: &[Range<usize>],
    ) -> Result<Vec<f32>> {
        let (starts, counts): (Vec<usize>, Vec<usize>) =
            std::iter::once(bins).chain(ranges).map(|r| (r.start, r.len())).unzip();
        file.block(array, &starts, &counts)
    }
}

#[cfg(test)]
#[allow(dead_code)]
#[path = "../../../../tests/fixtures/src/originals.rs"]
mod originals;

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::originals::{Cube, Kind, write};

    use super::super::scatter::Shifts;
    use super::*;
    use crate::data::histogram_figures::HistogramFigures;

    /// Bins, d2 and d1: no chunk divides them all.
    const SHAPE: [usize; 3] = [37, 10, 13];
    const PLACES: usize = SHAPE[1] * SHAPE[2];

    fn value([bin, d2, d1]: [usize; 3]) -> f64 {
        match (bin * 31 + d2 * 7 + d1 * 3) % 11 {
            0 if d2 == 4 && d1 == 5 => f64::NAN,
            n if d2 == 2 && d1 == 3 => n as f64 - 9.0,
            n => n as f64,
        }
    }

    fn histogram(place: usize) -> Vec<f32> {
        (0..SHAPE[0]).map(|bin| value([bin, place / SHAPE[2], place % SHAPE[2]]) as f32).collect()
    }

    fn made(folder: &tempfile::TempDir, chunk: [usize; 3], kind: Kind) -> (PathBuf, Hdf5, Hdf5Array) {
        let path = folder.path().join("made.mat");
        write(&path, &Cube { name: "a", shape: SHAPE, chunk, kind, repeat: usize::MAX }, &value, &[]);
        let file = Hdf5::open(&path).unwrap();
        let array = file.array("a").unwrap().unwrap();
        (path, file, array)
    }

    const CHUNKS: [[usize; 3]; 6] = [[0; 3], [8, 4, 4], [37, 2, 1], [3, 10, 13], [37, 10, 13], [1, 3, 1]];

    /// Threads and values at once.
    const WORK: [(usize, usize); 5] = [(1, 1), (1, 1 << 20), (2, 100), (3, 1500), (4, 1 << 20)];

    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    #[test]
    fn blocks_of_any_shape_give_the_same_histograms() {
        let folder = tempfile::tempdir().unwrap();
        // Every third place, backwards; shifts from none to all bins; a place that was not measured.
        let from: Vec<usize> = (0..PLACES).rev().step_by(3).collect();
        let of_place: Vec<_> = (0..PLACES).map(|p| (p != from[4]).then_some(p % SHAPE[0])).collect();
        let shifts = Shifts { of_place, bins: 20, note: |_, _| None };
        let shifted = |place: usize| -> Vec<f32> {
            let Some(shift) = shifts.of_place[place] else { return vec![f32::NAN; 20] };
            let stored = histogram(place);
            (shift..shift + 20).map(|bin| stored.get(bin).copied().unwrap_or(0.0)).collect()
        };
        for (chunk, kind) in CHUNKS.iter().flat_map(|c| [(*c, Kind::Single), (*c, Kind::Double)]) {
            let (_, file, array) = made(&folder, chunk, kind);
            for ((threads, at_once), shifts) in WORK.iter().flat_map(|w| [(*w, None), (*w, Some(&shifts))]) {
                let what = format!("{chunk:?} {kind:?}, {threads} threads, {at_once} at once");
                let bins = if shifts.is_some() { 2..17 } else { 5..36 };
                let wanted =
                    ArraySelection { stored: [SHAPE[0], PLACES], from: &from, bins: bins.clone(), shifts };
                let read = read_with(&file, &array, &wanted, threads, at_once).unwrap();
                let all: Vec<Vec<f32>> = (0..PLACES)
                    .map(|place| if shifts.is_some() { shifted(place) } else { histogram(place) })
                    .collect();
                let kept: Vec<f32> = from.iter().flat_map(|p| all[*p][bins.clone()].to_vec()).collect();
                assert_eq!(bits(&read.histograms), bits(&kept), "{what}");
                for (place, seen) in read.seen.iter().enumerate() {
                    assert_eq!(
                        format!("{seen:?}"),
                        format!("{:?}", HistogramFigures::of(&all[place])),
                        "{what}: {place}"
                    );
                }
                assert!(!read.whole, "{what}: one histogram has negative counts");
                let late = |p: usize| -> f64 {
                    let Some(shift) = shifts.and_then(|s| s.of_place[p]) else { return 0.0 };
                    histogram(p).iter().skip(shift + 20).map(|v| f64::from(*v)).sum()
                };
                let late: f64 = (0..PLACES).map(late).sum();
                assert_eq!(read.late.to_bits(), late.to_bits(), "{what}");
            }
        }
    }

    #[test]
    fn integers_are_counts_and_what_is_damaged_is_one_error() {
        let folder = tempfile::tempdir().unwrap();
        let from: Vec<usize> = (0..PLACES).collect();
        let wanted =
            ArraySelection { stored: [SHAPE[0], PLACES], from: &from, bins: 0..SHAPE[0], shifts: None };
        for chunk in CHUNKS {
            let (path, file, array) = made(&folder, chunk, Kind::Counts);
            let good = read_with(&file, &array, &wanted, 2, 100).unwrap();
            assert!(good.whole, "{chunk:?}");
            assert_eq!(good.histograms[5], value([5, 0, 0]) as f32, "{chunk:?}");
            if chunk == [0; 3] {
                continue;
            }
            // A chunk in the middle of the file.
            let mut bytes = std::fs::read(&path).unwrap();
            let begin = |at: &usize| bytes[*at..].starts_with(&[0x78, 0x5e]);
            let begins: Vec<usize> = (600..bytes.len() - 2).filter(begin).collect();
            let middle = begins[begins.len() / 2];
            bytes[middle + 2..middle + 6].fill(0xff);
            std::fs::write(&path, bytes).unwrap();
            for (threads, at_once) in WORK {
                let file = Hdf5::open(&path).unwrap();
                let error = read_with(&file, &array, &wanted, threads, at_once).err().expect("damage");
                assert_eq!(error.kind, crate::error::Kind::Input);
                assert!(error.what.contains("dataset a") && error.what.contains("cannot be read"), "{error}");
            }
        }
    }

    #[test]
    fn parts_hold_every_value_once() {
        let folder = tempfile::tempdir().unwrap();
        for chunk in CHUNKS {
            let (_, _, array) = made(&folder, chunk, Kind::Single);
            for most in [1, 7, 60, 400, 3000, 1 << 20] {
                let mut held = vec![0; SHAPE.iter().product()];
                for (bins, places) in Cut::of(&array, most).parts() {
                    assert!(!bins.is_empty(), "{chunk:?}, {most}");
                    bins.for_each(|bin| places.iter().for_each(|place| held[bin * PLACES + place] += 1));
                }
                assert!(held.iter().all(|n| *n == 1), "{chunk:?}, {most}");
            }
        }
    }
}
