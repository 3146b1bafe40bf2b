//! Values of settings as text.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::de::DeserializeOwned;

use super::calibration::Correction;
use crate::capture::{AxisOrder, Bounce, Gate, Pulse};
use crate::engine::Bins;
use crate::options::units;
use crate::transport::{Reflectance, Volume};
use crate::{Error, Result};

/// A value, or the allowed values as text.
type Read<T> = std::result::Result<T, String>;

/// The reflectance of the surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReflectanceSetting {
    /// Estimated by short fits.
    Auto,
    /// As given.
    Known(Reflectance),
}

/// The impulse response of the instrument.
#[derive(Debug, Clone, PartialEq)]
pub enum ImpulseResponse {
    /// Paths are sharp, whatever the capture holds.
    None,
    /// Estimated by short fits, whatever the capture holds.
    Auto,
    /// A Gaussian with an exponential tail, both as paths in metres.
    Gaussian {
        /// Full width at half maximum.
        fwhm: f64,
        /// Length over which the tail falls to 1/e.
        tail: Option<f64>,
    },
    /// The arrays pulse, pulse_delta_t and pulse_t_start of an npz file.
    File(PathBuf),
}

impl ImpulseResponse {
    /// The samples; `None` for sharp paths, or where it is estimated.
    ///
    /// # Errors
    /// A width that is not positive; a file that cannot be read.
    pub fn samples(&self) -> Result<Option<Pulse>> {
        match self {
            ImpulseResponse::None | ImpulseResponse::Auto => Ok(None),
            ImpulseResponse::Gaussian { fwhm, tail } => {
                let pulse = Pulse::gaussian(*fwhm)?;
                tail.map_or(Ok(pulse.clone()), |tail| pulse.with_tail(tail)).map(Some)
            }
            #[cfg(feature = "formats")]
            ImpulseResponse::File(path) => Pulse::read(path).map(Some),
            #[cfg(not(feature = "formats"))]
            ImpulseResponse::File(path) => Err(Error::options(
                format!("{}: this build reads no files", path.display()),
                "give a width, or build with the feature formats",
            )),
        }
    }
}

/// A value that is written as it is read.
pub trait Text: Sized {
    /// Reads a text.
    fn read(text: &str) -> Read<Self>;
    /// The value as text.
    fn text(&self) -> String;
}

/// (De)serialises optional values as text.
pub mod as_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use super::Text;

    pub fn serialize<S: Serializer, T: Text>(value: &Option<T>, to: S) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => to.serialize_str(&value.text()),
            None => to.serialize_none(),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>, T: Text>(from: D) -> Result<Option<T>, D::Error> {
        let text = Option::<String>::deserialize(from)?;
        text.map(|text| T::read(&text).map_err(D::Error::custom)).transpose()
    }
}

/// Where a device near the wall is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DevicePosition {
    /// Not considered: counts are used unchanged.
    None,
    /// x, y, z in metres, in the frame of the wall points.
    At(DVec3),
}

/// A position, or none.
pub fn device_position(text: &str) -> Read<DevicePosition> {
    if text.trim().eq_ignore_ascii_case("none") {
        return Ok(DevicePosition::None);
    }
    let numbers: Vec<f64> = text.split(',').filter_map(|n| units::length(n.trim()).ok()).collect();
    match numbers[..] {
        [x, y, z] if text.split(',').count() == 3 && z > 0.0 && numbers.iter().all(|n| n.is_finite()) => {
            Ok(DevicePosition::At(DVec3::new(x, y, z)))
        }
        _ => Err(
            "give the device's position x,y,z in metres, in front of the wall (z > 0): -0.5,0,0.25, or none"
                .into(),
        ),
    }
}

macro_rules! as_read {
    ($($type:ty: $read:path, $text:expr;)*) => { $(
        impl Text for $type {
            fn read(text: &str) -> Read<Self> {
                $read(text)
            }

            fn text(&self) -> String {
                let text: fn(&$type) -> String = $text;
                text(self)
            }
        }
    )* };
}

as_read! {
    Gate: gate, |gate| gate.to_string();
    DevicePosition: device_position, |device| match device {
        DevicePosition::None => "none".into(),
        DevicePosition::At(at) => format!("{},{},{}", at.x, at.y, at.z),
    };
    Calibrate: calibrate, |calibrate| match calibrate {
        Calibrate::None => "none".into(),
        Calibrate::Auto => "auto".into(),
        Calibrate::File(path) => path.to_string_lossy().into_owned(),
    };
    Bins: bins, |bins| bins.to_string();
    Bounce: bounce, |bounce| bounce.to_string();
    AxisOrder: axes, |axes| axes.to_string();
    ReflectanceSetting: model, |model| match model {
        ReflectanceSetting::Auto => "auto".into(),
        ReflectanceSetting::Known(reflectance) => reflectance.name().into(),
    };
    ImpulseResponse: pulse, |pulse| match pulse {
        ImpulseResponse::None => "none".into(),
        ImpulseResponse::Auto => "auto".into(),
        ImpulseResponse::Gaussian { fwhm, tail: None } => fwhm.to_string(),
        ImpulseResponse::Gaussian { fwhm, tail: Some(tail) } => format!("{fwhm}:{tail}"),
        ImpulseResponse::File(path) => path.to_string_lossy().into_owned(),
    };
    Volume: volume, |v| {
        format!("{}:{},{}:{},{}:{}", v.min.x, v.max.x, v.min.y, v.max.y, v.min.z, v.max.z)
    };
}

