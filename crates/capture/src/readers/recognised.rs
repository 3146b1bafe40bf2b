//! Recognises files of instruments that are no captures by their first bytes, first lines or file name extension.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::hdf5::Hdf5;
use crate::error::{Error, Result};
use crate::files::archive::Npz;

/// Content of a file of an instrument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Time tags that are read.
    Tags,
    /// Histograms that are read.
    Histograms(HistogramFormat),
    /// A format that is not read.
    Other,
}

/// Format of histograms of an instrument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HistogramFormat {
    /// PicoQuant's unified format.
    Phu,
    /// PicoHarp's text: header lines, then a row for each bin and a column for each point.
    PicoHarp,
    /// LabVIEW's measurement file.
    LabView,
    /// Text of a TMF8820 or TMF8828: `#Raw,` lines.
    Zones,
    /// JSON of a TMF8829, also packed with gzip.
    Tmf8829,
    /// Compact normalised histograms of a VL53L8CH: a table, or printed aggregates.
    Cnh,
    /// A table of numbers.
    Matrix,
}

/// A row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Recognised {
    /// Name of the format with its article.
    pub name: &'static str,
    /// Its content.
    pub content: Content,
    is: fn(&FileStart) -> bool,
    /// What to do with a format that is not read.
    instead: &'static str,
}

/// Beginning of a file.
struct FileStart {
    bytes: Vec<u8>,
    /// Lower-case lines of text, empty for binary files.
    lines: Vec<String>,
    ending: String,
}

/// First bytes of PNG, JPEG, GIF, TIFF (two orders) and OpenEXR.
const PICTURES: [&[u8]; 6] =
    [b"\x89PNG\r\n", b"\xff\xd8\xff", b"GIF8", b"II*\0", b"MM\0*", b"\x76\x2f\x31\x01"];

/// Times of a table: as many at least, and steps that differ by a smaller share.
const LEAST_TIMES: usize = 16;
const EVEN: f64 = 0.01;

/// Names in the log of a TMF8829.
const LOG_WORDS: [&str; 3] = ["\"result_set\"", "\"mp_histo", "\"bin_shift\""];

/// First bytes of what gzip packed.
pub const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Names of arrays of time tags, the first is what Swabian calls it. Case does not matter, and groups before them do not.
pub const TIMES: [&str; 8] =
    ["timestamps", "timestamp", "timestamps_ps", "times", "times_ps", "time", "time_tags", "timetags"];
/// Those of channels.
pub const CHANNELS: [&str; 3] = ["channels", "channel", "channel_ids"];
/// Those of delays in Photon-HDF5.
pub const NANOTIMES: [&str; 1] = ["nanotimes"];

/// Bytes that are looked at.
const LOOKED_AT: u64 = 1 << 15;
const CONVERT: &str =
    "save it as .ptu in the instrument's software, or export the tags as text or arrays (channel, time)";
/// Reads a table of numbers between commas, spaces or tabulators, without lines of words.
const LOAD_TEXT: &str = r#"np.loadtxt([s.replace(",", " ") for s in open("FILE") if s.lstrip()[:1] in "+-.0123456789"], ndmin=2)"#;
const FROM_SOFTWARE: &str = "export the histograms as text (a row for each bin, a column for each point) or as an npy array [points, bins]";

const fn row(
    name: &'static str,
    content: Content,
    is: fn(&FileStart) -> bool,
    instead: &'static str,
) -> Recognised {
    Recognised { name, content, is, instead }
}

