//! Options by which time tags become histograms.

use std::path::Path;

use glam::DVec3;
use thirdbounce::options::units::{length, number, time};

use crate::capture::Turn;
use crate::error::{Error, Result};
use crate::{Asked, Division, Inputs, PileUp, Readings, Scan, Zero};

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
