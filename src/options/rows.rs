//! Options as declarations: one row has an option's name, type, default, range and text.
//!
//! The struct, its defaults, its checks, its keys in reports, the command line and the keys of comparisons all come from the
//! rows. The macro `options!` declares them.

use std::fmt;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::advice::advice;
use crate::capture::Capture;
use crate::options::units;
use crate::transport::{Binning, Gradient, Reflectance, Sampling};
use crate::{Error, Result};

/// A published set of parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Rendered histograms: α = 0.001, no noise term.
    Synthetic,
    /// Captured histograms: α = 0.8 and the noise term.
    Captured,
}

impl Preset {
    /// As text.
    pub fn name(self) -> &'static str {
        match self {
            Preset::Synthetic => "synthetic",
            Preset::Captured => "captured",
        }
    }
}

/// Pairs that an exact capture needs: more change its maps little (benches/NOTES.md).
pub const ENOUGH_PAIRS: usize = 4096;

/// The properties of a scene that defaults depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneTraits {
    /// Rendered or captured histograms.
    pub preset: Preset,
    /// Laser and sensor point of a pair are the same.
    pub confocal: bool,
    /// How surfaces reflect.
    pub reflectance: Reflectance,
    /// Unit of defaults that are lengths, metres ([`Capture::unit`]).
    pub unit: f64,
    /// Width of the scanned wall, metres.
    pub wall: f64,
    /// Pairs that hold enough light: 1,024, or more where photons are few.
    pub pairs: usize,
}

/// The default near end of the reconstructed box, and that of the network's, in widths of the wall.
pub const NEAR: f64 = 0.1;

impl SceneTraits {
    /// The scenes of the paper: rendered, confocal, one cosine, a wall of about a metre.
    pub const DEFAULT: SceneTraits = SceneTraits {
        preset: Preset::Synthetic,
        confocal: true,
        reflectance: Reflectance::Cosine,
        unit: 1.0,
        wall: 1.0,
        pairs: ENOUGH_PAIRS,
    };

    /// No surface is nearer than this by default, metres: a tenth of the wall, where the box of the network begins.
    pub fn near(&self) -> f64 {
        NEAR * self.wall
    }

    /// The properties that follow from a scan: its kind of pairs, the width of its wall. The rest is as usual.
    pub fn of(capture: &Capture) -> SceneTraits {
        let [x0, x1, y0, y1] = capture.wall_extent();
        SceneTraits {
            confocal: capture.is_nearly_confocal(),
            unit: capture.unit(),
            wall: (x1 - x0).max(y1 - y0),
            ..SceneTraits::DEFAULT
        }
    }

    /// Whether histograms were captured.
    pub fn captured(&self) -> bool {
        self.preset == Preset::Captured
    }

    /// Whether surfaces send light back to where it came from.
    pub fn retroreflective(&self) -> bool {
        self.reflectance == Reflectance::Retroreflective
    }

    /// Whether the model is Lambertian.
    pub fn lambertian(&self) -> bool {
        self.reflectance == Reflectance::Lambertian
    }
}

/// The declaration of an option.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Its key in reports and comparisons, with underscores.
    pub key: &'static str,
    /// The heading it stands under in the help.
    pub group: &'static str,
    /// The lines of its text.
    pub lines: &'static [&'static str],
    /// Values that it may have.
    pub range: Range,
}

/// The values that an option may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// A whole number between these.
    Count(usize, usize),
    /// One of these whole numbers.
    OneOf(&'static [usize]),
    /// A seed of random numbers: any whole number.
    Seed,
    /// A finite number above 0.
    Positive,
    /// A finite number, 0 or above.
    NotNegative,
    /// A finite length, 0 or above, metres.
    Length,
    /// In (0, 1].
    Share,
    /// In [0, 1).
    Fraction,
    /// One of these words. For a bool: the word for false, then the one for true.
    Words(&'static [&'static str]),
    /// On or off. The command line has a flag for the value that is not the default: `--name` or `--no-name`.
    Flag,
    /// A text that the setting itself reads, and its name in the help.
    Text(&'static str),
    /// No option of the command line.
    Internal,
}

/// The value of an option.
#[derive(Debug, Clone, PartialEq)]
pub enum OptionValue {
    /// A whole number.
    Count(usize),
    /// A real number.
    Number(f64),
    /// On or off.
    Flag(bool),
    /// A word.
    Word(String),
    /// The solver chooses.
    Unset,
}

