//! An n-dimensional array as an npy file stores it: shape, element type, bytes.

use std::fmt;
use std::io::Read;

use half::f16;

use crate::error::{Error, Result};
use crate::host;

/// Element types of numbers and booleans in npy files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    /// Boolean, 8 bits.
    Bool,
    /// Unsigned, 8 bits.
    U8,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 8 bits.
    I8,
    /// Signed, 16 bits.
    I16,
    /// Signed, 32 bits.
    I32,
    /// Signed, 64 bits.
    I64,
    /// Floating point, 16 bits.
    F16,
    /// Floating point, 32 bits.
    F32,
    /// Floating point, 64 bits.
    F64,
}

impl Element {
    const ALL: [(Element, &'static str, usize); 12] = [
        (Element::Bool, "b1", 1),
        (Element::U8, "u1", 1),
        (Element::U16, "u2", 2),
        (Element::U32, "u4", 4),
        (Element::U64, "u8", 8),
        (Element::I8, "i1", 1),
        (Element::I16, "i2", 2),
        (Element::I32, "i4", 4),
        (Element::I64, "i8", 8),
        (Element::F16, "f2", 2),
        (Element::F32, "f4", 4),
        (Element::F64, "f8", 8),
    ];

    fn entry(self) -> (Element, &'static str, usize) {
        Self::ALL.into_iter().find(|e| e.0 == self).unwrap_or(Self::ALL[0])
    }

    /// Bytes per element.
    pub fn size(self) -> usize {
        self.entry().2
    }
}

/// An array element, lossless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// Without a sign.
    Unsigned(u64),
    /// With a sign.
    Signed(i64),
    /// With a fraction.
    Real(f64),
}

impl Number {
    fn real(self) -> f64 {
        match self {
            Number::Unsigned(n) => n as f64,
            Number::Signed(n) => n as f64,
            Number::Real(n) => n,
        }
    }

    /// Nearest signed 64-bit integer, if in range.
    fn whole(self) -> Option<i64> {
        match self {
            Number::Unsigned(n) => i64::try_from(n).ok(),
            Number::Signed(n) => Some(n),
            Number::Real(n) => (n.abs() < 9e18).then_some(n.round() as i64),
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Number::Unsigned(n) => n.fmt(f),
            Number::Signed(n) => n.fmt(f),
            Number::Real(n) => n.fmt(f),
        }
    }
}

/// An array: `bytes` holds `shape.product()` elements, in C order unless `fortran`.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Length along each axis; empty for a single number.
    pub shape: Vec<usize>,
    /// Type of the elements.
    pub element: Element,
    /// Whether the most significant byte of an element comes first.
    pub big_endian: bool,
    /// Whether the first index runs fastest.
    pub fortran: bool,
    /// The elements.
    pub bytes: Vec<u8>,
}

macro_rules! from_slice {
    ($name:ident, $type:ty, $element:ident) => {
        /// A C-order array of the given shape; `values` holds `shape.product()` elements.
        pub fn $name(shape: &[usize], values: &[$type]) -> Array {
            debug_assert_eq!(shape.iter().product::<usize>(), values.len());
            let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            Array {
                shape: shape.to_vec(),
                element: Element::$element,
                big_endian: false,
                fortran: false,
                bytes,
            }
        }
    };
}

impl Array {
    from_slice!(from_f32, f32, F32);
    from_slice!(from_f64, f64, F64);
    from_slice!(from_u16, u16, U16);
    from_slice!(from_u32, u32, U32);
    from_slice!(from_i64, i64, I64);

    /// A C-order array of half precision: the values are rounded.
    pub fn from_f16(shape: &[usize], values: &[f32]) -> Array {
        let bytes = values.iter().flat_map(|v| f16::from_f32(*v).to_le_bytes()).collect();
        Array { shape: shape.to_vec(), element: Element::F16, big_endian: false, fortran: false, bytes }
    }

    /// A C-order array of booleans.
    pub fn from_bool(shape: &[usize], values: &[bool]) -> Array {
        let bytes = values.iter().map(|&v| u8::from(v)).collect();
        Array { shape: shape.to_vec(), element: Element::Bool, big_endian: false, fortran: false, bytes }
    }

