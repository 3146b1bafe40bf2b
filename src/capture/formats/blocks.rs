//! Reads a large HDF5 array block by block, on several threads. A block is made of whole chunks, so no chunk is decoded
//! twice.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use super::hdf5::{Array, Hdf5, guarded};
use super::scatter::{Part, Result as Filled, Scattered, Wanted};
use crate::error::Result;

/// Values of all blocks in work at a time, unless a chunk is larger. They take up to 20 bytes each while they are
/// decoded.
const AT_ONCE: usize = 4 << 20;
/// More threads would wait for the disk, and each needs a block.
const MOST_THREADS: usize = 8;
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
pub fn read(file: &Hdf5, array: &Array, wanted: &Wanted) -> Result<Scattered> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(MOST_THREADS);
    let cut = Cut::of(array, AT_ONCE / threads);
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

impl Cut {
    /// Blocks of whole chunks with about `most` values, at least one chunk.
    fn of(array: &Array, most: usize) -> Cut {
        let shape = array.shape.clone();
        let mut block: Vec<usize> = match &array.chunk {
            Some(chunk) => chunk.iter().zip(&shape).map(|(c, s)| *c.min(s)).collect(),
            None => vec![1; shape.len()],
        };
        let step = block.clone();
        // Chunks one after the other along the bins fill a block without being cut up, and a histogram at once. Values
        // without chunks are read in their order.
        let last_first = (1..shape.len()).rev();
        let axes: Vec<usize> = match array.chunk {
            Some(_) => std::iter::once(0).chain(last_first).collect(),
            None => last_first.chain([0]).collect(),
        };
        for axis in axes {
            let room = most / block.iter().product::<usize>().max(1);
            block[axis] = (step[axis] * room.max(1)).min(shape[axis]);
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
        let mut places = vec![0];
        for (range, length) in self.ranges(cell).into_iter().zip(&self.shape[1..]) {
            places = places.into_iter().flat_map(|p| range.clone().map(move |i| p * length + i)).collect();
        }
        places
    }

    /// Reads the blocks of a part.
    fn fill(&self, file: &Hdf5, array: &Array, mut part: Part) -> Result<Filled> {
        let ranges = self.ranges(part.index / self.cuts());
        for first in part.bins.clone().step_by(self.block[0]) {
            let bins = first..(first + self.block[0]).min(part.bins.end);
            let (starts, counts): (Vec<usize>, Vec<usize>) =
                std::iter::once(&bins).chain(&ranges).map(|r| (r.start, r.len())).unzip();
            part.take(first, &file.block(array, &starts, &counts)?, array.integer());
        }
        Ok(part.finish())
    }
}
