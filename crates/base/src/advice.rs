//! Hints for fixing an error: text with typed settings in it. A front end formats the settings itself.
//!
//! [`std::fmt::Display`] formats a setting as the name of the library's field, in backticks; the command line as its
//! flag.

use std::borrow::Cow;
use std::ffi::CStr;
use std::fmt;

use serde::{Serialize, Serializer};

/// Declares the settings, each with the name of its field and its documentation.
macro_rules! settings {
    ($($setting:ident $name:literal $what:literal)*) => {
        /// A setting that a hint may name.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[non_exhaustive]
        pub enum Setting {
            $(#[doc = $what] $setting,)*
        }

        impl Setting {
            /// All settings.
            pub const ALL: &[Setting] = &[$(Setting::$setting),*];

            /// Name of the corresponding field.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Setting::$setting => $name,)*
                }
            }

            /// The same name for C.
            pub const fn c_name(self) -> &'static CStr {
                match self {
                    $(Setting::$setting => match CStr::from_bytes_with_nul(concat!($name, "\0").as_bytes()) {
                        Ok(name) => name,
                        Err(_) => c"",
                    },)*
                }
            }
        }
    };
}

settings! {
    Accumulation "accumulation" "Accumulation path of rendered values."
    Array "array" "Name of the array of counts."
    Axes "axes" "Order of the axes of an array of counts."
    BinWidth "bin_width" "Bin width in metres of path."
    DepthPitch "depth_pitch" "Depth of a voxel."
    Device "device" "Device, by index, part of its name, or UUID."
    Gate "gate" "Interval of path lengths used."
    HostMemory "host_memory" "Maximum host memory of the process, bytes."
    InitialAlbedo "initial_albedo" "Albedo of every voxel before the first iteration."
    KeepEmpty "keep_empty" "Keeps pairs without any count."
    L1 "l1" "Weight of the L1 term."
    Lateral "lateral" "Voxels along x and along y."
    LearningRate "learning_rate" "Step size."
    LineShift "line_shift" "Shift of every second line of a scan, points."
    LineTime "line_time" "Duration of a line of a scan."
    Memory "memory" "Maximum device memory, bytes."
    MinDepth "min_depth" "Minimum distance of the volume from the wall."
    NoiseSpan "noise_span" "Range of the learnt noise."
    Peak "peak" "Scaled value of the largest measurement."
    Records "records" "Records of a PicoQuant file, T2 or T3."
    Stride "stride" "Stride over scan points."
    SyncAfter "sync_after" "Time between laser pulses, where a file holds those after photons only."
    SyncDivider "sync_divider" "Laser pulses for each that a file holds."
    TagUnit "tag_unit" "Unit of times in arrays and text of tags."
    Volume "volume" "Reconstructed volume."
    Wall "wall" "Side of the wall."
    Zero "zero" "Delay of path 0."
}

/// A change that may fix an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Remedy {
    /// This setting; the surrounding text gives the value.
    Set(Setting),
    /// Any change that reduces the size of the problem.
    SmallerJob {
        /// Bytes requested, if known.
        asked: Option<u64>,
        /// Bytes that are available, if known.
        available: Option<u64>,
    },
}

impl Remedy {
    /// [`Remedy::SmallerJob`] without byte counts.
    pub const SMALLER_JOB: Remedy = Remedy::SmallerJob { asked: None, available: None };
}

/// A source of further information.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// The list of devices: `gpu::devices`.
    Devices,
    /// A description of a capture: `job::inspect`.
    Capture,
    /// The list of settings and of the options of methods.
    Options,
}

/// A part of a hint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AdvicePart {
    /// Plain text.
    Text(Cow<'static, str>),
    /// A change.
    Change(Remedy),
    /// A source of information.
    Look(Look),
}

/// Hint for fixing an error: parts in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Advice(Vec<AdvicePart>);

impl Advice {
    /// Parts in order.
    pub fn parts(&self) -> &[AdvicePart] {
        &self.0
    }