/// A set of options.
pub trait Options {
    /// The declarations.
    fn rows(&self) -> Vec<&'static Row>;

    /// The values, in the order of the declarations.
    fn values(&self) -> Vec<OptionValue>;

    /// Checks every option against its range.
    ///
    /// # Errors
    /// The first option out of its range, by its name on the command line.
    fn check_ranges(&self) -> Result<()> {
        for (row, value) in self.rows().into_iter().zip(self.values()) {
            if let Some(want) = row.range.refusal(&value) {
                return Err(refused(row.key, &value, &want));
            }
        }
        Ok(())
    }
}

/// The error of an option that makes no sense.
pub(crate) fn refused(name: &str, value: impl fmt::Display, want: &str) -> Error {
    Error::options(format!("{name} is {value}"), format!("give {want}"))
}

impl Row {
    /// Its name on the command line, without dashes before it.
    pub fn name(&self) -> String {
        self.key.replace('_', "-")
    }

    /// The value as users write it: on and off become the two words of the option.
    pub fn worded(&self, value: OptionValue) -> OptionValue {
        match (self.range, value) {
            (Range::Words(words), OptionValue::Flag(on)) => OptionValue::Word(words[usize::from(on)].into()),
            (_, value) => value,
        }
    }

    /// Its text on one line.
    pub fn text(&self) -> String {
        self.lines.iter().map(|l| l.trim()).collect::<Vec<_>>().join(" ")
    }
}

impl Range {
    /// The allowed values as text.
    fn wanted(self) -> String {
        match self {
            Range::Words(words) => words.join(" or "),
            Range::Flag => "true or false".into(),
            Range::Seed => "a whole number".into(),
            Range::Internal | Range::Text(_) => "another value".into(),
            _ => self.refusal(&OptionValue::Number(f64::NAN)).unwrap_or_default(),
        }
    }

    /// The values that a text may stand for, the likeliest first.
    ///
    /// # Errors
    /// The allowed values, if the text is none.
    fn read(self, text: &str) -> std::result::Result<Vec<OptionValue>, String> {
        let text = text.trim();
        let count = || text.parse().map(|n| vec![OptionValue::Count(n)]).map_err(|_| self.wanted());
        let number = |read: fn(&str) -> std::result::Result<f64, String>| {
            read(text).map(|v| vec![OptionValue::Number(v)]).map_err(|_| self.wanted())
        };
        match self {
            Range::Count(..) | Range::OneOf(_) | Range::Seed => count(),
            Range::Length => number(units::length),
            Range::Positive | Range::NotNegative | Range::Share | Range::Fraction => number(units::number),
            Range::Words(words) if words.contains(&text) => {
                Ok(vec![OptionValue::Word(text.into()), OptionValue::Flag(words.get(1) == Some(&text))])
            }
            Range::Flag if ["true", "false"].contains(&text) => Ok(vec![OptionValue::Flag(text == "true")]),
            Range::Words(_) | Range::Flag | Range::Internal | Range::Text(_) => Err(self.wanted()),
        }
    }

    /// The allowed values as text, if `value` is out of range.
    fn refusal(self, value: &OptionValue) -> Option<String> {
        let number = match value {
            OptionValue::Number(v) => *v,
            OptionValue::Count(n) => *n as f64,
            _ => return None,
        };
        let (good, want) = match self {
            Range::Count(least, most) => (
                (least as f64..=most as f64).contains(&number),
                format!("a whole number from {least} to {most}"),
            ),
            Range::OneOf(all) => (
                all.iter().any(|n| *n as f64 == number),
                all.iter().map(|n| n.to_string()).collect::<Vec<_>>().join(" or "),
            ),
            Range::Positive => (number.is_finite() && number > 0.0, "a positive number".into()),
            Range::NotNegative => (number.is_finite() && number >= 0.0, "zero or a positive number".into()),
            Range::Length => {
                (number.is_finite() && number >= 0.0, "zero or a positive length in metres".into())
            }
            Range::Share => (number > 0.0 && number <= 1.0, "a positive number up to 1".into()),
            Range::Fraction => ((0.0..1.0).contains(&number), "a number from 0 to below 1".into()),
            Range::Seed | Range::Words(_) | Range::Flag | Range::Text(_) | Range::Internal => return None,
        };
        if good && number > LARGEST {
            return Some(format!("{want}, below {LARGEST:e}"));
        }
        (!good).then_some(want)
    }
}

/// Kernels know no larger number.
const LARGEST: f64 = 3e38;

