//! Time tags in place of a capture: what they hold, and the captures of all verbs that are made of them.

use std::path::Path;

use glam::DVec3;
use thirdbounce::capture::Turn;
use thirdbounce::job::{self, Loaded, Request};
use thirdbounce::options::units::{length, number, time};
use thirdbounce::{Error, Result};
use thirdbounce_tags::{self as tags, Asked, Division, Inputs, PileUp, Readings, Scan, Zero};

use crate::histogram;
use crate::instrument::{Instrument, instrument};

use super::settings::{self, ALL, DeviceArgs, SettingsArgs};
use super::tables;
use super::terminal::json;

/// How time tags become histograms.
#[derive(clap::Args)]
pub struct FromTags {
    /// Points in the order in which they were measured: columns x rows of a flat wall (64x64, with --wall), row by row from
    /// the lowest left; or a text file with x, y, z of each in metres, or of its laser point and its sensor point
    #[arg(long, value_name = "NXxNY|FILE", help_heading = "Time tags")]
    scan: Option<String>,
    /// Where laser and sensor stand: x,y,z for both or x,y,z,x,y,z, each a length (30cm, metres as a plain number). The wall's
    /// shape then comes from its own returns: each point moves along the laser's beam to where its direct light comes from
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "Time tags")]
    seen_from: Option<String>,
    /// Every other row of the grid runs backwards
    #[arg(long, help_heading = "Time tags")]
    snake: bool,
    /// The grid was measured column by column from the left, each from the lowest point; with --snake every other from the top
    #[arg(long, help_heading = "Time tags")]
    by_columns: bool,
    /// This marker, from 1, begins each point
    #[arg(long, value_name = "MARKER", help_heading = "Time tags")]
    pixels: Option<u32>,
    /// These markers begin and end each line; its points take equal shares of it. Without the second, the next line's begin is the
    /// end [default: those in the file's header, if it has any]
    #[arg(
        long,
        value_name = "BEGIN,END",
        value_delimiter = ',',
        conflicts_with = "pixels",
        help_heading = "Time tags"
    )]
    lines: Vec<u32>,
    /// Time of a line's points after its begin, where no marker ends it [default: that of the header, or until photons cease]
    #[arg(long, value_name = "TIME", value_parser = time, help_heading = "Time tags")]
    line_time: Option<f64>,
    /// Points by which photons of every second line come late, in scans with --snake [default: an estimate]
    #[arg(long, value_name = "POINTS", value_parser = number, help_heading = "Time tags")]
    line_shift: Option<f64>,
    /// Lines (with --pixels: points) of each round before those of the scan, which are left out
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        conflicts_with = "pulses_per_point",
        help_heading = "Time tags"
    )]
    lines_before: u16,
    /// This marker begins each round of all points; rounds are added up
    #[arg(long, value_name = "MARKER", help_heading = "Time tags")]
    rounds: Option<u32>,
    /// Every point has N laser pulses, one after the other
    #[arg(long, value_name = "N", conflicts_with_all = ["pixels", "lines", "rounds"], help_heading = "Time tags")]
    pulses_per_point: Option<u64>,
    /// Laser pulses before the first point
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        requires = "pulses_per_point",
        help_heading = "Time tags"
    )]
    pulses_before: u64,
    /// The detector's channel [default: the only one with photons]
    #[arg(long, value_name = "N", help_heading = "Time tags")]
    channel: Option<i32>,
    /// The channel of the laser pulses in text and arrays
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Time tags")]
    sync_channel: i32,
    /// Channels of markers in text and arrays: the first is marker 1
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', help_heading = "Time tags")]
    marker_channels: Vec<i32>,
    /// Unit of times in text and arrays, such as 1ns [default: that in the column's name, or 1ps]
    #[arg(long, value_name = "TIME", value_parser = time, help_heading = "Time tags")]
    tag_unit: Option<f64>,
    /// Records of a .ptu file whose header is wrong
    #[arg(long, value_name = "t2|t3", value_parser = ["t2", "t3"], help_heading = "Time tags")]
    records: Option<String>,
    /// The file holds every Nth laser pulse; not for T3 records [default: as the header says, or 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024), help_heading = "Time tags")]
    sync_divider: Option<u32>,
    /// Time between laser pulses, where the file holds only the pulse after each photon (a conditional filter)
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "sync_divider", help_heading = "Time tags")]
    sync_after: Option<f64>,
    /// What is path 0: direct, each point's peak of light from the wall itself, which removes both legs; or a delay after the laser
    /// pulse, such as 12.5ns, for all points
    #[arg(long, value_name = "direct|TIME", default_value = "direct", help_heading = "Time tags")]
    zero: String,
    /// Leave out photons later than this after their laser pulse, such as 40ns
    #[arg(long, value_name = "TIME", value_parser = time, help_heading = "Time tags")]
    until: Option<f64>,
    /// Use this reading of an instrument's own histograms, from 0, such as a frame of the log of a TMF8829 or VL53L8CH [default: all,
    /// added up]
    #[arg(long, value_name = "N", help_heading = "Time tags")]
    reading: Option<usize>,
    /// Whether pile-up is taken out when the capture is read; auto: if no laser pulse gave two photons
    #[arg(long, value_name = "auto|on|off", default_value = "auto", value_parser = ["auto", "on", "off"],
        help_heading = "Time tags")]
    pile_up: String,
}