const ROWS: [Recognised; 20] = [
    row(
        "a pointer of Git LFS in place of the file",
        Content::Other,
        |h| h.bytes.starts_with(b"version https://git-lfs"),
        "fetch the file itself: git lfs pull",
    ),
    row(
        "a picture",
        Content::Other,
        |h| PICTURES.iter().any(|start| h.bytes.starts_with(start)),
        "give the histograms of the scan: a picture holds none",
    ),
    row("PicoQuant time tags (.ptu)", Content::Tags, |h| h.bytes.starts_with(b"PQTTTR"), ""),
    row(
        "PicoQuant histograms (.phu)",
        Content::Histograms(HistogramFormat::Phu),
        |h| h.bytes.starts_with(b"PQHISTO"),
        "",
    ),
    row(
        "PicoHarp 300 time tags (.pt3 or .pt2)",
        Content::Other,
        |h| h.bytes.starts_with(b"PicoHarp 300\0"),
        CONVERT,
    ),
    row(
        "HydraHarp time tags (.ht3 or .ht2)",
        Content::Other,
        |h| h.bytes.starts_with(b"HydraHarp\0"),
        CONVERT,
    ),
    row(
        "PicoHarp histograms as text",
        Content::Histograms(HistogramFormat::PicoHarp),
        |h| h.has("#ns/bin"),
        "",
    ),
    row(
        "a LabVIEW measurement (.lvm)",
        Content::Histograms(HistogramFormat::LabView),
        |h| h.lines.first().is_some_and(|line| line.starts_with("labview measurement")),
        "",
    ),
    row(
        "histograms of a TMF8820 or TMF8828 as text",
        Content::Histograms(HistogramFormat::Zones),
        |h| h.has("#raw,"),
        "",
    ),
    row(
        "a log of a TMF8829",
        Content::Histograms(HistogramFormat::Tmf8829),
        |h| h.has("{") && LOG_WORDS.iter().any(|word| h.holds(word)),
        "",
    ),
    row(
        "histograms of a VL53L8CH",
        Content::Histograms(HistogramFormat::Cnh),
        |h| {
            h.holds("cnh__hist_bin_")
                || h.lines.iter().any(|line| line.starts_with("aggregate ") && line.contains("bins:"))
        },
        "",
    ),
    row(
        "a table of a TMF8829's log (#RAWBIN)",
        Content::Other,
        |h| h.has("#rawbin,"),
        "give the log that the table was made of (.json or .json.gz) to `histogram`",
    ),
    row("time tags as text", Content::Tags, FileStart::names_tags, ""),
    row(
        "a table of times and counts",
        Content::Histograms(HistogramFormat::Matrix),
        FileStart::is_of_times,
        "",
    ),
    row("a text of numbers", Content::Tags, |h| matches!(h.columns(), 2 | 3), ""),
    row("a text of numbers", Content::Histograms(HistogramFormat::Matrix), |h| h.columns() > 0, ""),
    row("Becker & Hickl histograms (.sdt)", Content::Other, |h| h.ending == "sdt", FROM_SOFTWARE),
    row(
        "Becker & Hickl time tags (.spc)",
        Content::Other,
        |h| h.ending == "spc",
        "read it with tttrlib and store its macro times, channels and markers as arrays of an npz (phconvert 0.10 leaves markers out)",
    ),
    row(
        "Swabian time tags (.ttbin), whose format is not public",
        Content::Other,
        |h| h.ending == "ttbin",
        "read it with Swabian's FileReader and store getTimestamps and getChannels as the arrays timestamps and channels of an npz",
    ),
    row(
        "a raw dump (.bin), which does not say what it holds",
        Content::Other,
        |h| h.ending == "bin",
        "store the tags as the arrays timestamps (picoseconds) and channels of an npz, or histograms as an npy array [points, bins]",
    ),
];

impl FileStart {
    fn has(&self, start: &str) -> bool {
        self.lines.iter().any(|line| line.starts_with(start))
    }

    fn holds(&self, word: &str) -> bool {
        self.lines.iter().any(|line| line.contains(word))
    }

    /// Whether a line names a column of channels and one of times.
    fn names_tags(&self) -> bool {
        let first = self.lines.iter().position(|line| !line.starts_with('#')).unwrap_or(0);
        let names = |line: &String| {
            line.contains("chan")
                && ["time", "stamp", "tag"].iter().any(|word| line.contains(word))
                && !line.contains(':')
        };
        self.lines.iter().take(first + 1).any(names)
            && self.columns() > 0
            && !(self.columns() > 2 && self.is_of_times())
    }

    /// Columns of the first line of numbers; 0 without one.
    fn columns(&self) -> usize {
        self.rows().next().map_or(0, |row| row.len())
    }

    /// Whether the first column rises evenly: times of bins, not of photons, and no channel. Behind the numbers of tags comes a column
    /// of rising times; histograms fall, too.
    fn is_of_times(&self) -> bool {
        let rows: Vec<Vec<f64>> = self.rows().collect();
        let column =
            |at: usize| rows.iter().filter_map(move |row| row.get(at).copied()).collect::<Vec<f64>>();
        let times = column(0);
        let step = times.get(1).zip(times.first()).map_or(0.0, |(b, a)| b - a);
        let is_even = |w: &[f64]| ((w[1] - w[0]) / step - 1.0).abs() < EVEN;
        let rises = |at: usize| {
            let values = column(at);
            values.windows(2).all(|w| w[1] >= w[0]) && values.first() < values.last()
        };
        let columns = self.columns();
        columns >= 2
            && times.len() >= LEAST_TIMES
            && step > 0.0
            && times.windows(2).all(is_even)
            && (columns == 2 || !(1..columns).any(rises))
    }