impl fmt::Display for OptionValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OptionValue::Count(n) => n.fmt(f),
            OptionValue::Number(v) if *v != 0.0 && !(1e-4..1e16).contains(&v.abs()) => write!(f, "{v:e}"),
            OptionValue::Number(v) => v.fmt(f),
            OptionValue::Flag(on) => on.fmt(f),
            OptionValue::Word(word) => word.fmt(f),
            OptionValue::Unset => f.write_str("unset"),
        }
    }
}

/// The type of a field that an option sets.
pub trait OptionField {
    /// The type of a value that a caller sets.
    type Given: Clone;
    /// The value of the field.
    fn value(&self) -> OptionValue;
    /// The value that a caller would set for this field; `None` if the solver chooses it.
    fn given(&self) -> Option<Self::Given>;
    /// The field with the value of a caller.
    fn of(given: Self::Given) -> Self;
}

/// A field that has the type of its setting.
macro_rules! given_as_is {
    () => {
        type Given = Self;

        fn given(&self) -> Option<Self> {
            Some(self.clone())
        }

        fn of(given: Self) -> Self {
            given
        }
    };
}

impl OptionField for usize {
    given_as_is!();

    fn value(&self) -> OptionValue {
        OptionValue::Count(*self)
    }
}

impl OptionField for u32 {
    given_as_is!();

    fn value(&self) -> OptionValue {
        OptionValue::Count(*self as usize)
    }
}

impl OptionField for f64 {
    given_as_is!();

    fn value(&self) -> OptionValue {
        OptionValue::Number(*self)
    }
}

impl OptionField for bool {
    given_as_is!();

    fn value(&self) -> OptionValue {
        OptionValue::Flag(*self)
    }
}

impl<T: OptionField<Given = T> + Clone> OptionField for Option<T> {
    type Given = T;

    fn given(&self) -> Option<T> {
        self.clone()
    }

    fn of(given: T) -> Option<T> {
        Some(given)
    }

    fn value(&self) -> OptionValue {
        self.as_ref().map_or(OptionValue::Unset, OptionField::value)
    }
}

/// Enumerations as options: a value is the word that serde writes.
macro_rules! words {
    ($($type:ty),*) => { $(
        impl $crate::options::rows::OptionField for $type {
            $crate::options::rows::given_as_is!();

            fn value(&self) -> $crate::options::rows::OptionValue {
                match serde_json::to_value(self) {
                    Ok(serde_json::Value::String(word)) => $crate::options::rows::OptionValue::Word(word),
                    _ => $crate::options::rows::OptionValue::Unset,
                }
            }
        }
    )* };
}

words!(Binning, Gradient, Reflectance, Sampling);

