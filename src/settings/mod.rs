//! The settings of a reconstruction: one struct for the command, C, Python, batches, sessions and Rust programs. A field that is
//! not set has its default or is estimated.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::advice::advice;
use crate::capture::{AxisOrder, Bounce, Capture, Flip, Gate};
use crate::engine::Bins;
use crate::methods::{Method, SolverOptions, method};
use crate::options::{Preset, Range, Row, units};
use crate::transport::{Grid, Volume};
use crate::{Error, Result};

mod calibration;
mod text;

pub use calibration::{Correction, KEY as CALIBRATION};
pub use text::{Calibrate, DevicePosition, ImpulseResponse, ReflectanceSetting, gate, memory_bytes};
use text::{as_text, count, number, path_of_light, seed, word};

/// Declares the fields of [`Settings`] that do not belong to a method: name, type, allowed values, and the function that reads
/// a text.
macro_rules! settings {
    ($($group:literal { $(
        $(#[doc = $line:literal])+
        $(#[serde($serde:meta)])*
        $field:ident: $type:ty = $read:expr, $range:expr;
    )* })*) => {
        /// Everything that a caller may set. `None`: the default, or an estimate.
        ///
        /// Names are the same on the command line (with dashes), in Python, in C and in reports. Lengths are metres, times as
        /// paths of light. The groups `Capture file` and `Capture` apply where a capture is read or prepared, the others where
        /// it is reconstructed.
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
        #[serde(default)]
        pub struct Settings {
            $($(
                $(#[doc = $line])+
                #[serde(skip_serializing_if = "Option::is_none")]
                $(#[serde($serde)])*
                pub $field: Option<$type>,
            )*)*
            /// The method with its options. `surface` by default.
            #[serde(flatten)]
            pub method: Method,
        }

        impl Settings {
            /// The declarations of the fields, without those of the methods' options.
            pub const ROWS: &[Row] = &[$($(
                Row { key: stringify!($field), group: $group, lines: &[$($line),+], range: $range },
            )*)*];

            /// Sets a field that does not belong to a method; `None` if there is none of that key.
            fn set_own(&mut self, key: &str, text: &str) -> Option<std::result::Result<(), String>> {
                $($(
                    if key == stringify!($field) {
                        return Some($read(text).map(|value| self.$field = Some(value)));
                    }
                )*)*
                None
            }
        }
    };
}

settings! {
    "Capture file" {
        /// Distance between the outermost scan points; the wall is scaled to it: 2m, 80cm, metres as a plain number
        wall: f64 = units::length, Range::Text("SIZE");
        /// Bin width, for files without it: a time (32ps) or a path (9.6mm, metres as a plain number)
        bin_width: f64 = path_of_light, Range::Text("WIDTH");
        /// Metres that waves travel in a second, for files whose bins are seconds: 343 for sound in air, 2.25e8 for light in water. Bins
        /// are then paths in that medium
        speed: f64 = units::number, Range::Positive;
        /// Step of the wall's depth in a CC-SOCR capture of a wall that is not flat: 1cm, metres as a plain number
        wall_depth_unit: f64 = units::length, Range::Text("SIZE");
        /// Bounce of a rendered Z-NLOS capture that is used: third, all, or a number, 2 or more [default: third]
        #[serde(with = "as_text")]
        bounce: Bounce = text::bounce, Range::Text("WHICH");
        /// File with tofgrid, for a Stanford f-k capture; none if its histograms begin at the wall [default: tof.mat beside the
        /// capture, if there is one]
        tof: PathBuf = text::file, Range::Text("FILE");
        /// Order of the axes of a file with a single array of counts, as the program that wrote it shows them: xyt, yxt, txy
        /// [default: found by where the light is]
        #[serde(with = "as_text")]
        axes: AxisOrder = text::axes, Range::Text("ORDER");
        /// Name of the array of counts, for a file in no known format with several arrays of three axes
        array: String = text::words, Range::Text("NAME");
        /// Keep pairs without any count as dark ones. Without this, those beside lit pairs are left out
        keep_empty: bool = text::flag, Range::Flag;
        /// Mirror the scan: x swaps left and right as seen in the pictures, y swaps up and down, xy does both; for files
        /// without the orientation of the scan
        flip: Flip = word, Range::Words(&["x", "y", "xy"]);
        /// Rotate the scan by 90, 180 or 270 degrees after the mirroring, clockwise as seen in the pictures (+x to the left, +y up)
        rotate: usize = text::quarter_turns, Range::OneOf(&[90, 180, 270]);
    }
    "Capture" {
        /// Use every Nth scan point in x and in y
        stride: usize = count, Range::Count(1, usize::MAX);
        /// Use only N pairs, drawn at random with the seed
        subset: usize = count, Range::Count(1, usize::MAX);
        /// Use only these paths; one end may be left out: 0.8:2.4 or 80cm:240cm or 2.7ns:8ns, 0.8:, :2.4
        #[serde(with = "as_text")]
        gate: Gate = text::gate, Range::Text("FROM:TO");
        /// A capture of the same scan without the object: its light is subtracted, with a gain that may drift, where held-out pairs prove
        /// it. In Rust and Python a capture may hold these counts itself
        empty: PathBuf = text::file, Range::Text("FILE");
        /// Find a gate where none is set: direct light is left out, and of captured histograms the bins behind nearly all light;
        /// for paper, the half of the bins with the most counts is kept
        auto_gate: bool = text::flag, Range::Flag;
        /// Undo what held-out pairs prove of the instrument: delays of the rows or columns of the scan, and laws of few numbers (time
        /// zero, a wall that leans, its scale, shear, a device near it, a step of power). none names delays of lines only; the report.json
        /// of an earlier capture of the rig undoes first what was undone there [default: auto]
        #[serde(with = "as_text")]
        calibrate: Calibrate = text::calibrate, Range::Text("none|auto|FILE");
        /// Position of a device near the wall, in metres: -0.5,0,0.25. The laser's light, the detector's or both fall as cos / distance²
        /// from there, and counts are divided by that; held-out pairs choose which. none uses the counts unchanged [default: the
        /// position that the capture names, where held-out pairs prove the law, else none]
        #[serde(with = "as_text")]
        device_at: DevicePosition = text::device_position, Range::Text("X,Y,Z|none");
        /// Impulse response of the instrument: the full width at half maximum of a Gaussian, as a time (60ps) or a path (18mm,
        /// metres as a plain number); the same and, behind a colon, the length over which its tail falls to 1/e; an npz file
        /// with pulse, pulse_delta_t and pulse_t_start; none for sharp paths; or auto for an estimate [default: that of the
        /// capture, else auto for captured counts, else auto if the fits of the models show one, else none]
        #[serde(with = "as_text")]
        pulse: ImpulseResponse = text::pulse, Range::Text("M|M:TAIL|FILE|none|auto");
        /// Areas of the wall that laser and sensor see: the full width at half maximum of a Gaussian each, on the wall (2cm,
        /// metres as a plain number). One number is both; 0 or none is a point [default: those of the capture, else points]
        spot: [f64; 2] = text::spots, Range::Text("M|LASER,SENSOR|none");
    }
    "Solver" {
        /// Reflectance of the surfaces: cosine, lambertian, retroreflective, isotropic, or auto for the best of the first three
        /// by short fits [default: auto; paper cosine]
        #[serde(with = "as_text")]
        model: ReflectanceSetting = text::model, Range::Text("NAME");
        /// Published parameters to begin with [default: captured if all counts are whole numbers or some are negative, else
        /// synthetic]
        preset: Preset = word, Range::Words(&["synthetic", "captured"]);
        /// Seed of all random numbers: the initial albedo and the samples of paper, and the pairs of subset [default: 0]
        seed: u32 = seed, Range::Seed;
        /// Return the same bits from every run with the same seed and device
        deterministic: bool = text::flag, Range::Flag;
    }
    "Volume" {
        /// Neighbouring bins of the capture that are one for the solver: auto sums those that neither the pixels of the maps nor
        /// the impulse response resolve, native none, N every N [default: auto; paper native]
        #[serde(with = "as_text")]
        bins: Bins = text::bins, Range::Text("auto|native|N");
        /// Voxel size along z (4mm, metres as a plain number) [default: the bin width; surface: at least half of a voxel's width]
        depth_pitch: f64 = units::length, Range::Text("M");
        /// Box to reconstruct, in metres: -0.5:0.5,-0.5:0.5,0.3:1.2 [default: the extent of the wall, and the depths that the
        /// gate allows]
        #[serde(with = "as_text")]
        volume: Volume = text::volume, Range::Text("X0:X1,Y0:Y1,Z0:Z1");
        /// Return the volume beside the maps
        keep_volume: bool = text::flag, Range::Internal;
    }
    "Result" {
        /// A pixel is surface above this share of the brightest albedo [default: the mask of the method; paper: its domain
        /// threshold, 0.05 confocal, else 0.03]
        mask_fraction: f64 = number, Range::Text("X");
    }
    "Device" {
        /// Index or part of the name of the device (see `thirdbounce devices`), vulkan (the best Vulkan device) or host [default: a
        /// GPU, else the host]
        device: String = text::words, Range::Text("DEVICE");
        /// Largest amount of device memory to use: bytes in Rust; as text a number in MiB, or with K, M or G behind it
        /// [default: all free memory]
        memory: u64 = text::memory, Range::Text("SIZE");
    }
}

impl Settings {
    /// Settings with the text of each key, in any order.
    ///
    /// # Errors
    /// Those of [`Settings::set`].
    pub fn from_texts<'t>(texts: impl IntoIterator<Item = (&'t str, &'t str)> + Clone) -> Result<Settings> {
        let mut settings = Settings::default();
        // The method decides on the keys that there are.
        let is_solver = |key: &str| key.eq_ignore_ascii_case("solver");
        for (key, text) in texts.clone().into_iter().filter(|(key, _)| is_solver(key)) {
            settings.set(key, text)?;
        }
        for (key, text) in texts.into_iter().filter(|(key, _)| !is_solver(key)) {
            settings.set(key, text)?;
        }
        Ok(settings)
    }

    /// Sets a field, or an option of the method, by its key (with underscores or dashes) to a value as text. Keys and words may
    /// be of any case. `solver` chooses the method, and drops options of another one.
    ///
    /// # Errors
    /// A key that neither the settings nor the method have, or a value that it does not take, with the values that it takes.
    pub fn set(&mut self, key: &str, text: &str) -> Result<()> {
        let key = key.replace('-', "_").to_lowercase();
        let row = self.row(&key);
        let is_word =
            matches!(&*key, "solver" | "model") || row.is_some_and(|r| matches!(r.range, Range::Words(_)));
        let lowered = is_word.then(|| text.to_lowercase());
        let text = lowered.as_deref().unwrap_or(text);
        if key == "solver" {
            let named = method(text.trim())?;
            if named.name() != self.method.name() {
                self.method = named;
            }
            return Ok(());
        }
        if let Some(set) = self.set_own(&key, text) {
            return set.map_err(|want| Error::options(format!("{key} is {}", text.trim()), want));
        }
        match row {
            Some(_) => self.method.set_text(&key, text),
            None => Err(self.unknown(&key)),
        }
    }

    /// The error of a key that neither the settings nor the method have.
    fn unknown(&self, key: &str) -> Error {
        let rows = Settings::all_rows();
        let known = || rows.iter().map(|(row, _)| row.key);
        if known().any(|name| name == key) {
            return Error::options(
                format!("{key} is no option of the solver {}", self.method.name()),
                advice!["leave it out, or choose another solver; see "[Options]],
            );
        }
        let off = |name: &&str| text::distance(name, key);
        let similar = known().chain(["solver"]).min_by_key(off).filter(|name| 3 * off(name) <= key.len());
        let meant = similar.map_or_else(String::new, |name| format!("did you mean {name}? "));
        Error::options(format!("there is no setting {key:?}"), advice![(meant) "see "[Options]])
    }

    /// The declaration of a setting, or of an option of the method.
    fn row(&self, key: &str) -> Option<&'static Row> {
        let options = self.method.options(&crate::options::SceneTraits::DEFAULT);
        let mut rows = options.rows().into_iter().chain(Settings::ROWS);
        rows.find(|row| row.key == key && row.range != Range::Internal)
    }

    /// Whether there is a setting, or an option of the method, of this key.
    pub fn has(&self, key: &str) -> bool {
        self.row(key).is_some()
    }

    /// The rows of all settings and of all options of methods, each with its text.
    pub fn all_rows() -> Vec<(&'static Row, String)> {
        let own = Settings::ROWS.iter().map(|row| (row, row.text()));
        own.chain(SolverOptions::all_rows()).filter(|(row, _)| row.range != Range::Internal).collect()
    }

    /// The same settings with a change.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Settings)) -> Settings {
        change(&mut self);
        self
    }

    /// The files that are read beside the capture.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let pulse = match &self.pulse {
            Some(ImpulseResponse::File(path)) => Some(path),
            _ => None,
        };
        let calibration = match &self.calibrate {
            Some(Calibrate::File(path)) => Some(path),
            _ => None,
        };
        [self.tof.as_ref(), self.empty.as_ref(), pulse, calibration]
            .into_iter()
            .flatten()
            .map(PathBuf::as_path)
    }

    /// A capture with the impulse response and the spots that are set. It is copied only if it has others.
    ///
    /// # Errors
    /// An impulse response that cannot be read, or that the bins of the capture cannot hold.
    pub fn with_instrument<'c>(&self, capture: &'c Capture) -> Result<Cow<'c, Capture>> {
        let mut capture = Cow::Borrowed(capture);
        if let Some(pulse) = self.pulse.as_ref().map(ImpulseResponse::samples).transpose()?
            && capture.pulse != pulse
        {
            capture.to_mut().set_pulse(pulse)?;
        }
        if let Some(spots) = self.spot.map(|spots| spots.map(Some))
            && [capture.laser_spot, capture.sensor_spot] != spots
        {
            let capture = capture.to_mut();
            [capture.laser_spot, capture.sensor_spot] = spots;
        }
        Ok(capture)
    }

    /// The scan of a session with what [`Settings::with_instrument`] sets.
    ///
    /// # Errors
    /// As there; a setting that only applies where a capture is read or prepared.
    pub fn for_frames<'c>(&self, scan: &'c Capture) -> Result<Cow<'c, Capture>> {
        let set = serde_json::to_value(self).unwrap_or_default();
        let of_captures = |row: &&Row| {
            row.group.starts_with("Capture")
                && !["pulse", "spot", "calibrate"].contains(&row.key)
                && !(row.key == "device_at" && self.device_at == Some(DevicePosition::None))
        };
        if let Some(row) = Settings::ROWS.iter().filter(of_captures).find(|row| set.get(row.key).is_some()) {
            return Err(Error::options(
                format!(
                    "{} applies where a capture is read; frames of a session are used unchanged",
                    row.key
                ),
                "leave it out, or prepare the scan and each frame with it",
            ));
        }
        self.with_instrument(scan)
    }

    /// The seed of all random numbers.
    pub fn seed(&self) -> u32 {
        self.seed.unwrap_or(0)
    }

    /// Sums the bins of a capture, whose pulse is known if it ever will be, and says how many are one for the solver.
    ///
    /// # Errors
    /// More than the capture has.
    #[doc(hidden)]
    pub fn summed<'c>(
        &self,
        solver: &SolverOptions,
        capture: Cow<'c, Capture>,
    ) -> Result<(Cow<'c, Capture>, usize)> {
        let sum = self.sum(solver, &capture);
        Ok((if sum == 1 { capture } else { Cow::Owned(capture.binned(sum)?) }, sum))
    }

    /// How many bins of a capture are one for the solver. The counts do not matter.
    #[doc(hidden)]
    pub fn sum(&self, solver: &SolverOptions, capture: &Capture) -> usize {
        match self.bins.unwrap_or_default() {
            Bins::Native => 1,
            Bins::Sum(n) => n,
            Bins::Auto => solver.usual_sum(capture, self.volume),
        }
    }

    /// The grid for a capture whose bins are those of the solver: of the box that is set, else of
    /// [`SolverOptions::default_volume`]. Voxels are as deep
    /// as is set, else [`SolverOptions::usual_depth_pitch`], and a bin where native bins are asked for.
    ///
    /// # Errors
    /// A scan without aperture, a box without voxels, a box nearer than the least depth, or more voxels than can be counted.
    #[doc(hidden)]
    pub fn grid(&self, solver: &SolverOptions, capture: &Capture) -> Result<Grid> {
        capture.check_aperture()?;
        let least = solver.common().min_depth;
        let volume = self.volume.map_or_else(|| solver.default_volume(capture), Ok)?;
        let usual = || match self.bins {
            Some(Bins::Native) => capture.bin_width,
            _ => solver.usual_depth_pitch(capture, self.volume),
        };
        let pitch = self.depth_pitch.unwrap_or_else(usual);
        let grid = Grid::new(volume, solver.common().lateral, pitch)?;
        if volume.max.z <= least {
            return Err(Error::options(
                format!("the volume ends at a depth of {} m", volume.max.z),
                format!(
                    "give a deeper volume: nothing nearer than the least depth, {least} m, is reconstructed"
                ),
            ));
        }
        if grid.origin.z > volume.max.z {
            return Err(Error::options(
                format!("no voxel of {pitch} m depth fits from {:.4} to {:.4} m", volume.min.z, volume.max.z),
                "give a smaller depth pitch or a deeper volume",
            ));
        }
        Ok(grid)
    }

    /// Checks the values of all fields. The ranges do not depend on the capture.
    ///
    /// # Errors
    /// The first value out of its range.
    pub fn check(&self) -> Result<()> {
        crate::maps::Maps::check_mask_fraction(self.mask_fraction)?;
        self.method.options(&crate::options::SceneTraits::DEFAULT).check()
    }
}

