//! npz archives: named npy arrays in a zip file.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use flate2::Crc;
use flate2::read::DeflateDecoder;
use rayon::prelude::*;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::array::{Array, Head};
use crate::error::{Error, Result};
use crate::host;

/// Maximum compression ratio of deflate is 1032: a larger claim indicates damage.
const MOST_DEFLATED: u64 = 1100;
/// Largest array, bytes. Arrays of captures and maps are far smaller.
const LARGEST: u64 = 32 << 30;
/// Compression ratio above which a large array contains almost no information.
const HARDLY_ANYTHING: u64 = 500;

/// An npz file opened for reading; arrays are decoded on request.
pub struct Npz {
    zip: ZipArchive<BufReader<File>>,
    path: PathBuf,
    bytes: u64,
    /// The folder that holds all arrays, with its slash: empty, unless the archive was packed by hand.
    folder: String,
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
        let names: Vec<_> = zip.file_names().filter_map(|n| n.ok()).filter(|n| is_array(n)).collect();
        let folder = names.first().and_then(|name| name.rfind('/').map(|at| name[..=at].to_string()));
        let folder = folder.filter(|folder| names.iter().all(|name| name.starts_with(folder.as_str())));
        let folder = folder.unwrap_or_default();
        drop(names);
        Ok(Npz { zip, path: path.into(), bytes, folder })
    }

    /// Names of the arrays, sorted; without the folder that holds all of them.
    pub fn names(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(|n| n.ok()).filter(|n| is_array(n));
        let bare = |name: &str| Some(name.strip_prefix(&self.folder)?.strip_suffix(".npy")?.to_string());
        let mut names: Vec<String> = names.filter_map(|name| bare(&name)).collect();
        names.sort();
        names
    }

    /// The entry of an array.
    fn entry(&self, name: &str) -> Option<usize> {
        self.zip.index_for_name(&format!("{}{name}.npy", self.folder))
    }

    /// Reads an array; `None` if there is no array of this name.
    ///
    /// # Errors
    /// `Kind::Input` if the entry is damaged, is not an array of numbers, or claims an absurd size.
    pub fn get(&mut self, name: &str) -> Result<Option<Array>> {
        let Some([size, packed]) = self.sizes(name) else { return Ok(None) };
        if host::swells(size, packed, HARDLY_ANYTHING) {
            return Err(Error::input(
                format!("array {name} unpacks to {} MiB of nearly constant data", size >> 20),
                "the file is damaged or malicious: download or write it again",
            ));
        }
        self.whole(name)
    }

    /// Bytes of an array, unpacked and as they are in the file; `None` if there is no array of this name.
    pub fn sizes(&mut self, name: &str) -> Option<[u64; 2]> {
        let index = self.entry(name)?;
        let entry = self.zip.by_index_raw(index).ok()?;
        Some([entry.size(), entry.compressed_size()])
    }

    /// Reads an array without a limit on its compression ratio; `None` if there is no array of this name. Also
    /// reserves the memory of its elements as float64.
    ///
    /// # Errors
    /// As [`Npz::get`].
    pub fn whole(&mut self, name: &str) -> Result<Option<Array>> {
        let Some((head, mut elements)) = self.stream(name)? else { return Ok(None) };
        let place = format!("array {name}");
        let left = elements.left;
        head.whole(&mut elements, left).map(Some).map_err(|e| e.at(place))
    }

    /// Header of an array and a reader of its elements; `None` if there is no array of this name. Several arrays may
    /// be read concurrently.
    ///
    /// # Errors
    /// `Kind::Input` if the entry is damaged, or is not an array of numbers.
    pub fn stream(&mut self, name: &str) -> Result<Option<(Head, Elements)>> {
        let Some(index) = self.entry(name) else { return Ok(None) };
        let method = self.zip.by_index_raw(index).map_err(damaged)?.compression();
        if !matches!(method, CompressionMethod::Stored | CompressionMethod::Deflated) {
            return Err(Error::input(
                format!("array {name} is packed by {method}, which is not read"),
                r#"pack it again with numpy: np.savez_compressed("capture.npz", **np.load("FILE"))"#,
            ));
        }
        let entry = self.zip.by_index(index).map_err(damaged)?;
        let (size, stored) = (entry.size(), entry.compressed_size());
        if size > LARGEST || size / MOST_DEFLATED > self.bytes {
            return Err(Error::input(
                format!("array {name} claims {size} bytes, but the file has {}", self.bytes),
                "the file is damaged or malicious: download or write it again",
            ));
        }
        let sum = entry.crc32();
        let start = entry.data_start().ok_or_else(|| damaged(format!("array {name} has no data offset")))?;
        drop(entry);
        let mut file = File::open(&self.path).map_err(damaged)?;
        let bytes = match method {
            CompressionMethod::Stored => EntryBytes::Stored { file, at: start, end: start + stored },
            _ => {
                file.seek(SeekFrom::Start(start)).map_err(damaged)?;
                let stored = BufReader::with_capacity(1 << 16, file.take(stored));
                EntryBytes::Deflated(Box::new(DeflateDecoder::new(stored)))
            }
        };
        let mut elements = Elements { bytes, left: size, sum, summed: Crc::new() };
        let head = Head::read(&mut elements).map_err(|e| e.at(format!("array {name}")))?;
        Ok(Some((head, elements)))
    }

    /// Whether an array holds Python objects, such as `None` or an enum, in place of numbers.
    pub fn is_object(&mut self, name: &str) -> bool {
        let Some(Ok(entry)) = self.entry(name).map(|index| self.zip.by_index(index)) else { return false };
        let mut head = vec![];
        entry.take(256).read_to_end(&mut head).is_ok() && head.windows(4).any(|word| word == b"'|O'")
    }

    /// Reads a required array.
    ///
    /// # Errors
    /// As [`Npz::get`]. If the array is missing, the error lists the arrays of the file and `wanted`.
    pub fn require(&mut self, name: &str, wanted: &str) -> Result<Array> {
        self.get(name)?.ok_or_else(|| self.missing(name, wanted))
    }

    /// Error for a missing array.
    pub fn missing(&self, name: &str, wanted: &str) -> Error {
        let there = self.names();
        let there = if there.is_empty() { "nothing".to_string() } else { there.join(", ") };
        Error::input(format!("there is no array {name} (it holds {there})"), format!("wanted: {wanted}"))
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

/// Whether an entry of this name is an array. Archives of macOS hold a second entry for each file.
fn is_array(name: &str) -> bool {
    name.ends_with(".npy") && !name.starts_with("__MACOSX/")
}

/// Rest of an archive entry. The checksum is verified when the last byte is read.
pub struct Elements {
    bytes: EntryBytes,
    /// Remaining bytes.
    left: u64,
    /// Checksum in the archive, and of the bytes so far.
    sum: u32,
    summed: Crc,
}

/// The bytes of an entry from here on.
enum EntryBytes {
    /// Between two positions of the file.
    Stored {
        file: File,
        at: u64,
        end: u64,
    },
    Deflated(Box<dyn Read>),
}

impl Elements {
    /// Bytes that are left.
    pub fn left(&self) -> u64 {
        self.left
    }

    /// Reads the next `count` bytes on all threads: `take` gets every piece of `size` bytes, the last may be smaller, with its number.
    ///
    /// # Errors
    /// Those of [`Read::read_exact`].
    pub fn pieces(
        &mut self,
        count: usize,
        size: usize,
        take: &(dyn Fn(usize, &[u8]) + Sync),
    ) -> io::Result<()> {
        let EntryBytes::Stored { file, at, end } = &mut self.bytes else {
            let mut bytes = vec![0; count]; // bounded: by the caller, as what `take` makes of it
            self.read_exact(&mut bytes)?;
            bytes.par_chunks(size).enumerate().for_each(|(number, piece)| take(number, piece));
            return Ok(());
        };
        if count as u64 > self.left.min(*end - *at) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let begin = *at;
        let one = |bytes: &mut Vec<u8>, number: usize| -> io::Result<Crc> {
            let from = number * size;
            bytes.resize(size.min(count - from), 0);
            file.read_exact_at(bytes, begin + from as u64)?;
            let mut sum = Crc::new();
            sum.update(bytes);
            take(number, bytes);
            Ok(sum)
        };
        let pieces = (0..count.div_ceil(size)).into_par_iter();
        let sums: io::Result<Vec<Crc>> = pieces.map_init(Vec::new, one).collect();
        sums?.iter().for_each(|sum| self.summed.combine(sum));
        *at += count as u64;
        self.left -= count as u64;
        self.check()
    }

    /// Compares the checksums after the last byte.
    fn check(&self) -> io::Result<()> {
        if self.left > 0 || self.summed.sum() == self.sum {
            return Ok(());
        }
        Err(io::Error::new(io::ErrorKind::InvalidData, "checksum mismatch (CRC-32)"))
    }
}

impl Read for Elements {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let most = to.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
        let count = match &mut self.bytes {
            EntryBytes::Stored { file, at, end } => {
                let most = most.min(usize::try_from(*end - *at).unwrap_or(usize::MAX));
                let count = file.read_at(&mut to[..most], *at)?;
                *at += count as u64;
                count
            }
            EntryBytes::Deflated(bytes) => bytes.read(&mut to[..most])?,
        };
        self.summed.update(&to[..count]);
        self.left -= count as u64;
        if count > 0 {
            self.check()?;
        }
        Ok(count)
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
