//! What a file is, by its first bytes.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::error::{Error, Result};

/// The first bytes of an HDF5 file.
pub const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";

/// The kind of a file, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Contents {
    Zip,
    Hdf5,
    Matlab5,
    Matlab4,
    Npy,
    Folder,
    Unknown,
}

/// What the file at `path` is.
///
/// # Errors
/// `Kind::Input` if it cannot be read, is empty, no regular file, or a cut HDF5 file.
pub(super) fn of(path: &Path) -> Result<Contents> {
    let unreadable = |e: std::io::Error| {
        let hint = match e.kind() {
            std::io::ErrorKind::NotFound => "check the path: there is no such file",
            std::io::ErrorKind::PermissionDenied => "make the file readable for you",
            _ => "check the path and the disk",
        };
        Error::input(format!("cannot be read: {e}"), hint)
    };
    let meta = std::fs::metadata(path).map_err(unreadable)?;
    if meta.is_dir() {
        return Ok(Contents::Folder);
    }
    if !meta.is_file() {
        return Err(Error::input("is not a regular file", "copy the capture to a file first"));
    }
    if meta.len() == 0 {
        return Err(Error::input("is empty", "copy or write the file again"));
    }
    let mut file = File::open(path).map_err(unreadable)?;
    let mut head = [0u8; 128];
    let mut length = 0;
    while length < head.len() {
        match file.read(&mut head[length..]).map_err(unreadable)? {
            0 => break,
            n => length += n,
        }
    }
    let head = &head[..length];
    if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
        return Ok(Contents::Zip);
    }
    if head.starts_with(b"\x93NUMPY") {
        return Ok(Contents::Npy);
    }
    // HDF5 may begin after a user block of 512, 1024, 2048 ... bytes (MATLAB v7.3: 512).
    let mut at = 0u64;
    while at + 8 <= meta.len() && at <= 1 << 20 {
        let mut start = Vec::new();
        file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        (&mut file).take(64).read_to_end(&mut start).map_err(unreadable)?;
        if start.starts_with(HDF5) {
            return match hdf5_end(&start) {
                Some(end) if end > meta.len() => Err(Error::input(
                    format!("the HDF5 file is cut short: {} of {end} bytes", meta.len()),
                    "the file is damaged: copy or download it again",
                )),
                _ => Ok(Contents::Hdf5),
            };
        }
        at = if at == 0 { 512 } else { at * 2 };
    }
    let version_5 = matches!(head.get(124..128), Some(b"\x00\x01IM" | b"\x01\x00MI"));
    Ok(match () {
        () if version_5 || head.starts_with(b"MATLAB 5.0") => Contents::Matlab5,
        () if is_version_4(head) => Contents::Matlab4,
        () => Contents::Unknown,
    })
}

/// Whether these bytes begin a matrix of MATLAB version 4: its type (machine, 0, precision, kind), rows, columns, whether it is
/// complex, and the length of its name.
fn is_version_4(head: &[u8]) -> bool {
    let of = |word: fn([u8; 4]) -> u32| {
        let all = head.get(..20)?.chunks_exact(4).map(|b| word([b[0], b[1], b[2], b[3]]));
        let all: Vec<u32> = all.collect();
        let kind = all[0];
        let digits = [kind / 1000, kind / 100 % 10, kind / 10 % 10, kind % 10];
        let good = digits[0] <= 4 && digits[1] == 0 && digits[2] <= 5 && digits[3] <= 2 && all[3] <= 1;
        let length = usize::try_from(all[4]).ok()?;
        let name = head.get(20..20 + length.checked_sub(1)?)?;
        let named =
            (2..=64).contains(&length) && name.iter().all(|c| c.is_ascii_alphanumeric() || *c == b'_');
        Some(good && named)
    };
    [u32::from_le_bytes, u32::from_be_bytes].into_iter().any(|word| of(word) == Some(true))
}

/// The error of a file of MATLAB version 4.
pub(super) fn version_4() -> Error {
    Error::input(
        "is a MATLAB version 4 file, which holds matrices of two axes only",
        "write it in version 5: save NAME -v7 in MATLAB, or scipy.io.savemat(NAME, scipy.io.loadmat(NAME))",
    )
}

/// The length of an HDF5 file according to its superblock, which the HDF5 reader does not check; `None` if unknown.
fn hdf5_end(superblock: &[u8]) -> Option<u64> {
    let at = match (superblock.get(8)?, superblock.get(13)?, superblock.get(9)?) {
        (0, 8, _) => 40,
        (1, 8, _) => 44,
        (2 | 3, _, 8) => 28,
        _ => return None,
    };
    Some(u64::from_le_bytes(superblock.get(at..at + 8)?.try_into().ok()?))
}
