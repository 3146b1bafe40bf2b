//! The choice of a solver, and the options of all solvers.

use clap::Args;
use thirdbounce::job::Choice;
use thirdbounce::solve::option::{OptionValue, Preset};
use thirdbounce::{Error, Result};

use super::options::{OptionValues, flag, word};

#[derive(Args)]
pub struct SolverArgs {
    /// The solver: surface, paper, or a closed-form method: lct, dlct, fk, phasor, phasor-bp, fbp, bp [default: surface]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    solver: Option<String>,
    /// How surfaces reflect: cosine, lambertian, retroreflective, isotropic, or auto to choose among the first three by
    /// quick trials [default: auto; paper cosine]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    model: Option<String>,
    /// The published parameters to start from [default: captured if all counts are whole numbers or
    /// some are negative, else synthetic]
    #[arg(long, value_name = "SET", value_parser = word::<Preset>(&["synthetic", "captured"]), help_heading = "Solver")]
    pub preset: Option<Preset>,
    /// Get the same bits from every run with the same seed and device
    #[arg(long, conflicts_with = "accumulation", help_heading = "Solver")]
    deterministic: bool,
    #[command(flatten)]
    given: OptionValues,
}

impl SolverArgs {
    /// What the arguments choose.
    pub fn choice(&self) -> Choice {
        let repeats = self.deterministic.then(|| ("accumulation", OptionValue::Word("repeatable".into())));
        Choice {
            solver: self.solver.clone(),
            model: self.model.clone(),
            preset: self.preset,
            options: self.given.all().cloned().chain(repeats).collect(),
        }
    }

    /// Refuses options that only another solver has. Ignoring them would mislead.
    pub fn check_fit(&self) -> Result<()> {
        let choice = self.choice();
        choice.foreign().map_or(Ok(()), |key| {
            Err(Error::options(
                format!("--{} is no option of the {} solver", flag(key), choice.solver_name()),
                "leave it out, or choose another --solver (`thirdbounce reconstruct --help` lists them)",
            ))
        })
    }
}