/// What an error of a parser asks for.
fn wanted(error: Error) -> String {
    error.hint.to_string()
}

/// Letters to add, drop or replace between two names.
pub fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.bytes().enumerate() {
        let mut corner = std::mem::replace(&mut row[0], i + 1);
        for (j, to) in b.bytes().enumerate() {
            let all = [row[j] + 1, row[j + 1] + 1, corner + usize::from(from != to)];
            corner = std::mem::replace(&mut row[j + 1], all.into_iter().min().unwrap_or(0));
        }
    }
    row[b.len()]
}

pub fn number(text: &str) -> Read<f64> {
    units::number(text).map_err(|why| format!("give a number: {why}"))
}

/// A path of light, as a length or as a time.
pub fn path_of_light(text: &str) -> Read<f64> {
    units::path(text)
}

pub fn count(text: &str) -> Read<usize> {
    let number = text.trim().parse().ok().filter(|n| *n > 0);
    number.ok_or_else(|| "give a whole number, 1 or more".into())
}

pub fn quarter_turns(text: &str) -> Read<usize> {
    let degrees = text.trim().parse().ok().filter(|degrees| [90, 180, 270].contains(degrees));
    degrees.ok_or_else(|| "give 90, 180 or 270".into())
}

pub fn seed(text: &str) -> Read<u32> {
    text.trim().parse().map_err(|_| format!("give a whole number from 0 to {}", u32::MAX))
}

pub fn flag(text: &str) -> Read<bool> {
    text.trim().parse().map_err(|_| "give true or false".into())
}

/// Whether what held-out pairs prove of the instrument is undone.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Calibrate {
    /// Delays of lines are named only.
    None,
    /// It is undone.
    #[default]
    Auto,
    /// What this file holds is undone first: the report of an earlier capture of the rig.
    File(PathBuf),
}

impl Calibrate {
    /// The corrections of the file; none without a file.
    ///
    /// # Errors
    /// A file that cannot be read, or that holds no calibration.
    pub fn corrections(&self) -> Result<Vec<Correction>> {
        match self {
            Calibrate::File(path) => super::calibration::corrections(path),
            _ => Ok(vec![]),
        }
    }
}

/// Whether to calibrate, or by which file.
pub fn calibrate(text: &str) -> Read<Calibrate> {
    let calibrate = match text.trim() {
        "none" => Calibrate::None,
        "auto" => Calibrate::Auto,
        file => Calibrate::File(file.into()),
    };
    calibrate.corrections().map_err(|e| format!("give none, auto or a file: {}; {}", e.what, e.hint))?;
    Ok(calibrate)
}

/// A word that serde knows.
pub fn word<T: DeserializeOwned>(text: &str) -> Read<T> {
    serde_json::from_value(serde_json::Value::String(text.trim().into())).map_err(|e| {
        // "unknown variant `z`, expected one of `x`, `y`, `xy`"
        let said = e.to_string().replace('`', "");
        said.split_once("expected ").map_or(said.clone(), |(_, all)| format!("give {all}"))
    })
}

pub fn words(text: &str) -> Read<String> {
    Ok(text.into())
}

pub fn file(text: &str) -> Read<PathBuf> {
    Ok(text.into())
}

pub fn bounce(text: &str) -> Read<Bounce> {
    Bounce::parse(text).map_err(wanted)
}

pub fn axes(text: &str) -> Read<AxisOrder> {
    AxisOrder::parse(text).map_err(wanted)
}

pub fn bins(text: &str) -> Read<Bins> {
    text.parse().map_err(wanted)
}

/// A range of paths; either end may have a unit.
pub fn gate(text: &str) -> Read<Gate> {
    let metres =
        |part: &str| units::path(part).map_or_else(|_| part.to_string(), |metres| metres.to_string());
    let metres = text.split(':').map(metres).collect::<Vec<_>>().join(":");
    Gate::parse(&metres).map_err(|e| format!("{}; {}", e.what, e.hint))
}

pub fn model(text: &str) -> Read<ReflectanceSetting> {
    match text.trim() {
        "auto" => Ok(ReflectanceSetting::Auto),
        name => Reflectance::named(name).map(ReflectanceSetting::Known).map_err(wanted),
    }
}

