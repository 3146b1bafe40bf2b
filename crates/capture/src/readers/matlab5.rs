//! Arrays of a MATLAB v5 file (what `save` writes without `-v7.3`), plain or compressed, of either byte order.
//!
//! Numeric and logical arrays are read, fields of a struct as `struct/field`. Text, cells, sparse matrices and objects
//! are skipped; so are opaque variables (string, datetime, table), whose elements have no dimensions. Source of the format: "MAT-File Format", MathWorks. Every size is compared with the bytes of the file
//! before memory is allocated.

use std::io::Read;
use std::ops::Range;
use std::path::Path;

use flate2::read::ZlibDecoder;

use super::container::container;
use super::counts::Counts;
use super::glance::{self, Glance};
use super::numbers::{Numbers, damaged};
use super::scatter::{ArraySelection, Scattered};
use crate::error::{Error, Result};
use crate::host;

/// Deflate shrinks data at most 1032 times: a file that claims more is damaged.
const MOST_DEFLATED: usize = 1100;
/// An array's flags, dimensions and name lie within this many bytes.
const PREFIX: usize = 4096;
/// Largest number of arrays in a file or of fields in a struct, and deepest nesting of structs.
const MOST_ARRAYS: usize = 4096;
const DEEPEST: usize = 4;
/// Largest array of numbers that are not counts (points, settings).
const MOST_NUMBERS: usize = 1 << 28;
/// Compression ratio above which a large array of points or settings contains almost no information.
const HARDLY_ANYTHING: u64 = 500;

/// Values that [`Matlab5::scatter`] takes at a time.
const AT_ONCE: usize = 4 << 20;

const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
const CELL: u8 = 1;
const STRUCT: u8 = 2;
const OPAQUE: u8 = 17;

/// A file in memory, and where its arrays are.
pub struct Matlab5 {
    /// The file, then its inflated parts.
    blocks: Vec<Vec<u8>>,
    big_endian: bool,
    arrays: Vec<ArrayPlace>,
}

/// Where an array is.
#[derive(Debug, Clone)]
struct ArrayPlace {
    name: String,
    class: u8,
    complex: bool,
    /// In C order: MATLAB's dimensions reversed.
    shape: Vec<usize>,
    block: usize,
    /// The matrix element's content, or the deflated element.
    at: Range<usize>,
    deflated: bool,
}

/// A tag, the content behind it, and where the next element begins.
struct MatlabElement {
    kind: u32,
    content: Range<usize>,
    next: usize,
}

impl Matlab5 {
    /// Reads a file and lists its arrays; values are decoded on request.
    ///
    /// # Errors
    /// `Kind::Input` for a damaged file. The error does not name the path (see [`Error::at`]).
    pub fn open(path: &Path) -> Result<Matlab5> {
        let unreadable =
            |e: std::io::Error| Error::input(format!("cannot be read: {e}"), "check the path and the disk");
        let file = std::fs::File::open(path).map_err(unreadable)?;
        let length = file.metadata().map_err(unreadable)?.len();
        let mut bytes = host::room("the file", usize::try_from(length).unwrap_or(usize::MAX))?;
        file.take(length).read_to_end(&mut bytes).map_err(unreadable)?;
        Matlab5::parse(bytes)
    }

    /// Lists the arrays of a file's bytes.
    ///
    /// # Errors
    /// `Kind::Input` for damaged bytes.
    pub fn parse(bytes: Vec<u8>) -> Result<Matlab5> {
        let big_endian = match bytes.get(124..128) {
            Some([0, 1, b'I', b'M']) => false,
            Some([1, 0, b'M', b'I']) => true,
            Some(_) => return Err(damaged("its header does not name version 5")),
            None => return Err(damaged("it ends within its header")),
        };
        let end = bytes.len();
        let mut file = Matlab5 { blocks: vec![bytes], big_endian, arrays: vec![] };
        let mut at = 128;
        while at < end {
            let element = file.element(0, at..end)?;
            at = element.next;
            match element.kind {
                MATRIX => file.list(0, element.content, "", 0)?,
                COMPRESSED => file.list_deflated(element.content)?,
                _ => {}
            }
        }
        file.arrays.sort_by(|a, b| a.name.cmp(&b.name));
        if let Some(container) = container(&file.names()) {
            for array in &mut file.arrays {
                if let Some(bare) = array.name.strip_prefix(&container) {
                    array.name = bare.into();
                }
            }
            file.arrays.sort_by(|a, b| a.name.cmp(&b.name));
        }
        Ok(file)
    }