impl FromTags {
    /// Text or JSON on what a file of time tags holds, without a scan; `None` of a capture.
    ///
    /// # Errors
    /// Those of [`instrument`].
    pub fn shown(&self, path: &Path, as_json: bool) -> Result<Option<String>> {
        if self.are_given() || !tags::hold_tags(path) {
            return Ok(None);
        }
        let found = instrument(path, self.inputs())?;
        Ok(Some(if as_json { json(&found)? } else { about(&found) }))
    }

    /// Whether a capture is to be made of time tags.
    fn are_given(&self) -> bool {
        self.scan.is_some()
    }

    /// The scan. A grid needs the wall's size.
    pub fn scan(&self, wall: Option<f64>) -> Result<Scan> {
        let text = self.scan.as_deref().ok_or_else(|| {
            Error::options(
                "it is not known where the points of the scan are",
                "give --scan 64x64 with --wall 2m, or --scan with a file of points",
            )
        })?;
        let grid =
            text.split_once(['x', 'X', '×']).and_then(|(nx, ny)| Some([nx.parse().ok()?, ny.parse().ok()?]));
        match (grid, wall) {
            (Some(grid), Some(wall)) if self.by_columns => Scan::by_columns(grid, wall, self.snake),
            (Some(grid), Some(wall)) => Scan::grid(grid, wall, self.snake),
            (Some(_), None) => Err(Error::options(
                format!("--scan {text} does not say how large the scan is"),
                "give the distance of its outermost points: --wall 2m",
            )),
            (None, _) if self.snake || self.by_columns => Err(Error::options(
                "--snake or --by-columns was given with a file of points",
                "leave it out: the file has the points in their order",
            )),
            (None, Some(_)) => Err(Error::options(
                "--wall was given with a file of points",
                "leave it out: the points say how large the scan is",
            )),
            (None, None) => Scan::read(Path::new(text)),
        }
    }

    /// How tags become histograms.
    pub fn asked(&self, bin_width: Option<f64>, turn: Turn) -> Result<Asked> {
        let frame = self.rounds;
        let division = match (self.pixels, &self.lines[..], self.pulses_per_point) {
            (Some(marker), ..) => Some(Division::Pixels { marker, frame }),
            (_, &[start], ..) => Some(Division::Lines { start, stop: None, frame }),
            (_, &[start, stop], ..) => Some(Division::Lines { start, stop: Some(stop), frame }),
            (_, [_, _, ..], ..) => {
                return Err(Error::options(
                    format!("--lines is {:?}", self.lines),
                    "give two markers: --lines 1,2",
                ));
            }
            (_, _, Some(each)) => Some(Division::Pulses { each, before: self.pulses_before }),
            _ => None,
        };
        if let (None, Some(frame)) = (&division, frame) {
            return Err(Error::options(
                format!("--rounds {frame} was given, but not what begins points or lines"),
                "give --pixels or --lines, too",
            ));
        }
        let zero = match self.zero.as_str() {
            "direct" => Zero::Direct,
            text => Zero::At(time(text).map_err(|hint| {
                Error::options(format!("--zero is {text:?}"), format!("give direct, or {}", &hint[5..]))
            })?),
        };
        let pile_up = match self.pile_up.as_str() {
            "on" => PileUp::On,
            "off" => PileUp::Off,
            _ => PileUp::Auto,
        };
        Ok(Asked {
            inputs: self.inputs(),
            division,
            line_time: self.line_time,
            line_shift: self.line_shift,
            lines_before: self.lines_before.into(),
            channel: self.channel,
            bin_width,
            zero,
            until: self.until,
            pile_up,
            turn,
            seen_from: self.seen_from()?,
            readings: self.reading.map_or(Readings::Sum, Readings::One),
        })
    }

