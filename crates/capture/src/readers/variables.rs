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
use super::scatter::{Scattered, Wanted};
use crate::error::{Error, Result};

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
    pub(super) fn scatter(&self, name: &str, wanted: &Wanted) -> Result<Scattered> {
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

    /// The only number of an array; `None` if it is missing or empty.
    ///
    /// # Errors
    /// As [`Variables::numbers`], or if it holds more than one number.
    pub fn number(&self, name: &str) -> Result<Option<f64>> {
        match self.numbers(name)? {
            None => Ok(None),
            Some((_, values)) if values.len() == 1 => Ok(Some(values[0])),
            Some((shape, _)) => Err(Error::input(
                format!("{name} has shape {shape:?}, not a single number"),
                format!("store {name} as a scalar"),
            )),
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