    /// The cell arrays, each with the shapes of its elements in C order; elements that cannot be read are left out.
    pub(super) fn cells(&self) -> Vec<(String, Vec<Vec<usize>>)> {
        let cells = self.arrays.iter().filter(|array| array.class == CELL && !array.shape.contains(&0));
        cells.map(|array| (array.name.clone(), self.shapes_of(array).unwrap_or_default())).collect()
    }

    fn shapes_of(&self, array: &ArrayPlace) -> Result<Vec<Vec<usize>>> {
        if array.deflated {
            let whole = self.inflate(&array.at)?;
            let at = 0..whole.len();
            let inner = Matlab5 { blocks: vec![whole], big_endian: self.big_endian, arrays: vec![] };
            return inner.shapes_of(&ArrayPlace { block: 0, at, deflated: false, ..array.clone() });
        }
        let (_, mut at) = self.header(array.block, array.at.clone())?;
        let mut shapes = vec![];
        while at < array.at.end && shapes.len() < MOST_ARRAYS {
            let element = self.element(array.block, at..array.at.end)?;
            at = element.next;
            if !element.content.is_empty() {
                shapes.push(self.header(array.block, element.content)?.0.shape);
            }
        }
        Ok(shapes)
    }

    /// Names of the arrays, sorted.
    pub fn names(&self) -> Vec<String> {
        self.arrays.iter().filter(|a| a.class != STRUCT).map(|a| a.name.clone()).collect()
    }

    /// The shape of an array in C order, `None` if it is missing or empty.
    ///
    /// # Errors
    /// None at present: shapes are known since the file was opened.
    pub fn shape(&self, name: &str) -> Result<Option<Vec<usize>>> {
        Ok(self.find(name).map(|a| a.shape.clone()))
    }

    /// The shape of an array whose values are in the file, `None` if it is missing or empty.
    ///
    /// # Errors
    /// `Kind::Input` if it is damaged, complex or does not hold numbers.
    pub(super) fn counts_shape(&self, name: &str) -> Result<Option<Vec<usize>>> {
        let Some(found) = self.find(name) else { return Ok(None) };
        self.numbers_of(found).and_then(|_| self.look(found)).map_err(|e| e.at(format!("array {name}")))?;
        Ok(Some(found.shape.clone()))
    }

    /// An array as float32 in C order; `None` if it is missing or empty.
    ///
    /// # Errors
    /// `Kind::Input` if it is damaged, complex or does not hold numbers.
    pub fn counts(&self, name: &str) -> Result<Option<Counts>> {
        let Some(found) = self.find(name) else { return Ok(None) };
        let values = self.numbers_of(found).and_then(|mut n| n.next(usize::MAX, |v| v as f32));
        let values = values.map_err(|e| e.at(format!("array {name}")))?;
        Ok(Some(Counts { shape: found.shape.clone(), values }))
    }

    /// Calls `visit` with every value of an array and its place in C order.
    ///
    /// # Errors
    /// As [`Matlab5::counts`].
    pub(super) fn visit(&self, name: &str, visit: &mut dyn FnMut(usize, f32)) -> Result<()> {
        let Some(found) = self.find(name) else { return Ok(()) };
        let mut numbers = self.numbers_of(found)?;
        let mut at = 0;
        loop {
            let values = numbers.next(AT_ONCE, |v| v as f32).map_err(|e| e.at(format!("array {name}")))?;
            if values.is_empty() {
                return Ok(());
            }
            values.iter().enumerate().for_each(|(k, value)| visit(at + k, *value));
            at += values.len();
        }
    }

