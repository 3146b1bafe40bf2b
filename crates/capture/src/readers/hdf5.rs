//! Arrays of an HDF5 file, by name. MATLAB v7.3 files are HDF5 after a user block.
//!
//! A dataset in a group is named `group/name`. Shapes are those of the file, in C order: MATLAB's and Octave's dimensions are
//! reversed. Octave's `save -hdf5` stores a variable as a group with its `type` and `value`. Attributes of netCDF (`scale_factor`,
//! `add_offset`, `_FillValue`) are applied.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use rust_hdf5::{ByteOrder, DatatypeMessage, H5Dataset, H5File, Hdf5Error, LinkClass, ReadNumeric};

use super::container::container;
use super::counts::Counts;
use super::glance;
use crate::error::{Error, Result};
use crate::host;

/// No HDF5 filter in use shrinks data more than this.
const MOST_DEFLATED: u64 = 1100;
/// Largest array of numbers that are not counts (points, normals, settings).
const MOST_NUMBERS: usize = 1 << 28;
/// Compression ratio above which a large dataset of points or settings contains almost no information.
const HARDLY_ANYTHING: u64 = 500;
/// Maximum ratio of a large chunk, which is unpacked whole, to the file.
const OF_CHUNK: u64 = 64;

/// An open file, with its length in bytes to check the sizes that its datasets claim.
pub struct Hdf5 {
    file: H5File,
    path: PathBuf,
    bytes: u64,
    /// The group that holds the arrays of a capture, with its slash: empty, unless its variables are in one.
    group: String,
    /// Whether Octave wrote the file.
    is_octave: bool,
}

/// An array of counts in a file.
pub(super) struct Hdf5Array {
    pub(super) name: String,
    /// Lengths of its axes, the slowest first; at least one axis.
    pub(super) shape: Vec<usize>,
    /// The shape of a chunk, which is stored and compressed as one; `None` for values one after the other.
    pub(super) chunk: Option<Vec<usize>>,
    stored: StoredType,
}

/// How numbers are stored, and how netCDF packs them: value = stored * scale + offset, without stored fill values.
#[derive(Debug, Clone, Copy, PartialEq)]
struct StoredType {
    is_integer: bool,
    is_double: bool,
    packing: Option<Packing>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Packing {
    scale: f64,
    offset: f64,
    fill: f64,
}

impl Packing {
    /// By the attributes of a dataset; `None` without them.
    fn of(dataset: &H5Dataset) -> Option<Packing> {
        let attribute = |name: &str| -> Option<f64> {
            let attribute = dataset.attr(name).ok()?;
            let whole = || Some(*attribute.read_numeric_as::<i64>().ok()?.first()? as f64);
            attribute.read_numeric_as::<f64>().ok().and_then(|all| all.first().copied()).or_else(whole)
        };
        let found = ["scale_factor", "add_offset", "_FillValue"].map(attribute);
        let [scale, offset, fill] = found;
        found.iter().any(Option::is_some).then(|| Packing {
            scale: scale.unwrap_or(1.0),
            offset: offset.unwrap_or(0.0),
            fill: fill.unwrap_or(f64::NAN),
        })
    }

