//! Which solver, and every solver's options.

use clap::Args;
use thirdbounce::Result;
use thirdbounce::capture::Capture;
use thirdbounce::job::{self, SolverOptions};
use thirdbounce::solve::{PaperOptions, Preset};

use super::options::{PaperArgs, word};

#[derive(Args)]
pub struct SolverArgs {
    /// How to solve: paper [default: paper]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    pub solver: Option<String>,
    /// How surfaces reflect: cosine [default: cosine]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    model: Option<String>,
    /// The published parameters to start from [default: captured if all counts are whole, else synthetic]
    #[arg(long, value_name = "SET", value_parser = word::<Preset>(&["synthetic", "captured"]), help_heading = "Solver")]
    pub preset: Option<Preset>,
    #[command(flatten)]
    paper: PaperArgs,
}

impl SolverArgs {
    /// Refuses what this version does not have and what makes no sense, before any file is read. `base` holds
    /// what is not given here.
    pub fn check(&self, base: Option<&SolverArgs>) -> Result<()> {
        for args in [Some(self), base].into_iter().flatten() {
            args.solver.as_deref().map_or(Ok(()), job::check_solver)?;
            args.model.as_deref().map_or(Ok(()), job::check_model)?;
        }
        // The rest does not depend on the preset in what is allowed.
        self.options(base, Preset::Synthetic).check()
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
        // Once there are more: match self.solver.as_deref().or(base's).unwrap_or(the default), one arm each.
        let start = PaperOptions::preset(preset);
        let start = base.map_or(start.clone(), |b| b.paper.over(start));
        SolverOptions::Paper(self.paper.over(start))
    }
}