    /// Number of elements.
    pub fn count(&self) -> usize {
        self.bytes.len() / self.element.size()
    }

    /// All elements in C order, as float64 (64-bit integers above 2^53 are rounded).
    pub fn to_f64(&self) -> Vec<f64> {
        self.convert(Number::real)
    }

    /// All elements in C order, as float32 (integers above 2^24 are rounded).
    pub fn to_f32(&self) -> Vec<f32> {
        self.convert(|v| v.real() as f32)
    }

    /// All elements in C order; true where not zero.
    pub fn to_bool(&self) -> Vec<bool> {
        self.convert(|v| v.real() != 0.0)
    }

    /// All elements in C order as integers.
    ///
    /// # Errors
    /// The first element that is not a signed 64-bit integer.
    pub fn to_i64(&self) -> std::result::Result<Vec<i64>, Number> {
        self.convert(|v| v.whole().ok_or(v))
    }

    fn convert<T, C: FromIterator<T>>(&self, to: impl Fn(Number) -> T) -> C {
        macro_rules! decode {
            ($type:ty, $number:expr) => {{
                const SIZE: usize = size_of::<$type>();
                let element = |chunk: &[u8]| {
                    let mut bytes = [0u8; SIZE];
                    bytes.copy_from_slice(chunk);
                    if self.big_endian {
                        <$type>::from_be_bytes(bytes)
                    } else {
                        <$type>::from_le_bytes(bytes)
                    }
                };
                if self.fortran && self.shape.len() > 1 {
                    c_order(&self.shape)
                        .map(|i| to($number(element(&self.bytes[i * SIZE..(i + 1) * SIZE]).into())))
                        .collect()
                } else {
                    self.bytes.chunks_exact(SIZE).map(|c| to($number(element(c).into()))).collect()
                }
            }};
        }
        match self.element {
            Element::Bool | Element::U8 => decode!(u8, Number::Unsigned),
            Element::U16 => decode!(u16, Number::Unsigned),
            Element::U32 => decode!(u32, Number::Unsigned),
            Element::U64 => decode!(u64, Number::Unsigned),
            Element::I8 => decode!(i8, Number::Signed),
            Element::I16 => decode!(i16, Number::Signed),
            Element::I32 => decode!(i32, Number::Signed),
            Element::I64 => decode!(i64, Number::Signed),
            Element::F16 => decode!(f16, Number::Real),
            Element::F32 => decode!(f32, Number::Real),
            Element::F64 => decode!(f64, Number::Real),
        }
    }

    /// Reads the contents of an npy file (versions 1 to 3).
    ///
    /// # Errors
    /// `Kind::Input` if it is not an npy file, does not hold numbers, or is not as long as its header says.
    pub fn parse(npy: &[u8]) -> Result<Array> {
        let mut bytes = npy;
        let head = Head::read(&mut bytes)?;
        let left = bytes.len() as u64;
        head.whole(&mut bytes, left)
    }

    /// The contents of an npy file (version 1).
    pub fn to_npy(&self) -> Vec<u8> {
        let (_, code, size) = self.element.entry();
        let order = match (size, self.big_endian) {
            (1, _) => '|',
            (_, true) => '>',
            (_, false) => '<',
        };
        let dims: Vec<String> = self.shape.iter().map(|d| format!("{d},")).collect();
        let fortran = if self.fortran { "True" } else { "False" };
        let dict = format!(
            "{{'descr': '{order}{code}', 'fortran_order': {fortran}, 'shape': ({}), }}",
            dims.join(" ")
        );
        let padding = 63 - (10 + dict.len()) % 64;
        let header = format!("{dict}{}\n", " ".repeat(padding));
        let mut npy = Vec::with_capacity(10 + header.len() + self.bytes.len()); // bounded: as the array that is written
        npy.extend_from_slice(b"\x93NUMPY\x01\x00");
        npy.extend_from_slice(&(header.len() as u16).to_le_bytes());
        npy.extend_from_slice(header.as_bytes());
        npy.extend_from_slice(&self.bytes);
        npy
    }
}