/// Declares a struct of options.
///
/// ```text
/// options! {
///     /// About the struct. `scene` names the [`SceneTraits`] in the defaults.
///     pub struct PaperOptions: PaperSettings(scene) {
///         nested { domain: Domain }
///         "Solver" {
///             /// The option's text.
///             iterations: usize = if scene.confocal { 900 } else { 1000 }, Range::Count(1, 1_000_000);
///             /// One whose key is not the field's name.
///             term as "noise": NoiseTerm = NoiseTerm::Off, Range::Words(&["off", "bin"]);
///         }
///     }
/// }
/// ```
macro_rules! options {
    (
        $(#[$about:meta])*
        pub struct $name:ident: $settings:ident($scene:ident) {
            nested { $($(#[$inner_about:meta])* $inner:ident: $inner_type:ident / $inner_settings:ident),* $(,)? }
            $($group:literal { $(
                $(#[doc = $line:literal])+
                $(#[serde($serde:meta)])*
                $field:ident $(as $key:literal)?: $type:ty = $default:expr, $range:expr;
            )* })*
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[non_exhaustive]
        pub struct $name {
            $($(
                $(#[doc = $line])+
                $(#[serde($serde)])*
                $(#[serde(rename = $key)])?
                pub $field: $type,
            )*)*
            $($(#[$inner_about])* #[serde(flatten)] pub $inner: $inner_type,)*
        }

        #[doc = concat!("What a caller sets of [`", stringify!($name), "`]: `None` is the default.")]
        #[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default)]
        pub struct $settings {
            $($(
                $(#[doc = $line])+
                #[serde(skip_serializing_if = "Option::is_none")]
                $(#[serde(rename = $key)])?
                pub $field: Option<<$type as $crate::options::rows::OptionField>::Given>,
            )*)*
            $($(#[$inner_about])* #[serde(flatten)] pub $inner: $inner_settings,)*
        }

        impl $crate::options::rows::Given for $settings {
            type Options = $name;

            fn of(options: &$name) -> $settings {
                #[allow(unused_imports)]
                use $crate::options::rows::OptionField;
                $settings {
                    $($($field: options.$field.given(),)*)*
                    $($inner: $inner_settings::of(&options.$inner),)*
                }
            }

            fn apply(&self, options: &mut $name) {
                $($(
                    if let Some(given) = &self.$field {
                        options.$field = $crate::options::rows::OptionField::of(given.clone());
                    }
                )*)*
                $(self.$inner.apply(&mut options.$inner);)*
            }
        }

        impl $name {
            /// The declarations, without those of nested options.
            const ROWS: &'static [$crate::options::rows::Row] = &[$($($crate::options::rows::Row {
                key: $crate::options::rows::key_of!($field $(as $key)?),
                group: $group,
                lines: &[$($line),+],
                range: { use $crate::options::rows::Range; let _ = Range::Seed; $range },
            },)*)*];

            /// The defaults for a scene.
            #[allow(unused_variables)]
            pub fn defaults_for($scene: &$crate::options::rows::SceneTraits) -> $name {
                $name {
                    $($($field: $default,)*)*
                    $($inner: <$inner_type>::defaults_for($scene),)*
                }
            }

            /// These options with a change.
            #[must_use]
            pub fn with(mut self, change: impl FnOnce(&mut $name)) -> $name {
                change(&mut self);
                self
            }
        }

        impl Default for $name {
            fn default() -> $name {
                $name::defaults_for(&$crate::options::rows::SceneTraits::DEFAULT)
            }
        }

        impl $crate::options::rows::Options for $name {
            fn rows(&self) -> Vec<&'static $crate::options::rows::Row> {
                let nested: &[Vec<&'static $crate::options::rows::Row>] = &[$(self.$inner.rows()),*];
                $name::ROWS.iter().chain(nested.iter().flatten().copied()).collect()
            }

            fn values(&self) -> Vec<$crate::options::rows::OptionValue> {
                let own = vec![$($($crate::options::rows::OptionField::value(&self.$field)),*),*];
                let nested: &[Vec<$crate::options::rows::OptionValue>] = &[$(self.$inner.values()),*];
                [own, nested.concat()].concat()
            }
        }
    };
}

/// The key of an option: the name of its field, unless another is given.
macro_rules! key_of {
    ($field:ident) => {
        stringify!($field)
    };
    ($field:ident as $key:literal) => {
        $key
    };
}

pub(crate) use {given_as_is, key_of, options, words};

/// The options that a caller sets, each or none.
pub trait Given: Clone + Default + PartialEq + Serialize + DeserializeOwned {
    /// The options with all values.
    type Options: Clone + Default + Options;

    /// Settings that set all of these options.
    fn of(options: &Self::Options) -> Self;

    /// Puts what is set into the options.
    fn apply(&self, options: &mut Self::Options);

    /// Sets an option by its key to a value as text, lengths and times with or without their units.
    ///
    /// # Errors
    /// No option of that key, or a value that it does not take, with the values that it takes.
    fn set_text(&mut self, key: &str, text: &str) -> Result<()> {
        let rows = Self::Options::default().rows();
        let row = rows.iter().find(|row| row.key == key && row.range != Range::Internal);
        let row = row
            .ok_or_else(|| Error::options(format!("there is no option {key:?}"), advice!["see "[Options]]))?;
        let wrong =
            |want: &str| Error::options(format!("{} is {}", row.key, text.trim()), format!("give {want}"));
        let values = row.range.read(text).map_err(|want| wrong(&want))?;
        let taken = |value: OptionValue| Some((with_value(self, row.key, &value)?, value));
        let (other, value) = values.into_iter().find_map(taken).ok_or_else(|| wrong(&row.range.wanted()))?;
        if let Some(want) = row.range.refusal(&value) {
            return Err(wrong(&want));
        }
        *self = other;
        Ok(())
    }
}

/// Settings with another value of an option; `None` if the option has another type.
fn with_value<S: Serialize + DeserializeOwned>(settings: &S, key: &str, value: &OptionValue) -> Option<S> {
    let json = match value {
        OptionValue::Count(n) => (*n).into(),
        OptionValue::Number(v) => (*v).into(),
        OptionValue::Flag(on) => (*on).into(),
        OptionValue::Word(word) => word.clone().into(),
        OptionValue::Unset => serde_json::Value::Null,
    };
    let mut all = serde_json::to_value(settings).ok()?;
    all.as_object_mut()?.insert(key.into(), json);
    serde_json::from_value(all).ok()
}

/// The default of an option as text: the usual one, then those that differ in other scenes.
pub fn default_text(value_for: impl Fn(&SceneTraits) -> Option<OptionValue>) -> Option<String> {
    let usual = value_for(&SceneTraits::DEFAULT).filter(|v| *v != OptionValue::Unset)?;
    let others = [
        ("captured", SceneTraits { preset: Preset::Captured, ..SceneTraits::DEFAULT }),
        ("where laser and sensor point differ", SceneTraits { confocal: false, ..SceneTraits::DEFAULT }),
        ("lambertian", SceneTraits { reflectance: Reflectance::Lambertian, ..SceneTraits::DEFAULT }),
        (
            "retroreflective",
            SceneTraits { reflectance: Reflectance::Retroreflective, ..SceneTraits::DEFAULT },
        ),
    ];
    let other = |(when, scene): &(&str, SceneTraits)| {
        let value = value_for(scene).filter(|value| *value != usual && *value != OptionValue::Unset)?;
        Some(format!("{value} {when}"))
    };
    Some(
        [usual.to_string()].into_iter().chain(others.iter().filter_map(other)).collect::<Vec<_>>().join(", "),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::{Method, PaperOptions, SolverOptions};
    use crate::surface::SurfaceOptions;

    #[test]
    fn every_option_is_set_by_text_and_reported() {
        for name in SolverOptions::NAMES {
            let options = Method::named(name).unwrap().options(&SceneTraits::DEFAULT);
            let report = serde_json::to_value(&options).unwrap();
            assert_eq!(options.rows().len(), options.values().len());
            for (row, before) in options.rows().into_iter().zip(options.values()) {
                let text = match (&before, row.range) {
                    (OptionValue::Flag(on), Range::Flag) => (!on).to_string(),
                    (OptionValue::Flag(on), Range::Words(words)) => words[usize::from(!on)].into(),
                    (_, Range::Words(words)) => words[words.len() - 1].into(),
                    (_, Range::Count(..) | Range::OneOf(_) | Range::Seed) => "4".into(),
                    _ => "0.75".into(),
                };
                let mut method = Method::named(name).unwrap();
                let set = method.set_text(row.key, &text);
                assert_eq!(set.is_err(), row.range == Range::Internal, "{name}, {}", row.key);
                let after = row.worded(method.options(&SceneTraits::DEFAULT).value(row.key).unwrap());
                assert!(set.is_err() || after.to_string() == text, "{name}, {}: {after}", row.key);
                assert!(report.get(row.key).is_some(), "{} is not in reports", row.key);
                assert!(row.text().len() > 10);
            }
            assert!(Method::named(name).unwrap().set_text("nonsense", "1").is_err());
            assert!(options.value("nonsense").is_none());
        }
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let refuses = |options: &dyn Options, key: &str, want: &str| {
            let error = options.check_ranges().unwrap_err();
            assert!(error.what.contains(key) && error.hint.to_string().contains(want), "{error}");
        };
        let paper = PaperOptions::default;
        refuses(&paper().with(|o| o.lateral = 0), "lateral", "a whole number from 1 to 4096");
        refuses(&paper().with(|o| o.peak = f64::NAN), "peak", "a positive number");
        refuses(&paper().with(|o| o.l1 = -1.0), "l1", "zero or a positive number");
        refuses(&paper().with(|o| o.domain.keep_above = 1.0), "keep_above", "a number from 0 to below 1");
        refuses(&paper().with(|o| o.domain.room = Some(0.0)), "room", "a positive number up to 1");
        refuses(&SurfaceOptions::default().with(|o| o.points = Some(3)), "points", "1 or 4");
        assert!(paper().check_ranges().is_ok());
    }

    #[test]
    fn defaults_are_told_with_what_they_depend_on() {
        let text = |key: &str| {
            default_text(|scene| SolverOptions::from(PaperOptions::defaults_for(scene)).value(key)).unwrap()
        };
        assert_eq!(text("l1"), "0.001, 0.8 captured");
        assert_eq!(text("epsilon"), "1e-8");
        assert_eq!(text("keep_above"), "0.05, 0.03 where laser and sensor point differ");
    }
}
