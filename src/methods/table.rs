//! The solvers of this version, and what all of them can do.

use std::ops::{Deref, DerefMut};

use serde::{Deserialize, Serialize};

use crate::capture::{Capture, Pulse};
use crate::closed_form::{
    BpOptions, BpSettings, ClosedForm, DlctOptions, DlctSettings, FbpOptions, FbpSettings, FkOptions,
    FkSettings, LctOptions, LctSettings, PhasorBpOptions, PhasorBpSettings, PhasorOptions, PhasorSettings,
};
use crate::engine::plan::passes;
use crate::engine::{
    Accumulation, Common, Pass, Plan, Problem, Reconstruction, Solver, Watch, default_volume, pixel_of,
};
use crate::error::unknown;
use crate::gpu::{Gpu, check};
use crate::methods::paper;
use crate::methods::paper::{PaperOptions, PaperSettings};
use crate::options::{Given, OptionValue, Row, SceneTraits, default_text};
use crate::surface::{Begun, SurfaceOptions, SurfaceSettings};
use crate::transport::{Reflectance, Volume};
use crate::{Result, closed_form, surface};

/// Declares the methods: one line for each.
macro_rules! solvers {
    (
        iterative { $($variant:ident($options:ident, $settings:ident);)* }
        closed_form { $($closed:ident($closed_options:ident, $closed_settings:ident);)* }
    ) => {
        solvers! {
            all
            $($variant($options, $settings);)*
            $($closed($closed_options, $closed_settings);)*
        }

        impl SolverOptions {
            /// The same options with another model of reflectance.
            pub fn with_reflectance(self, reflectance: Reflectance) -> SolverOptions {
                match self {
                    $(SolverOptions::$variant(o) => o.with(|o| o.reflectance = reflectance).into(),)*
                    $(SolverOptions::$closed(o) => o.with(|o| o.image.reflectance = reflectance).into(),)*
                }
            }

            /// The same options with another order of sums; without effect on methods without iterations.
            pub fn with_accumulation(self, accumulation: Accumulation) -> SolverOptions {
                match self {
                    $(SolverOptions::$variant(o) => o.with(|o| o.accumulation = accumulation).into(),)*
                    closed => closed,
                }
            }

            /// Whether it computes the volume in one step, without iterations.
            pub fn is_closed_form(&self) -> bool {
                match self {
                    $(SolverOptions::$variant(_) => false,)*
                    $(SolverOptions::$closed(_) => true,)*
                }
            }
        }
    };

    (all $($variant:ident($options:ident, $settings:ident);)*) => {
        /// A method with the options that a caller sets: the others follow from the capture.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "solver", rename_all = "kebab-case")]
        #[allow(missing_docs)]
        pub enum Method {
            $($variant($settings),)*
        }

        $(impl From<$settings> for Method {
            fn from(settings: $settings) -> Method {
                Method::$variant(settings)
            }
        })*

        impl Method {
            /// The method of that name without settings; `None` if there is no such method.
            pub fn named(name: &str) -> Option<Method> {
                $(if name == $options::NAME {
                    return Some(Method::$variant($settings::default()));
                })*
                None
            }

            /// The method with all options set.
            pub fn of(options: &SolverOptions) -> Method {
                match options {
                    $(SolverOptions::$variant(o) => Method::$variant($settings::of(o)),)*
                }
            }

            /// Its name.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Method::$variant(_) => $options::NAME,)*
                }
            }

            /// The options of the method for a scene: those that are set, and the defaults.
            pub fn options(&self, scene: &SceneTraits) -> SolverOptions {
                match self {
                    $(Method::$variant(settings) => {
                        let mut options = $options::defaults_for(scene);
                        settings.apply(&mut options);
                        options.into()
                    })*
                }
            }

            /// Sets an option by its key to a value as text: [`Given::set_text`].
            ///
            /// # Errors
            /// The method has no option of that key, or it does not take the value.
            pub fn set_text(&mut self, key: &str, text: &str) -> Result<()> {
                match self {
                    $(Method::$variant(settings) => settings.set_text(key, text),)*
                }
            }
        }

        /// The options of one of the methods.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[serde(untagged)]
        pub enum SolverOptions {
            $(
                #[allow(missing_docs)]
                $variant($options),
            )*
        }

        $(impl From<$options> for SolverOptions {
            fn from(options: $options) -> SolverOptions {
                SolverOptions::$variant(options)
            }
        })*

        impl SolverOptions {
            /// All methods of this version, by their names on the command line.
            pub const NAMES: &[&str] = &[$($options::NAME),*];

            /// The options of the solver `name` with the defaults for `scene`; `None` if there is no such solver.
            pub fn defaults_for(name: &str, scene: &SceneTraits) -> Option<SolverOptions> {
                $(if name == $options::NAME {
                    return Some($options::defaults_for(scene).into());
                })*
                None
            }

            /// Its name on the command line.
            pub fn name(&self) -> &'static str {
                match self {
                    $(SolverOptions::$variant(_) => $options::NAME,)*
                }
            }

            /// The same options for another lateral resolution.
            pub fn with_lateral(&self, lateral: usize) -> SolverOptions {
                match self.clone() {
                    $(SolverOptions::$variant(o) => o.with(|o| o.lateral = lateral).into(),)*
                }
            }
        }

        /// What every method can do.
        impl Deref for SolverOptions {
            type Target = dyn Solver;

            fn deref(&self) -> &Self::Target {
                match self {
                    $(SolverOptions::$variant(o) => o,)*
                }
            }
        }

        impl DerefMut for SolverOptions {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self {
                    $(SolverOptions::$variant(o) => o,)*
                }
            }
        }
    };
}