/// The error of elements that cannot be read.
pub fn unread(e: std::io::Error) -> Error {
    Error::input(format!("cannot be read: {e}"), "the file is damaged or cut short: copy or write it again")
}

fn wrong(what: String) -> Error {
    Error::input(what, "write the array again with numpy.savez, as plain numbers")
}

/// Longest header of an npy file, bytes; numpy's have some hundred.
const LONGEST: u64 = 1 << 20;

/// Header of an npy file.
#[derive(Debug, Clone, PartialEq)]
pub struct Head {
    /// Length along each axis; empty for a single number.
    pub shape: Vec<usize>,
    /// Type of the elements.
    pub element: Element,
    /// Whether the most significant byte of an element comes first.
    pub big_endian: bool,
    /// Whether the first index runs fastest.
    pub fortran: bool,
}

impl Head {
    /// Size of the elements in bytes; `None` on overflow.
    fn size(&self) -> Option<usize> {
        self.shape.iter().try_fold(self.element.size(), |n, &d| n.checked_mul(d))
    }

    /// Reads all elements; `left` is their size in bytes. Also reserves the memory of the elements as float64.
    ///
    /// # Errors
    /// `Kind::Input` if they cannot be read or their number differs from the header's, `Kind::Memory` if they do not
    /// fit.
    pub fn whole(self, elements: &mut impl Read, left: u64) -> Result<Array> {
        self.check(left)?;
        let size = left as usize;
        let count = size / self.element.size();
        host::ask("the array", host::bytes(count, self.element.size() + size_of::<f64>()))?;
        let mut bytes = host::filled("the array", size, 0)?;
        elements.read_exact(&mut bytes).map_err(unread)?;
        Ok(self.array(bytes))
    }

    fn array(self, bytes: Vec<u8>) -> Array {
        let Head { shape, element, big_endian, fortran } = self;
        Array { shape, element, big_endian, fortran, bytes }
    }

    /// Whether its elements are this many bytes.
    ///
    /// # Errors
    /// `Kind::Input` if they are not.
    pub fn check(&self, left: u64) -> Result<()> {
        match self.size() {
            Some(size) if size as u64 == left => Ok(()),
            _ => Err(wrong(format!("shape {:?} does not fit {left} bytes of data", self.shape))),
        }
    }

    /// The numbers of these bytes in their order, as [`Array::to_f32`].
    pub fn decode(&self, bytes: &[u8], to: &mut [f32]) {
        match self.element {
            Element::F32 if !self.big_endian => {
                let (all, _) = bytes.as_chunks();
                to.iter_mut().zip(all).for_each(|(to, from)| *to = f32::from_le_bytes(*from));
            }
            Element::U16 if !self.big_endian => {
                let (all, _) = bytes.as_chunks();
                to.iter_mut().zip(all).for_each(|(to, from)| *to = f32::from(u16::from_le_bytes(*from)));
            }
            _ => {
                let list = Head { shape: vec![to.len()], fortran: false, ..self.clone() };
                to.iter_mut().zip(list.array(bytes.to_vec()).to_f32()).for_each(|(to, from)| *to = from);
            }
        }
    }

    /// The next `count` elements as a list.
    ///
    /// # Errors
    /// `Kind::Input` if they cannot be read.
    pub fn part(&self, elements: &mut impl Read, count: usize) -> Result<Array> {
        let mut bytes = host::filled("a part of an array", count * self.element.size(), 0)?;
        elements.read_exact(&mut bytes).map_err(unread)?;
        Ok(Head { shape: vec![count], fortran: false, ..self.clone() }.array(bytes))
    }

