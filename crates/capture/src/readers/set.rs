//! The files of a capture: a single one, or those of a folder that belong together.

use std::path::{Path, PathBuf};

use super::variables::Variables;
use crate::error::{Error, Result};

/// Largest number of files of a folder that are opened.
const MOST_FILES: usize = 256;

/// A file of a folder belongs to a capture if it has an array of one of these names.
const KNOWN: [&str; 14] = [
    "meas",
    "measlr",
    "tofgridlr",
    "tofgrid",
    "C_i",
    "C_d",
    "sub_Sig",
    "laserpoints",
    "detectpoints",
    "data",
    "counts",
    "peak1",
    "peak2",
    "dataset/data",
];

/// Opened files.
pub struct Set {
    path: PathBuf,
    folder: bool,
    files: Vec<(PathBuf, Variables)>,
}

impl Set {
    /// The file at `path`, or the files of the folder at `path` that hold arrays of a known name.
    ///
    /// # Errors
    /// `Kind::Input` if it cannot be read, or if no file of the folder holds such an array. Where none does, the first
    /// damaged file is reported.
    pub fn open(path: &Path) -> Result<Set> {
        let mut set = Set { path: path.to_path_buf(), folder: path.is_dir(), files: vec![] };
        if !set.folder {
            set.files.push((path.to_path_buf(), Variables::open(path)?));
            return Ok(set);
        }
        let listed = std::fs::read_dir(path)
            .map_err(|e| Error::input(format!("cannot be read: {e}"), "check the path"))?;
        let mut files: Vec<PathBuf> = listed.flatten().map(|entry| entry.path()).collect();
        files.sort();
        let mut damaged = None;
        let of_use = |p: &PathBuf| p.is_file() && ends_in(p, &["mat", "hdf5", "h5"]);
        for file in files.into_iter().filter(of_use).take(MOST_FILES) {
            // Others may hold the capture: a damaged file counts only where none does.
            let variables = match Variables::open(&file) {
                Ok(variables) => variables,
                Err(e) => {
                    damaged.get_or_insert(e.at(file.display()));
                    continue;
                }
            };
            if variables.names().iter().any(|n| KNOWN.contains(&n.as_str())) {
                set.files.push((file, variables));
            }
        }
        if let (true, Some(error)) = (set.files.is_empty(), damaged) {
            return Err(error);
        }
        if set.files.is_empty() {
            return Err(Error::input(
                "is a folder without the .mat or .hdf5 files of a capture",
                "give the capture file inside it; formats of several files are Stanford f-k (meas, tofgrid), \
                 CC-SOCR (C_i, C_d, sub_Sig) and General-NLOS (data, laserpoints, detectpoints)",
            ));
        }
        Ok(set)
    }

    /// The file that holds an array, `None` if there is none.
    ///
    /// # Errors
    /// `Kind::Input` if several do.
    pub fn holding(&self, name: &str) -> Result<Option<&Variables>> {
        let all: Vec<_> = self.files.iter().filter(|(_, file)| file.have(&[name])).collect();
        match all[..] {
            [] => Ok(None),
            [(_, file)] => Ok(Some(file)),
            _ => {
                let names: Vec<_> = all.iter().map(|(path, _)| file_name(path)).collect();
                Err(Error::input(
                    format!("the folder holds {} files with {name}: {}", names.len(), names.join(", ")),
                    "give the path of the right one",
                ))
            }
        }
    }

    /// Adds the files of these names that lie beside the given file. Does nothing for a folder, whose files are all
    /// known.
    ///
    /// # Errors
    /// `Kind::Input` if one of them is damaged.
    pub fn add_beside(&mut self, names: &[String]) -> Result<()> {
        if self.folder {
            return Ok(());
        }
        for path in names.iter().map(|name| self.beside(name)).collect::<Vec<_>>() {
            let known = self.files.iter().any(|(p, _)| *p == path);
            if !known && path.is_file() {
                self.add(&path)?;
            }
        }
        Ok(())
    }

    /// The path of a file of this name in the folder that was given, or beside the file.
    pub fn beside(&self, name: &str) -> PathBuf {
        let folder = if self.folder { Some(self.path.as_path()) } else { self.path.parent() };
        folder.unwrap_or(Path::new("")).join(name)
    }

    /// Adds a file.
    ///
    /// # Errors
    /// `Kind::Input`, with its path, if it cannot be read.
    pub fn add(&mut self, path: &Path) -> Result<()> {
        let file = Variables::open(path).map_err(|e| e.at(path.display()))?;
        self.files.push((path.to_path_buf(), file));
        Ok(())
    }

    /// The name of the file that was given, empty for a folder.
    pub fn name(&self) -> String {
        if self.folder { String::new() } else { file_name(&self.path) }
    }

    /// The first file: the only one, unless a folder was given.
    pub fn first(&self) -> Option<&Variables> {
        self.files.first().map(|(_, file)| file)
    }

    /// Whether any file holds an array of that name.
    pub fn any(&self, name: &str) -> bool {
        self.files.iter().any(|(_, file)| file.have(&[name]))
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

fn ends_in(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|e| endings.iter().any(|known| e.eq_ignore_ascii_case(known)))
}