    /// How the file is to be read.
    fn inputs(&self) -> Inputs {
        Inputs {
            sync: self.sync_channel,
            markers: self.marker_channels.clone(),
            unit: self.tag_unit,
            divider: self.sync_divider,
            filtered: self.sync_after,
            t3: self.records.as_ref().map(|records| records == "t3"),
        }
    }

    /// Reads a capture, or makes one of time tags, as the options say.
    pub fn load(
        &self,
        path: &Path,
        settings: &SettingsArgs<ALL>,
        device: &DeviceArgs,
    ) -> Result<(Loaded, Request)> {
        if !self.are_given() && !tags::hold_tags(path) {
            return settings::load(path, settings, device);
        }
        let request = settings::request(settings, device)?;
        let scan = self.scan(request.settings.wall)?;
        let asked = self.asked(request.settings.bin_width, job::turn(&request.settings)?)?;
        Ok((histogram::load_tags(path, &request.settings, &scan, &asked)?, request))
    }

    /// Where laser and sensor stand.
    fn seen_from(&self) -> Result<Option<[DVec3; 2]>> {
        let Some(text) = &self.seen_from else { return Ok(None) };
        let numbers: Vec<f64> = text.split(',').filter_map(|part| length(part).ok()).collect();
        match numbers[..] {
            _ if numbers.len() != text.split(',').count() => {}
            [x, y, z] => return Ok(Some([DVec3::new(x, y, z); 2])),
            [a, b, c, x, y, z] => return Ok(Some([DVec3::new(a, b, c), DVec3::new(x, y, z)])),
            _ => {}
        }
        Err(Error::options(
            format!("--seen-from is {text:?}"),
            "give x,y,z of laser and sensor, such as 30cm,-20cm,1.4m, or of each",
        ))
    }
}

/// Refuses time tags in place of a capture.
///
/// # Errors
/// The file holds time tags, with the command that makes a capture of it.
pub fn refuse(path: &Path) -> Result<()> {
    if !tags::hold_tags(path) {
        return Ok(());
    }
    let found = instrument(path, Inputs::default())?;
    Err(Error::input(
        format!(
            "{}: holds time tags ({}), and a capture needs the points of the scan",
            path.display(),
            found.instrument
        ),
        command(&found),
    ))
}

/// What a file of time tags holds, and the command that makes a capture of it.
fn about(found: &Instrument) -> String {
    let mut out = format!("tags      {}, {} records\n", found.instrument, found.records);
    let rate = found.laser_hz.map_or_else(String::new, |hz| format!(", {:.4} MHz", 1e-6 * hz));
    out += &format!("pulses    {} of the laser{rate}\n", found.pulses);
    out += &found.duration_s.map_or_else(String::new, |s| format!("duration  {}\n", tables::seconds(s)));
    found
        .channels
        .iter()
        .for_each(|(channel, photons)| out += &format!("channel   {channel}: {photons} photons\n"));
    found.markers.iter().for_each(|(marker, count)| out += &format!("marker    {marker}: {count}\n"));
    found.notes.iter().for_each(|note| out += &format!("note      {note}\n"));
    out + &format!("\na capture needs the points of the scan:\n  {}\n", command(found))
}

/// The command that makes a capture of a file, as far as its numbers say.
fn command(found: &Instrument) -> String {
    let side =
        |size: Option<usize>, unknown: &str| size.map_or_else(|| unknown.to_string(), |n| n.to_string());
    let [columns, rows] = found.guess.size;
    let mut out = format!(
        "thirdbounce histogram {} --scan {}x{} --wall SIZE",
        found.path.display(),
        side(columns, "COLUMNS"),
        side(rows, "ROWS")
    );
    out += &match found.guess.division {
        Some(Division::Pixels { marker, .. }) => format!(" --pixels {marker}"),
        Some(Division::Lines { start, stop: Some(stop), .. }) => format!(" --lines {start},{stop}"),
        Some(Division::Lines { start, .. }) => format!(" --lines {start}"),
        _ if found.in_lines => String::new(),
        _ => " --pulses-per-point N".into(),
    };
    if found.inputs.sync != 0 {
        out += &format!(" --sync-channel {}", found.inputs.sync);
    }
    if !found.inputs.markers.is_empty() {
        let all: Vec<_> = found.inputs.markers.iter().map(i32::to_string).collect();
        out += &format!(" --marker-channels {}", all.join(","));
    }
    if let Some(channel) = found.guess.channel {
        out += &format!(" --channel {channel}");
    }
    out + " --out capture.npz"
}