    /// Lines of numbers.
    fn rows(&self) -> impl Iterator<Item = Vec<f64>> {
        let row = |line: &String| -> Option<Vec<f64>> {
            let separator = [';', '\t', ','].into_iter().find(|s| line.contains(*s)).unwrap_or(' ');
            let parts = line.split(separator).map(|part| part.trim_matches([' ', '"', '\'']));
            let parts = parts.filter(|part| !part.is_empty());
            parts.map(|part| part.replacen(',', ".", 1).parse().ok()).collect()
        };
        self.lines.iter().filter(|line| !line.starts_with('#')).filter_map(row)
    }
}

/// Whether a file holds time tags, by its content.
pub fn hold_tags(path: &Path) -> bool {
    let known = || of(path).ok().flatten();
    path.is_file() && tags_in_arrays(path).or_else(known).is_some_and(|known| known.content == Content::Tags)
}

/// An npz or HDF5 file whose arrays are time tags by their names.
pub(super) fn tags_in_arrays(path: &Path) -> Option<Recognised> {
    let (names, is_hdf5) = match Npz::open(path) {
        Ok(npz) => (npz.names(), false),
        Err(_) => (Hdf5::open(path).ok()?.names(), true),
    };
    let last = |name: &String| name.rsplit('/').next().unwrap_or_default().to_lowercase();
    let one = |known: &[&str]| names.iter().filter(|name| known.contains(&last(name).as_str())).count() == 1;
    let are_tags = one(&TIMES) && (one(&CHANNELS) || is_hdf5 && one(&NANOTIMES));
    are_tags.then(|| row("time tags as arrays", Content::Tags, |_| false, ""))
}

/// The row of a file; `None` if no row fits.
///
/// # Errors
/// `Kind::Input` if the file cannot be read.
pub fn of(path: &Path) -> Result<Option<Recognised>> {
    let mut bytes = vec![];
    File::open(path)
        .and_then(|file| file.take(LOOKED_AT).read_to_end(&mut bytes))
        .map_err(|e| Error::input(format!("cannot be read: {e}"), "check the path and the disk"))?;
    if bytes.starts_with(&GZIP) {
        // What is damaged, or cut here, is read as far as it goes. Nothing else is read packed.
        let mut inner = vec![];
        let _ = flate2::read::GzDecoder::new(&bytes[..]).take(LOOKED_AT).read_to_end(&mut inner);
        if LOG_WORDS.iter().any(|word| String::from_utf8_lossy(&inner).to_lowercase().contains(word)) {
            bytes = inner;
        }
    }
    // Text of 8 or 16 bits, with or without a byte-order mark.
    let plain: Vec<u8> = bytes
        .iter()
        .copied()
        .filter(|b| *b != 0)
        .skip_while(|b| [0xEF, 0xBB, 0xBF, 0xFE, 0xFF].contains(b))
        .collect();
    let is_text = 2 * plain.len() + 4 > bytes.len()
        && plain.iter().all(|b| !b.is_ascii_control() || b.is_ascii_whitespace());
    let lines = if is_text { String::from_utf8_lossy(&plain).to_lowercase() } else { String::new() };
    let mut lines: Vec<String> = lines
        .split(['\n', '\r'])
        .map(|line| line.trim().to_string())
        .filter(|line| !line.is_empty())
        .collect();
    // The last line may be cut.
    if lines.len() > 1 && bytes.len() as u64 == LOOKED_AT {
        lines.pop();
    }
    let ending = path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
    let head = FileStart { bytes, lines, ending };
    Ok(ROWS.into_iter().find(|row| (row.is)(&head)))
}

impl Recognised {
    /// The error of a file that is read elsewhere or not at all.
    pub fn refusal(&self) -> Error {
        match self.content {
            Content::Other => Error::input(format!("holds {}, which is not read", self.name), self.instead),
            _ if self.name == "a text of numbers" => super::counts::alone(
                "is a text of numbers, without wall points and bin width",
                LOAD_TEXT,
                &[0, 0],
            ),
            Content::Histograms(HistogramFormat::Matrix) => Error::input(
                format!("holds {}, one histogram a column, without the wall points of a capture", self.name),
                "make a capture of it with the points of the scan, a line x,y,z for each column: thirdbounce histogram FILE --scan POINTS \
                 --bin-width 32ps --zero 0ps --out capture.npz (path 0 is at the wall)",
            ),
            _ => Error::input(
                format!("holds {}, without the wall points of a capture", self.name),
                match self.content {
                    Content::Tags => {
                        "make a capture of it with the points of the scan: thirdbounce info FILE prints the command"
                    }
                    _ => "make a capture of it with the points of the scan: thirdbounce histogram",
                },
            ),
        }
    }
}
