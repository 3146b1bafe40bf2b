//! Named arrays of numbers in a file of either kind: HDF5 (MATLAB v7.3 included) or MATLAB v5.
//!
//! Shapes are in C order, so MATLAB's dimensions are reversed in both: (y, x, t) in MATLAB is [t, x, y] here.

use std::path::Path;

use glam::DVec3;

use super::blocks;
use super::contents::{self, Contents};
use super::counts::Counts;
use super::hdf5::Hdf5;
use super::matlab5::Matlab5;
use super::scatter::{ArraySelection, Scattered};
use crate::error::{Error, Result};

/// How to fix an array in place of a number: bins may differ by pixel where a sensor has a table of their widths.
pub(super) fn one_width(name: &str) -> String {
    match name.rsplit('/').next().unwrap_or(name) {
        "delta_t" | "deltaT" | "deltat" | "ts" | "timeRes" | "bin_width" | "t_start" | "t0" => format!(
            "all pixels need the same bins: resample the histograms to one width and one start, and store {name} as a scalar"
        ),
        _ => format!("store {name} as a scalar"),
    }
}

/// The arrays of a file.
pub enum Variables {
    /// An HDF5 file, MATLAB v7.3 included.
    Hdf5(Hdf5),
    /// A MATLAB v5 file.
    Matlab5(Matlab5),
}

impl Variables {
    /// Opens a file of either kind; the contents tell which.
    ///
    /// # Errors
    /// `Kind::Input` for a damaged file or one of another kind.
    pub fn open(path: &Path) -> Result<Variables> {
        match contents::of(path)? {
            Contents::Hdf5 => Hdf5::open(path).map(Variables::Hdf5),
            Contents::Matlab5 => Matlab5::open(path).map(Variables::Matlab5),
            Contents::Matlab4 => Err(contents::version_4()),
            _ => Err(Error::input("is not an HDF5 or MATLAB file", "give the .mat or .hdf5 file")),
        }
    }

    /// Names of the arrays, sorted; fields of a struct or members of a group as `struct/field`.
    pub fn names(&self) -> Vec<String> {
        match self {
            Variables::Hdf5(file) => file.names(),
            Variables::Matlab5(file) => file.names(),
        }
    }

    /// Whether all these arrays are there, empty or not.
    pub fn have(&self, names: &[&str]) -> bool {
        let there = self.names();
        names.iter().all(|name| there.iter().any(|n| n == name))
    }

    /// The cell arrays of MATLAB, each with the shapes of its elements in C order.
    pub(super) fn cells(&self) -> Vec<(String, Vec<Vec<usize>>)> {
        match self {
            Variables::Hdf5(file) => file.cells(),
            Variables::Matlab5(file) => file.cells(),
        }
    }

    /// The shape of an array in C order, `None` if it is missing or empty.
    ///
    /// # Errors
    /// `Kind::Input` if it is damaged or claims an absurd size.
    pub fn shape(&self, name: &str) -> Result<Option<Vec<usize>>> {
        match self {
            Variables::Hdf5(file) => file.shape(name),
            Variables::Matlab5(file) => file.shape(name),
        }
    }

    /// A required array of counts.
    ///
    /// # Errors
    /// `Kind::Input` if it is missing, damaged, does not hold numbers, or claims an absurd size.
    pub fn counts(&self, name: &str) -> Result<Counts> {
        let counts = match self {
            Variables::Hdf5(file) => file.counts(name)?,
            Variables::Matlab5(file) => file.counts(name)?,
        };
        counts.ok_or_else(|| self.missing(name))
    }

    /// The shape of a required array of counts, which is not kept. So many values are in the file, or a file of its size
    /// may hold them. Counts that unpack to far more than the file are looked at: they hold a signal.
    ///
    /// # Errors
    /// As [`Variables::counts`], as far as the values do not matter.
    pub(super) fn counts_shape(&self, name: &str) -> Result<Vec<usize>> {
        let shape = match self {
            Variables::Hdf5(file) => match file.array(name)? {
                Some(array) => {
                    if file.is_looked_at(&array) {
                        blocks::look(file, &array)?;
                    }
                    Some(array.shape)
                }
                None => None,
            },
            Variables::Matlab5(file) => file.counts_shape(name)?,
        };
        shape.ok_or_else(|| self.missing(name))
    }