/// Settings that reproduce these options of a solver, as for rendered counts: nothing of the solver is left to defaults.
impl<T: Into<SolverOptions>> From<T> for Settings {
    fn from(options: T) -> Settings {
        let options = options.into();
        Settings {
            model: Some(ReflectanceSetting::Known(options.common().reflectance)),
            preset: Some(Preset::Synthetic),
            method: Method::of(&options),
            ..Settings::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_read_back_as_they_were_written() {
        let texts = [
            ("solver", "paper"),
            ("wall", "2m"),
            ("bin-width", "32ps"),
            ("flip", "xy"),
            ("gate", ":240cm"),
            ("pulse", "60ps:1ns"),
            ("spot", "2cm,5mm"),
            ("device-at", "-50cm,0,0.25"),
            ("model", "lambertian"),
            ("bins", "4"),
            ("volume", "-50cm:0.5,-0.5:50cm,30cm:1.2m"),
            ("memory", "2G"),
            ("learning_rate", "0.5"),
            ("reduce", "false"),
            ("noise", "bin"),
        ];
        let settings = Settings::from_texts(texts).unwrap();
        let json = serde_json::to_value(&settings).unwrap();
        assert_eq!(json["solver"], "paper");
        assert_eq!(json["wall"], 2.0);
        assert_eq!(json["learning_rate"], 0.5);
        assert_eq!(json["volume"], "-0.5:0.5,-0.5:0.5,0.3:1.2");
        assert_eq!(serde_json::from_value::<Settings>(json).unwrap(), settings);
        let Method::Paper(paper) = &settings.method else { panic!("{settings:?}") };
        assert_eq!((paper.domain.reduce, paper.learning_rate), (Some(false), Some(0.5)));
        assert_eq!(settings.volume.unwrap().max.to_array(), [0.5, 0.5, 1.2]);
        assert_eq!(settings.memory, Some(2 << 30));
        let in_capitals =
            Settings::from_texts([("Solver", "LCT"), ("LATERAL", "32"), ("Model", "Lambertian")]);
        let as_usual = Settings::from_texts([("solver", "lct"), ("lateral", "32"), ("model", "lambertian")]);
        assert_eq!(in_capitals.unwrap(), as_usual.unwrap());
    }

    #[test]
    fn keys_and_values_that_make_no_sense_are_refused() {
        let refused = |key: &str, text: &str| {
            let mut settings = Settings::default();
            let error = settings.set(key, text).unwrap_err();
            assert_eq!(settings, Settings::default());
            format!("{} | {}", error.what, error.hint)
        };
        for (key, text, words) in [
            ("solver", "magic", "paper or surface"),
            ("nonsense", "1", "no setting"),
            ("laterl", "64", "did you mean lateral?"),
            ("iteration", "64", "did you mean iterations?"),
            ("l1", "1", "no option of the solver surface"),
            ("reflectance", "cosine", "no setting"),
            ("lateral", "wide", "a whole number from 1 to 4096"),
            ("lateral", "0", "a whole number from 1 to 4096"),
            ("sparsity", "NaN", "zero or a positive number"),
            ("support", "maybe", "fixed or auto"),
            ("gate", "2m:1m", "ends before it begins"),
            ("gate", "2x:3", "write FROM:TO"),
            ("wall", "32ps", "give a length"),
            ("spot", "20ps", "full width"),
            ("device_at", "0,0", "x,y,z"),
            ("device_at", "0,0,-1", "z > 0"),
            ("model", "velvet", "cosine"),
            ("rotate", "45", "90"),
            ("memory", "lots", "MiB"),
            ("volume", "0:1,0:1", "three ranges"),
            ("bounce", "first", "third"),
        ] {
            assert!(refused(key, text).contains(words), "{key}={text}: {}", refused(key, text));
        }
        // No path, no file.
        assert!(refused("pulse", "20 parsec").contains("20 parsec"));
    }

    #[test]
    fn every_method_has_the_name_that_its_settings_are_tagged_with() {
        for name in SolverOptions::NAMES {
            let settings = Settings::from_texts([("solver", *name)]).unwrap();
            assert_eq!(serde_json::to_value(&settings).unwrap()["solver"], *name);
            assert_eq!(settings.method.name(), *name);
            let options = settings.method.options(&crate::options::SceneTraits::DEFAULT);
            assert_eq!(
                Settings::from(options.clone()).method.options(&crate::options::SceneTraits::DEFAULT),
                options
            );
            let own = |key: &str| Settings::ROWS.iter().any(|row| row.key == key);
            let listed = |row: &&&Row| row.range != Range::Internal;
            assert!(
                !options.rows().iter().filter(listed).any(|row| own(row.key)),
                "{name} repeats a setting"
            );
        }
    }
}
