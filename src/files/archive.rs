//! npz archives: named npy arrays in a zip file.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use flate2::read::DeflateDecoder;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::array::{Array, Head};
use crate::error::{Error, Result};

/// Deflate shrinks data at most 1032 times: a file that claims more is damaged.
const MOST_DEFLATED: u64 = 1100;
/// Largest array, bytes. Arrays of captures and maps are far smaller.
const LARGEST: u64 = 32 << 30;

/// An npz file opened for reading; arrays are decoded on request.
pub struct Npz {
    zip: ZipArchive<BufReader<File>>,
    path: PathBuf,
    bytes: u64,
}

impl Npz {
    /// Opens an archive and reads its table of contents.
    ///
    /// # Errors
    /// `Kind::Input` if the file cannot be read or is not a zip archive. The error does not name the path (see
    /// [`Error::at`]).
    pub fn open(path: &Path) -> Result<Npz> {
        let file =
            File::open(path).map_err(|e| Error::input(format!("cannot be read: {e}"), "check the path"))?;
        let meta = file.metadata();
        if meta.as_ref().is_ok_and(std::fs::Metadata::is_dir) {
            return Err(Error::input("is a folder, not a file", "give the npz file inside it"));
        }
        let bytes = meta.map_or(0, |m| m.len());
        let zip = ZipArchive::new(BufReader::new(file)).map_err(damaged)?;
        Ok(Npz { zip, path: path.into(), bytes })
    }

    /// Names of the arrays, sorted.
    pub fn names(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(|n| n.ok());
        let mut names: Vec<String> =
            names.filter_map(|n| n.strip_suffix(".npy").map(str::to_string)).collect();
        names.sort();
        names
    }

    /// Reads an array; `None` if there is no array of this name.
    ///
    /// # Errors
    /// `Kind::Input` if the entry is damaged, is not an array of numbers, or claims an absurd size.
    pub fn get(&mut self, name: &str) -> Result<Option<Array>> {
        let Some(index) = self.zip.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
        let entry = self.zip.by_index(index).map_err(damaged)?;
        let size = entry.size();
        if size > LARGEST || size / MOST_DEFLATED > self.bytes {
            return Err(Error::input(
                format!("array {name} claims {size} bytes, but the file has {}", self.bytes),
                "the file is damaged or malicious: download or write it again",
            ));
        }
        let mut npy = Vec::new();
        npy.try_reserve_exact(size as usize).map_err(|_| {
            Error::memory(
                format!("array {name} needs {size} bytes"),
                "close other programs or crop the capture",
            )
        })?;
        entry.take(size).read_to_end(&mut npy).map_err(|e| damaged(e).at(format!("array {name}")))?;
        Array::parse(&npy).map(Some).map_err(|e| e.at(format!("array {name}")))
    }

    /// The header of an array, and its elements as they follow; `None` if there is no array of this name. Several may be read
    /// at a time.
    ///
    /// # Errors
    /// `Kind::Input` if the entry is damaged, or is not an array of numbers.
    pub fn stream(&mut self, name: &str) -> Result<Option<(Head, Box<dyn Read>)>> {
        let Some(index) = self.zip.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
        let entry = self.zip.by_index(index).map_err(damaged)?;
        let (size, stored, method) = (entry.size(), entry.compressed_size(), entry.compression());
        let start = entry.data_start().ok_or_else(|| damaged(format!("array {name} has no place")))?;
        drop(entry);
        let mut file = File::open(&self.path).map_err(damaged)?;
        file.seek(SeekFrom::Start(start)).map_err(damaged)?;
        let stored = BufReader::with_capacity(1 << 16, file.take(stored));
        let mut elements: Box<dyn Read> = match method {
            CompressionMethod::Stored => Box::new(stored.take(size)),
            CompressionMethod::Deflated => Box::new(DeflateDecoder::new(stored).take(size)),
            other => return Err(damaged(format!("array {name} is packed by {other}, not deflated"))),
        };
        let head = Head::read(&mut elements).map_err(|e| e.at(format!("array {name}")))?;
        Ok(Some((head, elements)))
    }

    /// Reads a required array.
    ///
    /// # Errors
    /// As [`Npz::get`]. If the array is missing, the error lists the arrays of the file and `wanted`.
    pub fn require(&mut self, name: &str, wanted: &str) -> Result<Array> {
        let there = self.names();
        self.get(name)?.ok_or_else(|| {
            let there = if there.is_empty() { "nothing".to_string() } else { there.join(", ") };
            Error::input(format!("there is no array {name} (it holds {there})"), format!("wanted: {wanted}"))
        })
    }

    /// Reads a scalar: an array of exactly one number.
    ///
    /// # Errors
    /// As [`Npz::get`], or if the array does not hold exactly one number.
    pub fn scalar(&mut self, name: &str) -> Result<Option<f64>> {
        let Some(array) = self.get(name)? else { return Ok(None) };
        match array.to_f64()[..] {
            [value] => Ok(Some(value)),
            _ => Err(Error::input(
                format!("{name} has shape {:?}, not a single number", array.shape),
                format!("store {name} as a scalar"),
            )),
        }
    }
}

fn damaged(e: impl std::fmt::Display) -> Error {
    Error::input(
        format!("the zip archive cannot be read: {e}"),
        "the file is damaged or cut short: copy or download it again",
    )
}

/// The bytes of an npz file: deflated, in the given order, with fixed timestamps, so that equal arrays give equal
/// bytes.
///
/// # Errors
/// `Kind::Output` if there is not enough memory to pack an array.
pub fn npz_bytes(arrays: &[(&str, Array)]) -> Result<Vec<u8>> {
    let failed =
        |e: String| Error::output(format!("the npz archive cannot be packed: {e}"), "free some memory");
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, array) in arrays {
        let npy = array.to_npy();
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .large_file(npy.len() as u64 >= u64::from(u32::MAX) / 2);
        zip.start_file(format!("{name}.npy"), options).map_err(|e| failed(e.to_string()))?;
        zip.write_all(&npy).map_err(|e| failed(e.to_string()))?;
    }
    Ok(zip.finish().map_err(|e| failed(e.to_string()))?.into_inner())
}