    /// The wanted pairs and bins of a required array [T, ...] of counts, which is read part by part. `wanted.stored` is
    /// of its shape.
    ///
    /// # Errors
    /// As [`Variables::counts`].
    pub(super) fn scatter(&self, name: &str, wanted: &ArraySelection) -> Result<Scattered> {
        let scattered = match self {
            Variables::Hdf5(file) => {
                file.array(name)?.map(|array| blocks::read(file, &array, wanted)).transpose()?
            }
            Variables::Matlab5(file) => file.scatter(name, wanted)?,
        };
        scattered.ok_or_else(|| self.missing(name))
    }

    /// The shape and the numbers of an array in C order, `None` if it is missing or empty.
    ///
    /// # Errors
    /// `Kind::Input` if it is damaged, does not hold numbers, or claims an absurd size.
    pub fn numbers(&self, name: &str) -> Result<Option<(Vec<usize>, Vec<f64>)>> {
        match self {
            Variables::Hdf5(file) => file.numbers(name),
            Variables::Matlab5(file) => file.numbers(name),
        }
    }

    /// Whether shapes are those of MATLAB reversed: in MATLAB's files, and in files named as they are.
    pub fn in_matlab_order(&self) -> bool {
        match self {
            Variables::Hdf5(file) => file.in_matlab_order(),
            Variables::Matlab5(_) => true,
        }
    }

    /// The sums of a required array of three axes along each of them, over the others. A part is in memory at a time.
    ///
    /// # Errors
    /// As [`Variables::counts`].
    pub(super) fn profiles(&self, name: &str) -> Result<[Vec<f64>; 3]> {
        let shape = self.shape(name)?.ok_or_else(|| self.missing(name))?;
        let [a, b, c] = shape[..] else { return Err(self.missing(name)) };
        let mut sums = [vec![0.0; a], vec![0.0; b], vec![0.0; c]]; // bounded: the sides of an array that was checked
        let mut add = |[i, j, k]: [usize; 3], value: f32| {
            if value.is_finite() {
                sums.iter_mut().zip([i, j, k]).for_each(|(sum, at)| sum[at] += f64::from(value));
            }
        };
        match self {
            Variables::Hdf5(file) => {
                let array = file.array(name)?.ok_or_else(|| self.missing(name))?;
                blocks::visit(file, &array, &mut add)?;
            }
            Variables::Matlab5(file) => {
                file.visit(name, &mut |at, value| add([at / (b * c), at / c % b, at % c], value))?
            }
        }
        Ok(sums)
    }

    /// The only number of an array; `None` if it is missing or empty.
    ///
    /// # Errors
    /// As [`Variables::numbers`], or if it holds more than one number.
    pub fn number(&self, name: &str) -> Result<Option<f64>> {
        match self.numbers(name)? {
            None => Ok(None),
            Some((_, values)) if values.len() == 1 => Ok(Some(values[0])),
            Some((shape, _)) => {
                Err(Error::input(format!("{name} has shape {shape:?}, not a single number"), one_width(name)))
            }
        }
    }

    /// A single point (x, y, z), `None` if it is missing or empty.
    ///
    /// # Errors
    /// As [`Variables::numbers`], or if it does not hold 3 numbers.
    pub fn point(&self, name: &str) -> Result<Option<DVec3>> {
        match self.numbers(name)? {
            None => Ok(None),
            Some((_, values)) if values.len() == 3 => Ok(Some(DVec3::new(values[0], values[1], values[2]))),
            Some((shape, _)) => Err(Error::input(
                format!("{name} has shape {shape:?}, not one point x, y, z"),
                format!("store {name} as 3 numbers in metres"),
            )),
        }
    }

    /// The error of a missing array.
    pub fn missing(&self, name: &str) -> Error {
        let there = self.names();
        let there = if there.is_empty() { "nothing".to_string() } else { there.join(", ") };
        Error::input(
            format!("there is no array {name}, or it is empty (the file holds {there})"),
            "check that the right file was given, or store the array",
        )
    }
}