/// A Gaussian's width as a path or a time, the same and the length of its tail, or a file.
pub fn pulse(text: &str) -> Read<ImpulseResponse> {
    let numbers: Vec<Option<f64>> = text.split(':').map(|n| units::path(n).ok()).collect();
    let checked = |pulse: ImpulseResponse| match pulse.samples() {
        Ok(_) => Ok(pulse),
        Err(e) => Err(format!("{}; {}", e.what, e.hint)),
    };
    match (text, &numbers[..]) {
        ("none", _) => Ok(ImpulseResponse::None),
        ("auto", _) => Ok(ImpulseResponse::Auto),
        // A plain number is metres.
        (_, [Some(fwhm), ..])
            if *fwhm >= 1.0 && units::number(text.split(':').next().unwrap_or_default()).is_ok() =>
        {
            Err(format!("{fwhm} m is longer than any impulse response: for picoseconds give {fwhm}ps"))
        }
        (_, [Some(fwhm)]) => checked(ImpulseResponse::Gaussian { fwhm: *fwhm, tail: None }),
        (_, [Some(fwhm), Some(tail)]) => {
            checked(ImpulseResponse::Gaussian { fwhm: *fwhm, tail: Some(*tail) })
        }
        _ => checked(ImpulseResponse::File(Path::new(text).into())),
    }
}

/// The widths of the spots of laser and sensor; metres if no unit is given.
pub fn spots(text: &str) -> Read<[f64; 2]> {
    let wrong = || {
        "give the full width at half maximum on the wall in metres: 0.05, or 0.05,0.02 for laser and sensor, or none"
            .to_string()
    };
    if text == "none" {
        return Ok([0.0; 2]);
    }
    let width = |n: &str| units::length(n).ok().filter(|w| w.is_finite() && *w >= 0.0).ok_or_else(wrong);
    match text.split_once(',') {
        None => Ok([width(text)?; 2]),
        Some((laser, sensor)) => Ok([width(laser)?, width(sensor)?]),
    }
}

/// A box of three ranges.
pub fn volume(text: &str) -> Read<Volume> {
    let wrong = || {
        let is_file = [".npz", ".hdf5", ".h5"].iter().any(|e| text.to_ascii_lowercase().ends_with(e));
        let file = if is_file { "; `--volume-file` names the file of the volume" } else { "" };
        format!("give three ranges in metres, for x, y and z: -0.5:0.5,-0.5:0.5,0.3:1.2{file}")
    };
    let range = |part: &str| -> Read<[f64; 2]> {
        let (from, to) = part.split_once(':').ok_or_else(wrong)?;
        let number = |n: &str| units::length(n).map_err(|_| wrong());
        Ok([number(from)?, number(to)?])
    };
    let ranges: Vec<&str> = text.split(',').collect();
    let [x, y, z] = ranges[..] else { return Err(wrong()) };
    let ([x0, x1], [y0, y1], [z0, z1]) = (range(x)?, range(y)?, range(z)?);
    Ok(Volume { min: glam::dvec3(x0, y0, z0), max: glam::dvec3(x1, y1, z1) })
}

pub fn memory(text: &str) -> Read<u64> {
    memory_bytes(text).map_err(wanted)
}

/// Reads an amount of memory: a number in MiB, or a number with K, M or G after it.
///
/// # Errors
/// Any other text.
pub fn memory_bytes(text: &str) -> Result<u64> {
    let wrong = || {
        Error::options(
            format!("the memory budget is {text:?}"),
            "give a number in MiB, or a number with K, M or G after it: 512, 512M or 2G",
        )
    };
    let trimmed = text.trim();
    let lower = trimmed.to_ascii_lowercase();
    let number = lower.trim_end_matches("ib").trim_end_matches('b');
    let (digits, unit) = match number.chars().last() {
        Some('k') => (&number[..number.len() - 1], 10),
        Some('m') => (&number[..number.len() - 1], 20),
        Some('g') => (&number[..number.len() - 1], 30),
        _ => (number, 20),
    };
    let value: f64 = digits.trim().parse().map_err(|_| wrong())?;
    let bytes = value * f64::from(1u32 << unit);
    if !(bytes.is_finite() && (1.0..9e18).contains(&bytes)) {
        return Err(wrong());
    }
    Ok(bytes as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_in_mebibytes_or_with_a_unit() {
        let read = |text| memory_bytes(text).ok();
        assert_eq!(read("512"), Some(512 << 20));
        assert_eq!(read("64k"), Some(64 << 10));
        assert_eq!(read("1.5 G"), Some(3 << 29));
        assert_eq!(read("2GiB"), Some(2 << 30));
        assert_eq!(read("300MB"), Some(300 << 20));
        for wrong in ["", "G", "-1", "0", "NaN", "inf", "1e300", "3T", "1,5G", "\u{e9}"] {
            assert_eq!(read(wrong), None, "{wrong:?}");
        }
    }
}