    /// Looks at counts that unpack to far more than the file, a part at a time.
    fn look(&self, found: &ArrayPlace) -> Result<()> {
        let size = found.shape.iter().fold(size_of::<f32>() as u64, |n, d| n.saturating_mul(*d as u64));
        if !glance::is_wanted(size, found.at.len() as u64) {
            return Ok(());
        }
        let (mut numbers, mut glance) = (self.numbers_of(found)?, Glance::default());
        loop {
            let values = numbers.next(glance::AT_ONCE, |v| v as f32)?;
            if values.is_empty() {
                return glance.finish(&found.name);
            }
            glance.take(&values);
        }
    }

    /// The wanted pairs and bins of an array [T, ...]; `None` if it is missing or empty. A few bins are decoded at a
    /// time.
    ///
    /// # Errors
    /// As [`Matlab5::counts`].
    pub(super) fn scatter(&self, name: &str, wanted: &ArraySelection) -> Result<Option<Scattered>> {
        let Some(found) = self.find(name) else { return Ok(None) };
        let [bins, places] = wanted.stored;
        let at_once = (AT_ONCE / places).max(1);
        let scattered = self.numbers_of(found).and_then(|mut numbers| {
            wanted.scatter(vec![(0..bins, (0..places).collect())], |parts| {
                parts
                    .into_iter()
                    .map(|mut part| {
                        for first in (0..bins).step_by(at_once) {
                            let values = numbers.next(at_once * places, |v| v as f32)?;
                            part.take(first, &values);
                        }
                        Ok(part.finish())
                    })
                    .collect()
            })
        });
        scattered.map(Some).map_err(|e: Error| e.at(format!("array {name}")))
    }

    /// An array in float64 and C order, `None` if it is missing or empty.
    ///
    /// # Errors
    /// As [`Matlab5::counts`], or if it is too large for points or settings.
    pub fn numbers(&self, name: &str) -> Result<Option<(Vec<usize>, Vec<f64>)>> {
        let Some(found) = self.find(name) else { return Ok(None) };
        let count = found.shape.iter().try_fold(1usize, |n, d| n.checked_mul(*d));
        let swells =
            |n| host::swells(host::bytes(n, size_of::<f64>()), found.at.len() as u64, HARDLY_ANYTHING);
        if count.is_none_or(|n| n > MOST_NUMBERS || swells(n)) {
            return Err(Error::input(
                format!("array {name} has shape {:?}, too large for points or settings", found.shape),
                "check that the right file was given",
            ));
        }
        let values = self.numbers_of(found).and_then(|mut n| n.next(usize::MAX, |v| v));
        let values = values.map_err(|e| e.at(format!("array {name}")))?;
        Ok(Some((found.shape.clone(), values)))
    }

    fn find(&self, name: &str) -> Option<&ArrayPlace> {
        self.arrays.iter().find(|a| a.name == name && a.class != STRUCT && !a.shape.contains(&0))
    }

