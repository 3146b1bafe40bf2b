//! Files of other programs, built from the schemas of their formats.
#![allow(dead_code)]

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;

/// An array for a file: MATLAB's dimensions and its values, the first dimension fastest.
#[derive(Clone)]
pub struct Matrix {
    pub name: String,
    pub dims: Vec<usize>,
    pub values: Vec<f64>,
    /// Stored as uint16 rather than double.
    pub counts: bool,
}

/// An array whose value at a place (in MATLAB's dimensions) is told by a function.
pub fn matrix(name: &str, dims: &[usize], value: impl Fn(&[usize]) -> f64) -> Matrix {
    let total = dims.iter().product();
    let place = |mut at: usize| -> Vec<usize> {
        dims.iter()
            .map(|d| {
                let i = at % d;
                at /= d;
                i
            })
            .collect()
    };
    Matrix {
        name: name.into(),
        dims: dims.to_vec(),
        values: (0..total).map(|at| value(&place(at))).collect(),
        counts: false,
    }
}

pub fn scalar(name: &str, value: f64) -> Matrix {
    matrix(name, &[1, 1], |_| value)
}

pub fn vector(name: &str, values: &[f64]) -> Matrix {
    matrix(name, &[values.len(), 1], |at| values[at[0]])
}

impl Matrix {
    pub fn of_counts(mut self) -> Matrix {
        self.counts = true;
        self
    }

    /// The same array as a program of the other axis order sees it.
    pub fn reversed(&self) -> Matrix {
        let dims: Vec<usize> = self.dims.iter().rev().copied().collect();
        matrix(&self.name, &dims, |at| {
            let (mut index, mut step) = (0, 1);
            for (i, d) in at.iter().rev().zip(&self.dims) {
                index += i * step;
                step *= d;
            }
            self.values[index]
        })
    }
}

fn word(value: usize, big: bool) -> [u8; 4] {
    if big { (value as u32).to_be_bytes() } else { (value as u32).to_le_bytes() }
}

fn element(kind: usize, content: &[u8], big: bool) -> Vec<u8> {
    let mut all = [word(kind, big), word(content.len(), big)].concat();
    all.extend(content);
    all.resize(all.len().next_multiple_of(8), 0);
    all
}

pub fn matlab_matrix(m: &Matrix, big: bool) -> Vec<u8> {
    let class = if m.counts { 11 } else { 6 };
    let mut all = element(6, &[word(class, big), word(0, big)].concat(), big);
    all.extend(element(5, &m.dims.iter().flat_map(|d| word(*d, big)).collect::<Vec<_>>(), big));
    all.extend(element(1, m.name.as_bytes(), big));
    let bytes: Vec<u8> = match (m.counts, big) {
        (true, false) => m.values.iter().flat_map(|v| (*v as u16).to_le_bytes()).collect(),
        (true, true) => m.values.iter().flat_map(|v| (*v as u16).to_be_bytes()).collect(),
        (false, false) => m.values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        (false, true) => m.values.iter().flat_map(|v| v.to_be_bytes()).collect(),
    };
    all.extend(element(if m.counts { 4 } else { 9 }, &bytes, big));
    element(14, &all, big)
}

/// A struct of one element, its fields whole matrix elements.
pub fn matlab_struct(name: &str, fields: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut all = element(6, &[word(2, false), word(0, false)].concat(), false);
    all.extend(element(5, &[word(1, false), word(1, false)].concat(), false));
    all.extend(element(1, name.as_bytes(), false));
    // The length of a field's name, in the short form.
    all.extend([5, 0, 4, 0, 32, 0, 0, 0]);
    let names: Vec<u8> = fields.iter().flat_map(|(name, _)| format!("{name:\0<32}").into_bytes()).collect();
    all.extend(element(1, &names, false));
    fields.iter().for_each(|(_, field)| all.extend(field));
    element(14, &all, false)
}

/// How a MATLAB v5 file is stored.
#[derive(Clone, Copy, PartialEq)]
pub enum Stored {
    Plain,
    BigEndian,
    Compressed,
}

pub fn matlab_file(elements: &[Vec<u8>], stored: Stored) -> Vec<u8> {
    let mut file = format!("{:<124}", "MATLAB 5.0 MAT-file, made by a test").into_bytes();
    let big = stored == Stored::BigEndian;
    file.extend(if big { *b"\x01\x00MI" } else { *b"\x00\x01IM" });
    for element in elements {
        if stored == Stored::Compressed {
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
            encoder.write_all(element).unwrap();
            let packed = encoder.finish().unwrap();
            file.extend([word(15, false), word(packed.len(), false)].concat());
            file.extend(packed);
        } else {
            file.extend(element);
        }
    }
    file
}

pub fn matlab5(arrays: &[Matrix], stored: Stored) -> Vec<u8> {
    let elements: Vec<_> = arrays.iter().map(|m| matlab_matrix(m, stored == Stored::BigEndian)).collect();
    matlab_file(&elements, stored)
}

pub fn matlab5_struct(name: &str, fields: &[Matrix], stored: Stored) -> Vec<u8> {
    let unnamed = |m: &Matrix| matlab_matrix(&Matrix { name: String::new(), ..m.clone() }, false);
    let fields: Vec<_> = fields.iter().map(|m| (m.name.as_str(), unnamed(m))).collect();
    matlab_file(&[matlab_struct(name, &fields)], stored)
}

/// An HDF5 file with these arrays, axes reversed as MATLAB v7.3 and every HDF5 reader of C order has them;
/// names may be `group/name`.
pub fn hdf5(path: &Path, arrays: &[Matrix]) {
    let file = rust_hdf5::H5File::create(path).unwrap();
    let mut groups = std::collections::BTreeMap::new();
    for m in arrays {
        let shape: Vec<usize> = m.dims.iter().rev().copied().collect();
        let (group, name) = match m.name.split_once('/') {
            Some((group, name)) => {
                let made = groups.entry(group).or_insert_with(|| file.create_group(group).unwrap());
                (Some(&*made), name)
            }
            None => (None, m.name.as_str()),
        };
        if m.counts {
            let values: Vec<u16> = m.values.iter().map(|v| *v as u16).collect();
            let new = group.map_or_else(|| file.new_dataset::<u16>(), |g| g.new_dataset());
            let dataset = new.shape(&shape).chunk(&shape).shuffle_deflate(4).create(name).unwrap();
            dataset.write_raw(&values).unwrap();
        } else {
            let new = group.map_or_else(|| file.new_dataset::<f64>(), |g| g.new_dataset());
            new.shape(&shape).create(name).unwrap().write_raw(&m.values).unwrap();
        }
    }
    file.close().unwrap();
}