    /// All proposed changes.
    pub fn remedies(&self) -> impl Iterator<Item = Remedy> {
        self.0
            .iter()
            .filter_map(|part| if let AdvicePart::Change(remedy) = part { Some(*remedy) } else { None })
    }

    /// Whether the hint proposes a change of this setting.
    pub fn names(&self, setting: Setting) -> bool {
        self.remedies().any(|r| r == Remedy::Set(setting))
    }

    /// The hint as text. `changed` formats changes, `found` sources of information.
    pub fn say(&self, changed: impl Fn(Remedy) -> String, found: impl Fn(Look) -> String) -> String {
        let said = |part: &AdvicePart| match part {
            AdvicePart::Text(text) => text.to_string(),
            AdvicePart::Change(remedy) => changed(*remedy),
            AdvicePart::Look(look) => found(*look),
        };
        self.0.iter().map(said).collect()
    }

    /// The same hint with `more` appended.
    pub fn and(mut self, more: impl Into<Advice>) -> Advice {
        self.0.extend(more.into().0);
        self
    }
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let changed = |remedy| match remedy {
            Remedy::Set(setting) => format!("`{}`", setting.name()),
            Remedy::SmallerJob { .. } => "a smaller job".into(),
        };
        let found = |look| match look {
            Look::Devices => "`gpu::devices`".into(),
            Look::Capture => "`job::inspect`".into(),
            Look::Options => "the page `docs/options.md`".into(),
        };
        f.pad(&self.say(changed, found))
    }
}

/// Serialised as it is displayed.
impl Serialize for Advice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl From<&'static str> for Advice {
    fn from(text: &'static str) -> Advice {
        Advice(vec![AdvicePart::Text(text.into())])
    }
}

impl From<String> for Advice {
    fn from(text: String) -> Advice {
        Advice(vec![AdvicePart::Text(text.into())])
    }
}

impl<const N: usize> From<[AdvicePart; N]> for Advice {
    fn from(parts: [AdvicePart; N]) -> Advice {
        Advice(parts.into())
    }
}

impl From<&[AdvicePart]> for Advice {
    fn from(parts: &[AdvicePart]) -> Advice {
        Advice(parts.into())
    }
}

/// Parts of a hint, in order. Text is a literal or `(expression)`, a setting is its name in [`Setting`], a [`Remedy`]
/// is `{expression}`, a [`Look`] is `[Name]`.
#[doc(hidden)]
#[macro_export]
macro_rules! __advice {
    ($($part:tt)*) => { [$($crate::__part!($part)),*] };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __part {
    ($text:literal) => {
        $crate::advice::AdvicePart::Text(std::borrow::Cow::Borrowed($text))
    };
    (($text:expr)) => {
        $crate::advice::AdvicePart::Text(std::borrow::Cow::from($text))
    };
    ({$remedy:expr}) => {
        $crate::advice::AdvicePart::Change($remedy)
    };
    ([$look:ident]) => {
        $crate::advice::AdvicePart::Look($crate::advice::Look::$look)
    };
    ($setting:ident) => {
        $crate::advice::AdvicePart::Change($crate::advice::Remedy::Set($crate::advice::Setting::$setting))
    };
}

pub use __advice as advice;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_advice_is_said_in_the_words_of_its_front_end() {
        let short = Remedy::SmallerJob { asked: Some(8), available: Some(4) };
        let advice =
            Advice::from(advice!["use another " Device " (" [Devices] ") or " {short} (format!(", {}", 1))]);
        assert_eq!(advice.to_string(), "use another `device` (`gpu::devices`) or a smaller job, 1");
        let said = advice.say(|remedy| format!("{remedy:?}").to_lowercase(), |look| format!("{look:?}"));
        assert!(said.starts_with("use another set(device) (Devices) or smallerjob"), "{said}");
        assert_eq!(advice.remedies().collect::<Vec<_>>(), [Remedy::Set(Setting::Device), short]);
        assert!(advice.names(Setting::Device) && !advice.names(Setting::Lateral));
    }
}