    fn word(&self, block: usize, at: usize) -> Option<u32> {
        let bytes: [u8; 4] = self.blocks[block].get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// The element that begins at the start of `within`, its content wholly inside.
    fn element(&self, block: usize, within: Range<usize>) -> Result<MatlabElement> {
        self.tag(block, within.clone())
            .filter(|e| e.content.end <= within.end)
            .ok_or_else(|| damaged(format!("the element at byte {} goes beyond the end", within.start)))
    }

    /// The element that begins at the start of `within`; its content may go beyond.
    fn tag(&self, block: usize, within: Range<usize>) -> Option<MatlabElement> {
        let at = within.start;
        let first = self.word(block, at)?;
        if first >> 16 != 0 {
            // Content of up to four bytes lies inside the tag.
            let size = (first >> 16) as usize;
            let content = at + 4..at + 4 + size;
            return (size <= 4).then_some(MatlabElement { kind: first & 0xffff, content, next: at + 8 });
        }
        let size = self.word(block, at.checked_add(4)?)? as usize;
        let content = at + 8..(at + 8).checked_add(size)?;
        // Compressed elements are not padded.
        let next = if first == COMPRESSED { content.end } else { content.end.checked_next_multiple_of(8)? };
        Some(MatlabElement { kind: first, content, next })
    }

    /// Flags, dimensions and name of a matrix element's content, and where its values begin. Only these must lie within
    /// `known`.
    fn header(&self, block: usize, known: Range<usize>) -> Result<(ArrayPlace, usize)> {
        let flags = self.element(block, known.clone())?;
        let word = self.word(block, flags.content.start).unwrap_or(0);
        if word as u8 == OPAQUE && flags.content.len() >= 8 {
            let (name, shape, at) = (String::new(), vec![0], known.clone()); // bounded: one number
            let found = ArrayPlace { name, class: OPAQUE, complex: false, shape, block, at, deflated: false };
            return Ok((found, known.end));
        }
        let dims = self.element(block, flags.next..known.end)?;
        let name = self.element(block, dims.next..known.end)?;
        if flags.content.len() < 8 || dims.content.len() % 4 != 0 || dims.content.len() > 32 * 4 {
            return Err(damaged(format!("the array at byte {} has no proper header", known.start)));
        }
        let mut shape = Vec::new();
        for at in dims.content.clone().step_by(4) {
            let size = self.word(block, at).and_then(|d| i32::try_from(d).ok());
            let size = size.ok_or_else(|| damaged("an array has a dimension below zero"))?;
            shape.push(size as usize);
        }
        shape.reverse();
        let text = self.blocks[block].get(name.content).unwrap_or_default();
        let found = ArrayPlace {
            name: String::from_utf8_lossy(text).into_owned(),
            class: word as u8,
            complex: word & 0x800 != 0,
            shape,
            block,
            at: known,
            deflated: false,
        };
        Ok((found, name.next))
    }

    /// Lists a matrix element, and the fields of a struct.
    fn list(&mut self, block: usize, content: Range<usize>, path: &str, depth: usize) -> Result<()> {
        if content.is_empty() {
            return Ok(());
        }
        let (mut found, values) = self.header(block, content.clone())?;
        if !path.is_empty() {
            found.name = path.to_string();
        }
        let (class, one) = (found.class, found.shape.iter().all(|&d| d == 1));
        let name = found.name.clone();
        self.keep(found)?;
        if class == STRUCT && one && depth < DEEPEST {
            self.list_fields(block, values..content.end, &name, depth)?;
        }
        Ok(())
    }

    fn list_fields(&mut self, block: usize, within: Range<usize>, path: &str, depth: usize) -> Result<()> {
        let length = self.element(block, within.clone())?;
        let size = self.word(block, length.content.start).unwrap_or(0) as usize;
        let names = self.element(block, length.next..within.end)?;
        if size == 0 || size > 256 || names.content.len() / size > MOST_ARRAYS {
            return Err(damaged(format!("the struct {path} has no proper field names")));
        }
        let text = self.blocks[block][names.content.clone()].to_vec();
        let mut at = names.next;
        for name in text.chunks_exact(size) {
            let name = name.split(|b| *b == 0).next().unwrap_or_default();
            let field = self.element(block, at..within.end)?;
            if field.kind != MATRIX {
                return Err(damaged(format!("a field of the struct {path} is not an array")));
            }
            at = field.next;
            let path = format!("{path}/{}", String::from_utf8_lossy(name));
            self.list(block, field.content, &path, depth + 1)?;
        }
        Ok(())
    }

    /// Lists a compressed matrix element by its first bytes. A struct is inflated now, other arrays on request.
    fn list_deflated(&mut self, at: Range<usize>) -> Result<()> {
        let mut start = Vec::new();
        let inflated =
            ZlibDecoder::new(&self.blocks[0][at.clone()]).take(PREFIX as u64).read_to_end(&mut start);
        let length = start.len();
        self.blocks.push(start);
        let block = self.blocks.len() - 1;
        let listed = (|| {
            let tag = self.tag(block, 0..length).ok_or_else(|| damaged("a compressed array is empty"))?;
            if tag.kind != MATRIX {
                return Ok(None);
            }
            let (found, _) = self.header(block, 8..tag.content.end.min(length))?;
            Ok(Some(ArrayPlace { block: 0, at: at.clone(), deflated: true, ..found }))
        })();
        self.blocks.pop();
        // A readable header is enough here: an array that is cut off fails when its values are read.
        match (listed, inflated) {
            (Ok(None), _) => Ok(()),
            (Ok(Some(found)), _) if found.class == STRUCT => {
                let whole = self.inflate(&at)?;
                let content = 0..whole.len();
                self.blocks.push(whole);
                self.list(self.blocks.len() - 1, content, "", 0)
            }
            (Ok(Some(found)), _) => self.keep(found),
            (Err(_), Err(e)) => Err(damaged(e)),
            (Err(e), Ok(_)) => Err(e),
        }
    }

    fn keep(&mut self, found: ArrayPlace) -> Result<()> {
        if found.class == OPAQUE {
            return Ok(());
        }
        if self.arrays.len() >= MOST_ARRAYS {
            return Err(damaged(format!("it holds more than {MOST_ARRAYS} arrays")));
        }
        self.arrays.push(found);
        Ok(())
    }

    /// The inflated bytes of a compressed element behind its tag, and their number.
    fn inflated(&self, at: Range<usize>) -> Result<(impl Read, usize)> {
        let mut decoder = ZlibDecoder::new(&self.blocks[0][at.clone()]);
        let mut tag = [0u8; 8];
        decoder.read_exact(&mut tag).map_err(damaged)?;
        let size: [u8; 4] = [tag[4], tag[5], tag[6], tag[7]];
        let size = if self.big_endian { u32::from_be_bytes(size) } else { u32::from_le_bytes(size) } as usize;
        if size / MOST_DEFLATED > at.len() {
            return Err(Error::input(
                format!("a compressed array claims {size} bytes in {} compressed ones", at.len()),
                "the file is damaged or malicious: download or write it again",
            ));
        }
        Ok((decoder.take(size as u64), size))
    }

    /// Inflates a whole compressed element.
    fn inflate(&self, at: &Range<usize>) -> Result<Vec<u8>> {
        let (mut bytes, size) = self.inflated(at.clone())?;
        let mut whole = host::room("a struct", size)?;
        bytes.read_to_end(&mut whole).map_err(damaged)?;
        if whole.len() < size {
            return Err(damaged(format!("a compressed array ends after {} of {size} bytes", whole.len())));
        }
        Ok(whole)
    }

    /// The values of an array, in the order of the file.
    fn numbers_of(&self, found: &ArrayPlace) -> Result<Numbers<'_>> {
        let count = found.shape.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
        let count = count.ok_or_else(|| damaged("its dimensions do not fit any memory"))?;
        if !(6..=15).contains(&found.class) || found.complex {
            let class = match found.class {
                1 => "a cell array",
                3 => "an object",
                4 => "text",
                5 => "a sparse matrix",
                _ if found.complex => "complex",
                _ => "of an unknown class",
            };
            return Err(Error::input(format!("is {class}, not plain numbers"), "store it as a plain array"));
        }
        if !found.deflated {
            let (_, at) = self.header(found.block, found.at.clone())?;
            let element = self.element(found.block, at..found.at.end)?;
            let bytes = Box::new(&self.blocks[found.block][element.content.clone()]);
            return Numbers::new(bytes, element.content.len(), element.kind, count, self.big_endian);
        }
        let (mut bytes, size) = self.inflated(found.at.clone())?;
        let mut start = Vec::new();
        bytes.by_ref().take(PREFIX as u64).read_to_end(&mut start).map_err(damaged)?;
        // The beginning is read like a file of its own.
        let inner = Matlab5 { blocks: vec![start], big_endian: self.big_endian, arrays: vec![] };
        let start = &inner.blocks[0];
        let (_, at) = inner.header(0, 0..start.len())?;
        let element = inner.tag(0, at..size).filter(|e| e.content.end <= size);
        let element = element.ok_or_else(|| damaged("the values of a compressed array go beyond its end"))?;
        let (length, kind) = (element.content.len(), element.kind);
        // A tag that was read lies within the beginning, so the values begin there or right behind it.
        let known = start.get(element.content.start..).unwrap_or_default().to_vec();
        let bytes = std::io::Cursor::new(known).chain(bytes).take(length as u64);
        Numbers::new(Box::new(bytes), length, kind, count, self.big_endian)
    }
}
