//! Names of the captures of a batch. They depend on the files alone, not on the order in which these are listed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// A capture of a batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// The file or folder.
    pub path: PathBuf,
    /// The name of its result folder: that of the file without its ending. If several files have it, a hash of the path is
    /// added.
    pub name: String,
}

/// One of several equal parts of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 1.
    pub part: u64,
    /// How many parts there are.
    pub of: u64,
}

impl Default for Shard {
    /// All of it.
    fn default() -> Shard {
        Shard { part: 1, of: 1 }
    }
}

impl std::str::FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Shard> {
        let number = |n: &str| n.trim().parse::<u64>().ok();
        let (part, of) = text.split_once('/').map_or((None, None), |(part, of)| (number(part), number(of)));
        match (part, of) {
            (Some(part), Some(of)) if (1..=of).contains(&part) => Ok(Shard { part, of }),
            _ => Err(Error::options(
                format!("the shard is {text:?}"),
                "give a part and the number of parts: 1/8, 2/8, and so on to 8/8",
            )),
        }
    }
}

impl Shard {
    /// Whether a capture of this name belongs to the part. It depends on nothing else, so a capture that is added moves no
    /// other one.
    pub fn holds(self, name: &str) -> bool {
        hash(name.as_bytes()) % self.of == self.part - 1
    }
}

/// Names captures. A file that is listed twice is one capture.
pub fn named(paths: &[PathBuf]) -> Vec<Listed> {
    let mut seen = BTreeSet::new();
    let whole = |path: &PathBuf| std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
    let unlike: Vec<(&PathBuf, PathBuf)> = paths
        .iter()
        .map(|path| (path, whole(path)))
        .filter(|(_, whole)| seen.insert(whole.clone()))
        .collect();
    let mut times = BTreeMap::new();
    unlike.iter().for_each(|(path, _)| *times.entry(stem(path)).or_insert(0) += 1);
    let name = |path: &Path, whole: &Path| match stem(path) {
        stem if times[&stem] > 1 => {
            format!("{stem}-{:08x}", hash(whole.as_os_str().as_encoded_bytes()) as u32)
        }
        stem => stem,
    };
    unlike.iter().map(|(path, whole)| Listed { path: (*path).clone(), name: name(path, whole) }).collect()
}

/// The name of a file without its ending, in letters that every file system takes.
fn stem(path: &Path) -> String {
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    let name = name.map_or_else(|| "capture".into(), |name| name.to_string_lossy().into_owned());
    let plain = |c: char| if c.is_alphanumeric() || "-_+=.,@".contains(c) { c } else { '_' };
    let name: String = name.trim_start_matches('.').chars().map(plain).collect();
    if name.is_empty() { "capture".into() } else { name }
}

/// FNV-1a, with its high bits mixed into the low ones.
pub(super) fn hash(bytes: &[u8]) -> u64 {
    let all = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    (all ^ (all >> 32)) & u64::from(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(all: &[&str]) -> Vec<PathBuf> {
        all.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn names_are_unlike_and_independent_of_the_order() {
        let all =
            named(&paths(&["a/scene.npz", "b/scene.npz", "b/scene.hdf5", "b/other one.npz", "a/scene.npz"]));
        assert_eq!(all.len(), 4, "{all:?}");
        let names: BTreeSet<_> = all.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names.len(), 4, "{names:?}");
        assert!(names.contains("other_one") && names.iter().filter(|n| n.starts_with("scene-")).count() == 3);
        let back = named(&paths(&["b/other one.npz", "b/scene.hdf5", "b/scene.npz", "a/scene.npz"]));
        assert!(all.iter().all(|l| back.contains(l)), "{all:?} {back:?}");
    }

    #[test]
    fn every_name_is_in_one_shard() {
        for of in [1, 2, 3, 7] {
            let mut parts = vec![0; of as usize];
            for name in (0..300).map(|i| format!("capture{i:03}")) {
                let holding: Vec<u64> =
                    (1..=of).filter(|part| Shard { part: *part, of }.holds(&name)).collect();
                assert_eq!(holding.len(), 1, "{name} of {of}");
                parts[holding[0] as usize - 1] += 1;
            }
            assert!(parts.iter().all(|n| n * of > 200 && n * of < 400), "{parts:?}");
        }
    }

    #[test]
    fn shards_are_read_as_they_are_written() {
        assert_eq!("2/3".parse::<Shard>().ok(), Some(Shard { part: 2, of: 3 }));
        for wrong in ["", "1", "0/3", "4/3", "1/0", "-1/3", "a/b", "1/2/3"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong:?}");
        }
    }
}
