//! Which solver, and every solver's options.

use clap::Args;
use thirdbounce::capture::Capture;
use thirdbounce::job::{self, SolverOptions};
use thirdbounce::solve::{PaperOptions, Preset, VectorOptions};
use thirdbounce::transport::Reflectance;
use thirdbounce::{Error, Result};

use super::options::{PaperArgs, VectorArgs, word};

#[derive(Args)]
pub struct SolverArgs {
    /// How to solve: vector, paper [default: vector]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    pub solver: Option<String>,
    /// How surfaces reflect: cosine, lambertian, retroreflective, isotropic [default: cosine]
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
            args.model.as_deref().map_or(Ok(()), |m| job::reflectance(m).map(drop))?;
        }
        // The rest does not depend on the preset in what is allowed.
        self.options(base, Preset::Synthetic).check()
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

    /// The preset for `capture`, a note if it was not given, and the options over it.
    pub fn resolve(
        &self,
        base: Option<&SolverArgs>,
        capture: &Capture,
    ) -> (Preset, Option<String>, SolverOptions) {
        let given = self.preset.or(base.and_then(|b| b.preset));
        let preset = given.unwrap_or_else(|| job::preset_for(capture));
        let note = given.is_none().then(|| {
            let counts = if capture.integer_counts { "whole numbers" } else { "not whole numbers" };
            format!("the counts are {counts}: --preset {} is used", job::plain(&preset))
        });
        (preset, note, self.options(base, preset))
    }

    /// These options over those of `base` over the preset. Every solver has its arm here.
    fn options(&self, base: Option<&SolverArgs>, preset: Preset) -> SolverOptions {
        let name = self
            .solver
            .as_deref()
            .or(base.and_then(|b| b.solver.as_deref()))
            .unwrap_or(SolverOptions::DEFAULT);
        let model = self.model.as_deref().or(base.and_then(|b| b.model.as_deref()));
        let general = self.general || base.is_some_and(|b| b.general);
        // `check` has let through known names only.
        let reflectance =
            model.map_or(Reflectance::Cosine, |m| job::reflectance(m).unwrap_or(Reflectance::Cosine));
        if name == "vector" {
            let start = VectorOptions::default();
            let start = base.map_or(start.clone(), |b| b.vector.over(&b.paper, start));
            return VectorOptions { reflectance, general, ..self.vector.over(&self.paper, start) }.into();
        }
        let start = PaperOptions::preset(preset);
        let start = base.map_or(start.clone(), |b| b.paper.over(start));
        PaperOptions { reflectance, general, ..self.paper.over(start) }.into()
    }
}