    /// Reads the header of an npy file (versions 1 to 3); the elements follow.
    ///
    /// # Errors
    /// `Kind::Input` if it is not an npy file, or does not hold numbers.
    pub fn read(npy: &mut impl Read) -> Result<Head> {
        fn bytes<const N: usize>(npy: &mut impl Read, what: &str) -> Result<[u8; N]> {
            let mut bytes = [0; N];
            npy.read_exact(&mut bytes).map_err(|_| wrong(what.into()))?;
            Ok(bytes)
        }
        const NO_ARRAY: &str = "not an npy array (its first bytes are wrong)";
        const CUT: &str = "the npy header is cut short";
        let [magic @ .., version, _] = bytes::<8>(npy, NO_ARRAY)?;
        if &magic != b"\x93NUMPY" {
            return Err(wrong(NO_ARRAY.into()));
        }
        let length = match version {
            1 => u64::from(u16::from_le_bytes(bytes(npy, CUT)?)),
            2 | 3 => u64::from(u32::from_le_bytes(bytes(npy, CUT)?)),
            version => return Err(wrong(format!("npy version {version} is not known"))),
        };
        let mut header = vec![];
        npy.take(length.min(LONGEST)).read_to_end(&mut header).map_err(|e| wrong(e.to_string()))?;
        if header.len() as u64 != length {
            return Err(wrong(CUT.into()));
        }
        let header = std::str::from_utf8(&header).map_err(|_| wrong("the npy header is not text".into()))?;
        let (element, big_endian) = descr(header)
            .ok_or_else(|| wrong(format!("the element type is not a plain number: {}", header.trim())))?;
        let (fortran, shape) = layout(header)
            .ok_or_else(|| wrong(format!("the npy header cannot be read: {}", header.trim())))?;
        Ok(Head { shape, element, big_endian, fortran })
    }
}

/// The text after `'key':` in the header's Python dictionary.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let after = quoted.iter().find_map(|q| header.find(q).map(|at| &header[at + q.len()..]))?;
    after.trim_start().strip_prefix(':').map(str::trim_start)
}

fn descr(header: &str) -> Option<(Element, bool)> {
    let text = value(header, "descr")?;
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    let text = text[1..].split(quote).next()?;
    let (order, code) = (text.get(..1)?, text.get(1..)?);
    let element = Element::ALL.into_iter().find(|e| e.1 == code)?.0;
    matches!(order, "<" | ">" | "|" | "=").then_some((element, order == ">"))
}

fn layout(header: &str) -> Option<(bool, Vec<usize>)> {
    let fortran = match value(header, "fortran_order")? {
        text if text.starts_with("True") => true,
        text if text.starts_with("False") => false,
        _ => return None,
    };
    let shape = value(header, "shape")?.strip_prefix('(')?.split(')').next()?;
    let dims = shape.split(',').map(str::trim).filter(|d| !d.is_empty());
    let dims = dims.map(|d| d.trim_end_matches('L').parse().ok()).collect::<Option<Vec<usize>>>()?;
    Some((fortran, dims))
}

/// Positions of the elements of an array whose first index runs fastest, in C order. `shape`: length along each axis.
pub fn c_order(shape: &[usize]) -> impl Iterator<Item = usize> + '_ {
    let mut strides = vec![1usize; shape.len()]; // bounded: axes
    for axis in 1..shape.len() {
        strides[axis] = strides[axis - 1] * shape[axis - 1];
    }
    let mut index = vec![0usize; shape.len()]; // bounded: axes
    let mut at = 0usize;
    (0..shape.iter().product()).map(move |_: usize| {
        let here = at;
        for axis in (0..index.len()).rev() {
            index[axis] += 1;
            at += strides[axis];
            if index[axis] < shape[axis] {
                break;
            }
            at -= strides[axis] * index[axis];
            index[axis] = 0;
        }
        here
    })
}

/// Transposes `rows` x `columns` values, in tiles that fit the cache.
///
/// # Errors
/// `Kind::Memory` if they do not fit.
pub fn transpose(values: &[f32], rows: usize, columns: usize) -> Result<Vec<f32>> {
    const TILE: usize = 32;
    let mut out = host::filled("the counts", values.len(), 0.0)?;
    for r0 in (0..rows).step_by(TILE) {
        for c0 in (0..columns).step_by(TILE) {
            for r in r0..(r0 + TILE).min(rows) {
                for c in c0..(c0 + TILE).min(columns) {
                    out[c * rows + r] = values[r * columns + c];
                }
            }
        }
    }
    Ok(out)
}
