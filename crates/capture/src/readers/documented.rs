//! Arrays under documented names (docs/data.md), in an npz, HDF5 or MATLAB file, with the axes of the documentation.
//!
//! MATLAB stores the first index fastest, HDF5 the last. An array of points has x, y, z as its last documented axis, which
//! shows the order of a file.

use std::cell::RefCell;

use super::counts;
use super::listed::axis_of_xyz;
use super::variables::{Variables, one_width};
use crate::data::histogram_figures;
use crate::error::{Error, Result};
use crate::files::archive::Npz;
use crate::files::array::{c_order, transpose};
use crate::host;

/// Arrays of a file by their documented names.
pub(super) struct Documented<'f> {
    file: Container<'f>,
    /// The names that are read, for the error of a missing one.
    wanted: &'static str,
}

enum Container<'f> {
    Npz(RefCell<Npz>),
    /// A file, and whether its axes are in the opposite order.
    Variables(&'f Variables, bool),
}

impl<'f> Documented<'f> {
    pub(super) fn of_npz(npz: Npz, wanted: &'static str) -> Documented<'f> {
        Documented { file: Container::Npz(RefCell::new(npz)), wanted }
    }

    /// The arrays of an HDF5 or MATLAB file; `points`: names of arrays of points, which show the order of the axes.
    pub(super) fn of_file(
        file: &'f Variables,
        points: &[&str],
        wanted: &'static str,
    ) -> Result<Documented<'f>> {
        let mut reversed = None;
        for name in points {
            let shape = file.shape(name)?.filter(|shape| shape.len() > 1);
            let is_clear = |shape: &Vec<usize>| (shape[0] == 3) != (shape[shape.len() - 1] == 3);
            reversed = reversed.or(shape.filter(is_clear).map(|shape| axis_of_xyz(file, &shape) == Some(0)));
        }
        let reversed = reversed.unwrap_or_else(|| file.in_matlab_order());
        Ok(Documented { file: Container::Variables(file, reversed), wanted })
    }

    pub(super) fn is_npz(&self) -> bool {
        matches!(self.file, Container::Npz(_))
    }

    /// Shape and numbers of an array in C order; `None` if it is missing, empty or a Python object.
    pub(super) fn numbers(&self, name: &str) -> Result<Option<(Vec<usize>, Vec<f64>)>> {
        match &self.file {
            Container::Npz(npz) if npz.borrow_mut().is_object(name) => Ok(None),
            Container::Npz(npz) => {
                Ok(npz.borrow_mut().get(name)?.map(|array| (array.shape.clone(), array.to_f64())))
            }
            Container::Variables(file, reversed) => Ok(match file.numbers(name)? {
                Some((shape, values)) if *reversed => {
                    let shape: Vec<usize> = shape.into_iter().rev().collect();
                    let values = host::collected(name, values.len(), c_order(&shape).map(|at| values[at]))?;
                    Some((shape, values))
                }
                found => found,
            }),
        }
    }

    /// Shape and numbers of a required array in C order.
    pub(super) fn require(&self, name: &str) -> Result<(Vec<usize>, Vec<f64>)> {
        self.numbers(name)?.ok_or_else(|| self.missing(name))
    }

    /// The only number of an array; `None` if it is missing, empty or a Python object.
    pub(super) fn number(&self, name: &str) -> Result<Option<f64>> {
        let Some((shape, values)) = self.numbers(name)? else { return Ok(None) };
        match values[..] {
            [value] => Ok(Some(value)),
            _ => {
                Err(Error::input(format!("{name} has shape {shape:?}, not a single number"), one_width(name)))
            }
        }
    }

    /// The shape of a required array of counts, which are not kept.
    pub(super) fn counts_shape(&self, name: &str) -> Result<Vec<usize>> {
        match &self.file {
            Container::Npz(npz) => counts::shape(&mut npz.borrow_mut(), name, self.wanted),
            Container::Variables(file, _) if !file.have(&[name]) => Err(self.missing(name)),
            Container::Variables(file, reversed) => {
                let mut shape = file.counts_shape(name)?;
                if *reversed {
                    shape.reverse();
                }
                Ok(shape)
            }
        }
    }

    /// The values of a required array of counts in C order.
    pub(super) fn counts(&self, name: &str) -> Result<Vec<f32>> {
        match &self.file {
            Container::Npz(npz) => counts::read(&mut npz.borrow_mut(), name, self.wanted),
            Container::Variables(file, reversed) => {
                let counts = file.counts(name)?;
                if !*reversed {
                    return Ok(counts.values);
                }
                let shape: Vec<usize> = counts.shape.iter().rev().copied().collect();
                let all = c_order(&shape).map(|at| counts.values[at]);
                host::collected("the counts", counts.values.len(), all)
            }
        }
    }

    /// The histograms `[pair * bins + bin]` of a required array [T, ...] of counts, and whether all are photon counts.
    pub(super) fn histograms(&self, name: &str, [bins, pairs]: [usize; 2]) -> Result<(Vec<f32>, bool)> {
        if let Container::Npz(npz) = &self.file {
            return counts::histograms(&mut npz.borrow_mut(), name, self.wanted, [bins, pairs]);
        }
        let turned = transpose(&self.counts(name)?, bins, pairs)?;
        let whole = histogram_figures::whole(&turned);
        Ok((turned, whole))
    }

    /// The error of a missing array.
    pub(super) fn missing(&self, name: &str) -> Error {
        match &self.file {
            Container::Npz(npz) => npz.borrow().missing(name, self.wanted),
            Container::Variables(file, _) => file.missing(name).advised(format!("wanted: {}", self.wanted)),
        }
    }
}