solvers! {
    iterative {
        Paper(PaperOptions, PaperSettings);
        Surface(SurfaceOptions, SurfaceSettings);
    }
    closed_form {
        Lct(LctOptions, LctSettings);
        Dlct(DlctOptions, DlctSettings);
        Fk(FkOptions, FkSettings);
        Phasor(PhasorOptions, PhasorSettings);
        PhasorBp(PhasorBpOptions, PhasorBpSettings);
        Fbp(FbpOptions, FbpSettings);
        Bp(BpOptions, BpSettings);
    }
}

impl SolverOptions {
    /// The default solver (docs/methods.md).
    pub const DEFAULT: &str = SurfaceOptions::NAME;

    /// The surface solver's options for the same scene: for short fits beside the requested solve.
    pub fn as_surface(&self) -> SurfaceOptions {
        match self {
            SolverOptions::Surface(o) => o.clone(),
            other => {
                let Common { reflectance, min_depth, .. } = other.common();
                let scene = SceneTraits { reflectance, ..SceneTraits::DEFAULT };
                SurfaceOptions::defaults_for(&scene).with(|o| o.min_depth = min_depth)
            }
        }
    }

    /// The value of an option; `None` if the method has none of that key.
    pub fn value(&self, key: &str) -> Option<OptionValue> {
        self.rows().into_iter().zip(self.values()).find(|(row, _)| row.key == key).map(|(_, value)| value)
    }

    /// The most iterations of all fits.
    pub fn all_iterations(&self) -> usize {
        self.common().iterations.iter().sum()
    }

    /// The default volume to reconstruct.
    ///
    /// # Errors
    /// The capture gives no range of depths.
    pub fn default_volume(&self, capture: &Capture) -> Result<Volume> {
        default_volume(capture, self.common().min_depth)
    }

    /// The depth of a voxel where none is given, metres: a bin of path, or half of the voxel's width if that is more.
    /// Maxima are interpolated between voxels, so flatter ones would cost time for nothing. Solvers
    /// that take the capture's own bins take the bin, and those with finer detail that detail ([`Solver::detail`]), down to
    /// half of the depth that others have. `volume` is the box if it is not the default one.
    pub fn usual_depth_pitch(&self, capture: &Capture, volume: Option<Volume>) -> f64 {
        match self.pixels_per_voxel() {
            Some(pixels) => {
                let pixel = pixel_of(capture, volume, self.common().lateral);
                let usual = capture.bin_width.max(OF_WIDTH * pixels as f64 * pixel);
                let detail = self.detail().zip(capture.spacing()).map(|(share, step)| share * step);
                detail.map_or(usual, |detail| detail.clamp(0.5 * usual, usual))
            }
            None => capture.bin_width,
        }
    }

    /// How many neighbouring bins are one for the solver if nothing else is asked for: those that the maps' pixels and the
    /// pulse do not tell apart. Over a pixel, paths differ by about its width. So bins are wide enough for one point to
    /// render it: narrower ones take four times the surface's time, and results are as good (benches/NOTES.md). Solvers
    /// that take the capture's own bins sum none. `volume` is the box if it is not the default one. Counts do not matter.
    pub fn usual_sum(&self, capture: &Capture, volume: Option<Volume>) -> usize {
        if self.pixels_per_voxel().is_none() {
            return 1;
        }
        let pulse = capture.pulse.as_ref().map_or(0.0, Pulse::deviation);
        let pixel = pixel_of(capture, volume, self.common().lateral);
        let of_pixel = pixel / (surface::SMALL_PIXEL * capture.bin_width);
        let of_pulse = OF_PULSE * pulse / capture.bin_width;
        let sum = (of_pixel - 1e-6).ceil().max((of_pulse + 1e-6).floor());
        (sum as usize).clamp(1, capture.bins)
    }

