//! Which solver, and every solver's options.

use clap::Args;
use thirdbounce::capture::Capture;
use thirdbounce::job::{self, SolverOptions};
use thirdbounce::solve::{PaperOptions, Preset, VectorOptions, assume_reflectance};
use thirdbounce::transport::Reflectance;
use thirdbounce::{Error, Result};

use super::options::{PaperArgs, VectorArgs, word};

#[derive(Args)]
pub struct SolverArgs {
    /// How to solve: vector, paper [default: vector]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    pub solver: Option<String>,
    /// How surfaces reflect: cosine, lambertian, retroreflective, isotropic, or auto: by the falloff that
    /// the capture shows [default: cosine]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    model: Option<String>,
    /// Leave nothing out that this scene does not need: the most general kernels, to compare with
    #[arg(long, help_heading = "Solver")]
    general: bool,
    /// The published parameters to start from [default: captured if all counts are whole, else synthetic]
    #[arg(long, value_name = "SET", value_parser = word::<Preset>(&["synthetic", "captured"]), help_heading = "Solver")]
    pub preset: Option<Preset>,
    #[command(flatten)]
    paper: PaperArgs,
    #[command(flatten)]
    vector: VectorArgs,
}

impl SolverArgs {
    /// Refuses what this version does not have and what makes no sense, before any file is read. `base` holds
    /// what is not given here.
    pub fn check(&self, base: Option<&SolverArgs>) -> Result<()> {
        for args in [Some(self), base].into_iter().flatten() {
            args.solver.as_deref().map_or(Ok(()), job::check_solver)?;
            args.model
                .as_deref()
                .filter(|m| *m != "auto")
                .map_or(Ok(()), |m| job::reflectance(m).map(drop))?;
        }
        // The rest does not depend on the preset in what is allowed.
        self.options(base, Preset::Synthetic, true, Reflectance::Cosine).check()
    }

    /// The seed that was given, else 0.
    pub fn seed(&self) -> u64 {
        self.paper.seed.map_or(0, u64::from)
    }

    /// Refuses options that only another solver has: to ignore them would mislead.
    pub fn check_fit(&self) -> Result<()> {
        let name = self.solver.as_deref().unwrap_or(SolverOptions::DEFAULT);
        let other = if name == "vector" { self.paper.own() } else { self.vector.own() };
        other.map_or(Ok(()), |option| {
            Err(Error::options(
                format!("--{option} is no option of the {name} solver"),
                "leave it out, or choose the other --solver (`thirdbounce reconstruct --help` lists both)",
            ))
        })
    }

    /// The preset for `capture`, notes on what was not given, and the options over it.
    pub fn resolve(
        &self,
        base: Option<&SolverArgs>,
        capture: &Capture,
    ) -> (Preset, Vec<String>, SolverOptions) {
        let given = self.preset.or(base.and_then(|b| b.preset));
        let preset = given.unwrap_or_else(|| job::preset_for(capture));
        let mut notes = vec![];
        if given.is_none() {
            let counts = if capture.integer_counts { "whole numbers" } else { "not whole numbers" };
            notes.push(format!("the counts are {counts}: --preset {} is used", job::plain(&preset)));
        }
        let reflectance = match self.model(base) {
            Some("auto") => {
                let (reflectance, why) = assume_reflectance(capture);
                notes.push(why);
                reflectance
            }
            // `check` has let through known names only.
            Some(name) => job::reflectance(name).unwrap_or(Reflectance::Cosine),
            None => Reflectance::Cosine,
        };
        (preset, notes, self.options(base, preset, capture.is_confocal(), reflectance))
    }

    fn model<'a>(&'a self, base: Option<&'a SolverArgs>) -> Option<&'a str> {
        self.model.as_deref().or(base.and_then(|b| b.model.as_deref()))
    }

    /// These options over those of `base` over the preset. Every solver has its arm here.
    fn options(
        &self,
        base: Option<&SolverArgs>,
        preset: Preset,
        confocal: bool,
        reflectance: Reflectance,
    ) -> SolverOptions {
        let name = self
            .solver
            .as_deref()
            .or(base.and_then(|b| b.solver.as_deref()))
            .unwrap_or(SolverOptions::DEFAULT);
        let general = self.general || base.is_some_and(|b| b.general);
        // `check` has let through these two only.
        if name == "vector" {
            let start = VectorOptions { general, ..VectorOptions::default() }.suited(confocal, reflectance);
            let start = base.map_or(start.clone(), |b| b.vector.over(&b.paper, start));
            return self.vector.over(&self.paper, start).into();
        }
        let start = PaperOptions { general, ..PaperOptions::preset(preset) }.suited(confocal, reflectance);
        let start = base.map_or(start.clone(), |b| b.paper.over(start));
        self.paper.over(start).into()
    }
}