    fn unpacked(&self, stored: f64) -> f64 {
        if stored == self.fill { f64::NAN } else { stored * self.scale + self.offset }
    }
}

pub(super) fn damaged(e: impl std::fmt::Display) -> Error {
    // The names of the reader's layers say nothing about the file.
    let text = e.to_string();
    let text = text.rsplit_once("error: ").map_or(&text[..], |(_, what)| what);
    Error::input(
        format!("the HDF5 file cannot be read: {text}"),
        "the file is damaged or cut short: copy or download it again",
    )
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is inside the HDF5 reader, which may panic on a damaged file. Such a panic becomes an error and
/// is not shown to the user.
pub fn is_guarded() -> bool {
    GUARDED.get()
}

/// Turns a panic of the HDF5 reader into the error of a damaged file.
pub(super) fn guarded<T>(read: impl FnOnce() -> Result<T>) -> Result<T> {
    let before = GUARDED.replace(true);
    let done = catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(before);
    done.unwrap_or_else(|_| Err(damaged("its inner structure is not valid")))
}

impl Hdf5 {
    /// Opens a file for reading.
    ///
    /// # Errors
    /// `Kind::Input` for a damaged file.
    pub fn open(path: &Path) -> Result<Hdf5> {
        let bytes = std::fs::metadata(path).map_or(0, |m| m.len());
        let file = guarded(|| H5File::options().no_locking().open(path).map_err(damaged))?;
        // Octave marks the group of every variable.
        let first = || file.root_group().group(file.root_group().group_names().ok()?.first()?).ok();
        let marks = guarded(|| Ok(first().and_then(|group| group.attr_names().ok())))?;
        let is_octave = marks.is_some_and(|marks| marks.iter().any(|mark| mark == "OCTAVE_NEW_FORMAT"));
        let whole = Hdf5 { file, path: path.to_path_buf(), bytes, group: String::new(), is_octave };
        let group = guarded(|| Ok(container(&whole.names())))?.unwrap_or_default();
        Ok(Hdf5 { group, ..whole })
    }

    /// The name of a dataset in the file.
    fn full(&self, name: &str) -> String {
        let stored = |name: &str| match self.is_octave {
            true => name.split('/').flat_map(|part| [part, "value"]).collect::<Vec<_>>().join("/"),
            false => name.into(),
        };
        let inside = stored(&format!("{}{name}", self.group));
        if !self.group.is_empty() && self.file.dataset_names().contains(&inside) {
            inside
        } else {
            stored(name)
        }
    }

    /// The cell arrays of MATLAB: their names, and the shapes of all elements, which a file does not keep apart.
    pub(super) fn cells(&self) -> Vec<(String, Vec<Vec<usize>>)> {
        let (elements, rest): (Vec<String>, Vec<String>) =
            self.names().into_iter().partition(|name| name.starts_with("#refs#/"));
        // An empty element is one number that says so.
        let shapes = elements.iter().filter_map(|name| self.shape(name).ok().flatten());
        let shapes: Vec<Vec<usize>> = shapes.filter(|shape| shape.iter().product::<usize>() > 1).collect();
        let is_cell = |name: &String| {
            guarded(|| {
                Ok(self.file.dataset(name).ok().and_then(|d| d.attr("MATLAB_class").ok()?.read_string().ok()))
            })
            .is_ok_and(|class| class.is_some_and(|class| class == "cell"))
        };
        let mut cells: Vec<_> = rest.into_iter().filter(is_cell).map(|name| (name, shapes.clone())).collect();
        if cells.is_empty() && !elements.is_empty() {
            cells.push(("C".into(), shapes));
        }
        cells
    }

    /// Whether MATLAB or Octave wrote the file, whose shapes it shows reversed: MATLAB's text comes before HDF5, or its name ends
    /// in .mat.
    pub(super) fn in_matlab_order(&self) -> bool {
        self.is_octave
            || self.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mat"))
            || std::fs::File::open(&self.path).is_ok_and(|mut file| {
                let mut head = [0; 6];
                std::io::Read::read_exact(&mut file, &mut head).is_ok() && &head == b"MATLAB"
            })
    }

    /// The path that was opened.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Names of the datasets, sorted. Links to other files are among them, so that an error tells of them.
    pub fn names(&self) -> Vec<String> {
        let root = self.file.root_group();
        let leaves = |name: &String| matches!(root.link_class(name), Ok(LinkClass::External { .. }));
        let mut names = self.file.dataset_names();
        names.extend(root.link_names().unwrap_or_default().into_iter().filter(leaves));
        if self.is_octave {
            // NAME/value, and NAME/value/FIELD/value of a struct.
            names.retain(|name| name.ends_with("/value") && name.split('/').count() % 2 == 0);
            names.iter_mut().for_each(|name| {
                *name = name.split('/').step_by(2).collect::<Vec<_>>().join("/");
            });
        }
        for name in &mut names {
            if let Some(bare) = name.strip_prefix(&self.group).filter(|_| !self.group.is_empty()) {
                *name = bare.into();
            }
        }
        names.sort();
        names
    }

    /// The shape of a dataset, `None` if it is missing or empty.
    ///
    /// # Errors
    /// `Kind::Input` if it is damaged or claims an absurd size.
    pub fn shape(&self, name: &str) -> Result<Option<Vec<usize>>> {
        guarded(|| Ok(self.dataset(name)?.map(|d| d.shape())))
    }

    /// The dataset, `None` if it is missing or has an empty dataspace.
    fn dataset(&self, name: &str) -> Result<Option<H5Dataset>> {
        let name = &self.full(name);
        // Asked for a group, the reader tells of a link on the way before it opens the other file. For a dataset, it opens it.
        if let Err(Hdf5Error::Unsupported(_)) = self.file.root_group().group(name) {
            return Err(elsewhere(name, "is a link to other files"));
        }
        let dataset = match self.file.dataset(name) {
            Ok(dataset) => dataset,
            Err(Hdf5Error::NotFound(_)) => return Ok(None),
            Err(e) => return Err(failed(name, e)),
        };
        // MATLAB and Octave store the size of an empty array as its value.
        let is_marked = |name: &str| {
            let marked = dataset.attr(name).and_then(|mark| mark.read_numeric_as::<i64>());
            marked.is_ok_and(|mark| mark.iter().any(|mark| *mark != 0))
        };
        let empty = is_marked("MATLAB_empty") || is_marked("OCTAVE_EMPTY_MATRIX");
        if empty || dataset.is_null() || dataset.shape().contains(&0) {
            return Ok(None);
        }
        check_filters(name, &dataset)?;
        if dataset.external_files().is_ok_and(|files| !files.is_empty())
            || dataset.virtual_mappings().is_ok_and(|maps| !maps.is_empty())
        {
            return Err(elsewhere(name, "keeps its values in other files"));
        }
        // The HDF5 reader allocates the sizes that a file claims, and a failed allocation ends the program. So the
        // sizes are checked first, those of chunks too.
        let claim = |shape: &[usize]| {
            let bytes = shape.iter().try_fold(dataset.element_size() as u64, |n, &d| n.checked_mul(d as u64));
            bytes.is_some_and(|size| size / MOST_DEFLATED <= self.bytes)
        };
        if !claim(&dataset.shape()) || dataset.chunk_dims().is_some_and(|chunk| !claim(&chunk)) {
            return Err(Error::input(
                format!(
                    "dataset {name} claims shape {:?}, chunks {:?}, in a file of {} bytes",
                    dataset.shape(),
                    dataset.chunk_dims(),
                    self.bytes
                ),
                "the file is damaged or malicious: download or write it again",
            ));
        }
        let chunk = dataset.chunk_dims().map_or(0, |c| c.iter().fold(1, |n: usize, d| n.saturating_mul(*d)));
        if host::swells(host::bytes(chunk, dataset.element_size()), self.bytes, OF_CHUNK) {
            return Err(Error::input(
                format!(
                    "dataset {name} has chunks of shape {:?} in a file of {} bytes",
                    dataset.chunk_dims(),
                    self.bytes
                ),
                "write it with smaller chunks (h5repack does it)",
            ));
        }
        Ok(Some(dataset))
    }

    /// Asks for the memory of a part of a dataset: as it is stored, as the reader gives it, and as it is kept.
    fn ask(&self, name: &str, dataset: &H5Dataset, counts: &[usize]) -> Result<()> {
        let count = counts.iter().fold(1usize, |n, d| n.saturating_mul(*d));
        host::ask(
            &format!("dataset {name}"),
            host::bytes(count, dataset.element_size() + size_of::<f64>() + size_of::<f32>()),
        )
    }

    /// Whether an array unpacks to so much that it is looked at before it is kept.
    pub(super) fn is_looked_at(&self, array: &Hdf5Array) -> bool {
        let count = array.shape.iter().fold(1usize, |n, d| n.saturating_mul(*d));
        glance::is_wanted(host::bytes(count, size_of::<f32>()), self.bytes)
    }

    /// A dataset as float32 in C order; `None` if it is missing or empty.
    ///
    /// # Errors
    /// `Kind::Input` if it is damaged, does not hold numbers, or claims an absurd size.
    pub fn counts(&self, name: &str) -> Result<Option<Counts>> {
        guarded(|| {
            let Some(dataset) = self.dataset(name)? else { return Ok(None) };
            self.ask(name, &dataset, &dataset.shape())?;
            let shape = dataset.shape();
            let values = values(&dataset, stored(name, &dataset)?, None).map_err(|e| failed(name, e))?;
            check_length(name, &shape, &values)?;
            Ok(Some(Counts { shape, values }))
        })
    }

    /// A dataset whose counts are read block by block; `None` if it is missing, empty or a single number.
    ///
    /// # Errors
    /// As [`Hdf5::counts`].
    pub(super) fn array(&self, name: &str) -> Result<Option<Hdf5Array>> {
        guarded(|| {
            let Some(dataset) = self.dataset(name)? else { return Ok(None) };
            let (shape, chunk) = (dataset.shape(), dataset.chunk_dims());
            if shape.is_empty() {
                return Ok(None);
            }
            if chunk.as_ref().is_some_and(|c| c.len() != shape.len() || c.contains(&0)) {
                return Err(damaged(format!("{name} has shape {shape:?} and chunks {chunk:?}")));
            }
            Ok(Some(Hdf5Array { name: name.into(), shape, chunk, stored: stored(name, &dataset)? }))
        })
    }

    /// The values of a part of an array as float32 in C order.
    ///
    /// # Errors
    /// `Kind::Input` if the part is damaged.
    pub(super) fn block(&self, array: &Hdf5Array, starts: &[usize], counts: &[usize]) -> Result<Vec<f32>> {
        guarded(|| {
            let name = &array.name;
            let changed = || damaged(format!("dataset {name} is gone"));
            let dataset = self.dataset(name)?.ok_or_else(changed)?;
            self.ask(name, &dataset, counts)?;
            let values = values(&dataset, array.stored, Some([starts, counts]));
            let values = values.map_err(|e| failed(name, e))?;
            check_length(name, counts, &values)?;
            Ok(values)
        })
    }

    /// Values of a chunk of a dataset, which are stored and compressed as one; 1 where values lie one after the other.
    ///
    /// # Errors
    /// As [`Hdf5::shape`].
    pub fn chunk(&self, name: &str) -> Result<usize> {
        guarded(|| Ok(self.dataset(name)?.and_then(|d| d.chunk_dims()).map_or(1, |c| c.iter().product())))
    }

    /// Values of a dataset of one axis as whole numbers: `count` of them from `start` on. Real numbers are rounded.
    ///
    /// # Errors
    /// As [`Hdf5::counts`]; a value beyond 64 bits with a sign.
    pub fn whole(&self, name: &str, start: usize, count: usize) -> Result<Vec<i64>> {
        guarded(|| {
            let gone = || damaged(format!("dataset {name} is gone"));
            let dataset = self.dataset(name)?.ok_or_else(gone)?;
            self.ask(name, &dataset, &[count])?;
            let (from, to) = ([start], [count]);
            let rounded = |values: Vec<f64>| values.into_iter().map(|v| v.round() as i64).collect();
            let values: std::result::Result<Vec<i64>, _> = match stored(name, &dataset)?.is_integer {
                true => dataset.read_numeric_slice_as(&from, &to),
                false => dataset.read_numeric_slice_as(&from, &to).map(rounded),
            };
            let values = values.map_err(|e| failed(name, e))?;
            match values.len() == count {
                true => Ok(values),
                false => Err(damaged(format!("{name} holds {} values of {count}", values.len()))),
            }
        })
    }

    /// All numbers of a small dataset as float64 in C order, booleans and enums as their numbers. `None` if it is
    /// missing or empty.
    ///
    /// # Errors
    /// As [`Hdf5::counts`].
    pub fn numbers(&self, name: &str) -> Result<Option<(Vec<usize>, Vec<f64>)>> {
        guarded(|| {
            let Some(dataset) = self.dataset(name)? else { return Ok(None) };
            let shape = dataset.shape();
            if shape.iter().product::<usize>() > MOST_NUMBERS {
                return Err(Error::input(
                    format!("dataset {name} has shape {shape:?}, too large for points or settings"),
                    "check that the right file was given",
                ));
            }
            if host::swells(
                host::bytes(shape.iter().product(), dataset.element_size()),
                self.bytes,
                HARDLY_ANYTHING,
            ) {
                return Err(Error::input(
                    format!("dataset {name} of shape {shape:?} holds hardly more than one value"),
                    "the file is damaged or malicious: download or write it again",
                ));
            }
            self.ask(name, &dataset, &shape)?;
            let wrong = |e: Hdf5Error| failed(name, e);
            let values: Vec<f64> = match dataset.datatype().map_err(wrong)? {
                DatatypeMessage::Enum { base, .. } => {
                    enum_values(&base, &dataset.read_raw_bytes().map_err(wrong)?)
                }
                _ => {
                    let stored = stored(name, &dataset)?;
                    let values = match stored.is_integer {
                        true => dataset.read_numeric_as().map(in_double),
                        false => dataset.read_numeric_as(),
                    };
                    let unpack = |v: f64| stored.packing.map_or(v, |packing| packing.unpacked(v));
                    values.map_err(wrong)?.into_iter().map(unpack).collect()
                }
            };
            Ok((!values.is_empty()).then_some((shape, values)))
        })
    }
}

/// The error of a dataset that cannot be read: damaged, or of a form that is not supported.
fn failed(name: &str, e: Hdf5Error) -> Error {
    let text = e.to_string();
    if !text.to_lowercase().contains("unsupported") {
        return damaged(text).at(format!("dataset {name}"));
    }
    let what = text.rsplit_once(": ").map_or(&text[..], |(_, what)| what);
    unsupported(name, what)
}

fn unsupported(name: &str, what: &str) -> Error {
    Error::input(
        format!("dataset {name} is stored with {what}, which is not supported"),
        "repack the file: h5repack -f GZIP=6 IN OUT (with the plugin that wrote it), or read and write it with h5py",
    )
}

/// Filters by their registered numbers.
const FILTERS: [(u16, &str); 13] = [
    (305, "LZO"),
    (307, "bzip2"),
    (32000, "LZF"),
    (32001, "Blosc"),
    (32004, "LZ4"),
    (32008, "bitshuffle"),
    (32013, "ZFP"),
    (32015, "Zstandard"),
    (32017, "SZ"),
    (32019, "JPEG"),
    (32022, "Granular BitRound"),
    (32024, "SZ3"),
    (32026, "Blosc2"),
];
/// Those that are read, beside HDF5's own, 1 to 6.
const READ: [u16; 5] = [32000, 32001, 32004, BITSHUFFLE, 32015];
/// Those of them that need the feature `hdf5-filters`.
const FEATURED: [u16; 3] = [32001, 32004, 32015];
const BITSHUFFLE: u16 = 32008;
/// The compression after bitshuffle that needs the feature, and that which is not read.
const LZ4_AFTER_BITSHUFFLE: u32 = 2;
const ZSTD_AFTER_BITSHUFFLE: u32 = 3;

/// Refuses a dataset that is packed by a filter that is not read.
fn check_filters(name: &str, dataset: &H5Dataset) -> Result<()> {
    for filter in dataset.filters().unwrap_or_default() {
        let known =
            FILTERS.iter().find(|(id, _)| *id == filter.id).map_or("an unknown filter", |(_, name)| name);
        if !(1..=6).contains(&filter.id) && !READ.contains(&filter.id) {
            return Err(unsupported(name, &format!("{known} (HDF5 filter {})", filter.id)));
        }
        let after = filter.cd_values.get(4).copied().filter(|_| filter.id == BITSHUFFLE);
        if after == Some(ZSTD_AFTER_BITSHUFFLE) {
            return Err(unsupported(name, "bitshuffle with Zstandard (HDF5 filter 32008)"));
        }
        let is_featured = FEATURED.contains(&filter.id) || after == Some(LZ4_AFTER_BITSHUFFLE);
        if is_featured && cfg!(not(feature = "hdf5-filters")) {
            return Err(Error::input(
                format!(
                    "dataset {name} is stored with {known}, and this build lacks the feature hdf5-filters"
                ),
                "install a package, build with that feature, or repack the file: h5repack -f GZIP=6 IN OUT",
            ));
        }
    }
    Ok(())
}

/// The error of a dataset that is not in this file.
fn elsewhere(name: &str, how: &str) -> Error {
    Error::input(
        format!("dataset {name} {how}, which are not opened"),
        "write the values into this file (h5repack, or a copy with h5py, does it)",
    )
}

/// How the numbers of a dataset are stored.
fn stored(name: &str, dataset: &H5Dataset) -> Result<StoredType> {
    let datatype = dataset.datatype().map_err(|e| failed(name, e))?;
    let size = dataset.element_size();
    let is_integer = match datatype {
        DatatypeMessage::FloatingPoint { .. } if size > size_of::<f64>() => {
            return Err(Error::input(
                format!(
                    "dataset {name} holds long doubles, real numbers of {size} bytes, which are not read"
                ),
                format!("store {name} as float64"),
            ));
        }
        DatatypeMessage::FloatingPoint { .. } => false,
        DatatypeMessage::FixedPoint { .. } | DatatypeMessage::BitField { .. } => true,
        other => return Err(no_number(name, &other)),
    };
    let is_double = !is_integer && size == size_of::<f64>();
    Ok(StoredType { is_integer, is_double, packing: Packing::of(dataset) })
}

/// The values of a dataset, or of a part of it: starts and counts.
fn values(
    dataset: &H5Dataset,
    stored: StoredType,
    part: Option<[&[usize]; 2]>,
) -> std::result::Result<Vec<f32>, Hdf5Error> {
    fn read<T: ReadNumeric>(
        dataset: &H5Dataset,
        part: Option<[&[usize]; 2]>,
    ) -> std::result::Result<Vec<T>, Hdf5Error> {
        match part {
            Some([starts, counts]) => dataset.read_numeric_slice_as(starts, counts),
            None => dataset.read_numeric_as(),
        }
    }
    if let Some(packing) = stored.packing {
        let values = match stored.is_integer {
            true => in_double(read(dataset, part)?),
            false => read(dataset, part)?,
        };
        return Ok(values.into_iter().map(|v| packing.unpacked(v) as f32).collect());
    }
    Ok(match stored {
        StoredType { is_integer: true, .. } => {
            read::<i64>(dataset, part)?.into_iter().map(|v| v as f32).collect()
        }
        StoredType { is_double: true, .. } => {
            read::<f64>(dataset, part)?.into_iter().map(|v| v as f32).collect()
        }
        _ => read(dataset, part)?,
    })
}

fn in_double(values: Vec<i64>) -> Vec<f64> {
    values.into_iter().map(|v| v as f64).collect()
}

fn check_length(name: &str, shape: &[usize], values: &[f32]) -> Result<()> {
    if shape.iter().product::<usize>() == values.len() {
        return Ok(());
    }
    Err(damaged(format!("{name} holds {} values for shape {shape:?}", values.len())))
}

fn no_number(name: &str, found: &DatatypeMessage) -> Error {
    Error::input(
        format!("dataset {name} is of type {found}, not a number"),
        format!("store {name} as plain numbers"),
    )
}

/// The numbers of an enum's raw elements (booleans are an enum of one byte).
fn enum_values(base: &DatatypeMessage, raw: &[u8]) -> Vec<f64> {
    let DatatypeMessage::FixedPoint { size, byte_order, .. } = base else { return Vec::new() };
    let value = |element: &[u8]| {
        let digit = |n: u64, byte: &u8| (n << 8) | u64::from(*byte);
        match byte_order {
            ByteOrder::LittleEndian => element.iter().rev().fold(0, digit) as f64,
            ByteOrder::BigEndian => element.iter().fold(0, digit) as f64,
        }
    };
    raw.chunks_exact((*size as usize).clamp(1, 8)).map(value).collect()
}