    /// Pixels that a voxel is wide; `None` for a solver that takes the capture's own bins, as the paper's does.
    pub fn pixels_per_voxel(&self) -> Option<usize> {
        match self {
            SolverOptions::Paper(_) => None,
            other => Some(other.common().pixels_per_voxel),
        }
    }

    /// The share of the brightest albedo above which the maps usually count as surface: the paper's, for its solver.
    /// `None`: the method defines the mask.
    pub fn usual_mask(&self) -> Option<f64> {
        match self {
            SolverOptions::Paper(o) => Some(o.domain.keep_above),
            _ => None,
        }
    }

    /// Solves a problem, from the surface that earlier fits of it have `begun`, if the solver has one.
    ///
    /// # Errors
    /// As [`Solver::solve`].
    pub(crate) fn solve_from(
        &self,
        gpu: &Gpu,
        problem: &Problem<'_>,
        begun: Option<&Begun>,
        watch: &mut Watch<'_>,
    ) -> Result<Reconstruction> {
        match self {
            SolverOptions::Surface(options) if begun.is_some() => {
                self.check()?;
                problem.capture.check()?;
                surface::prepare(gpu, problem, options, None, begun)?.solve(problem.capture, watch)
            }
            _ => self.solve(gpu, problem, watch),
        }
    }

    /// The plan of a solve on a device.
    ///
    /// # Errors
    /// As [`Solver::plan`], and it does not fit.
    pub fn plan_within(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Plan> {
        let plan = self.plan(problem, &gpu.abilities())?;
        check(&plan.buffers, &gpu.memory(), problem.memory)?;
        if let SolverOptions::Surface(options) = self {
            options.check_judged(gpu, problem)?;
        }
        Ok(plan)
    }

    /// The options of all solvers, each once, with its text and what it is by default.
    pub fn all_rows() -> Vec<(&'static Row, String)> {
        let usual = Self::NAMES.iter().filter_map(|name| Self::defaults_for(name, &SceneTraits::DEFAULT));
        let mut rows: Vec<&'static Row> = vec![];
        for row in usual.flat_map(|options| options.rows()) {
            if rows.iter().all(|r| r.key != row.key) {
                rows.push(row);
            }
        }
        rows.into_iter().map(|row| (row, help_of(row))).collect()
    }
}

/// The passes of all solvers: those that they share, then one list for each.
static PASSES: &[&[&Pass]] =
    &[passes::ALL, paper::passes::ALL, closed_form::passes::ALL, surface::passes::ALL];

/// The pass that schedules call by this name. Some names stand for one pass in each solver.
pub fn pass_of(kernel: &str) -> Option<&'static Pass> {
    PASSES.iter().copied().flatten().copied().find(|p| p.kernel.name() == kernel)
}

/// A bin is at most this share of the pulse's standard deviation. Timing loses about a hundredth of its precision to it:
/// its variance is a 48th of the pulse's.
const OF_PULSE: f64 = 0.5;

/// A voxel is at least this share of its width deep.
const OF_WIDTH: f64 = 0.5;

/// The text of an option, with its default where that is a value.
fn help_of(row: &Row) -> String {
    let default = |name: &&'static str| {
        let value =
            |scene: &SceneTraits| Some(row.worded(SolverOptions::defaults_for(name, scene)?.value(row.key)?));
        let text = default_text(value)?;
        Some((*name, text))
    };
    let text = row.text();
    if matches!(row.range, crate::options::Range::Flag) || text.contains("[default:") {
        return text;
    }
    let defaults: Vec<_> = SolverOptions::NAMES.iter().filter_map(default).collect();
    let same = defaults.iter().all(|d| d.1 == defaults[0].1);
    match &defaults[..] {
        [] => text,
        [(_, one), ..] if same => format!("{text} [default: {one}]"),
        several => {
            let all: Vec<_> = several.iter().map(|(name, value)| format!("{name} {value}")).collect();
            format!("{text} [default: {}]", all.join("; "))
        }
    }
}

impl Default for Method {
    fn default() -> Method {
        Method::Surface(SurfaceSettings::default())
    }
}

/// The method of that name.
///
/// # Errors
/// The solver is not known.
pub fn method(name: &str) -> Result<Method> {
    Method::named(name).ok_or_else(|| unknown("solver", name, SolverOptions::NAMES))
}
