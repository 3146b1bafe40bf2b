//! The choice of a solver, and the options of all solvers.

use clap::Args;
use thirdbounce::capture::Capture;
use thirdbounce::job::{self, SolverOptions};
use thirdbounce::solve::option::{Preset, Suit, Value};
use thirdbounce::transport::Reflectance;
use thirdbounce::{Error, Result};

use super::options::{Given, word};

#[derive(Args)]
pub struct SolverArgs {
    /// The solver: vector, paper [default: vector]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    pub solver: Option<String>,
    /// How surfaces reflect: cosine, lambertian, retroreflective, isotropic, or auto to choose among the first three by
    /// quick trials [default: auto; paper cosine]
    #[arg(long, value_name = "NAME", help_heading = "Solver")]
    model: Option<String>,
    /// The published parameters to start from [default: captured if all counts are whole numbers or
    /// some are negative, else synthetic]
    #[arg(long, value_name = "SET", value_parser = word::<Preset>(&["synthetic", "captured"]), help_heading = "Solver")]
    pub preset: Option<Preset>,
    /// Get the same bits from every run with the same seed and device: fixed-point accumulation
    #[arg(long, conflicts_with = "accumulation", help_heading = "Solver")]
    deterministic: bool,
    #[command(flatten)]
    given: Given,
}

/// What the arguments make of a capture.
pub struct Resolved {
    pub preset: Preset,
    /// The values that were chosen, as sentences.
    pub notes: Vec<String>,
    pub solver: SolverOptions,
    /// The options for each model, if trials choose it.
    pub models: Vec<SolverOptions>,
}

impl SolverArgs {
    /// Refuses unknown names and values out of range, before any file is read. `base` holds the options that are not
    /// given here.
    pub fn check(&self, base: Option<&SolverArgs>) -> Result<()> {
        for args in [Some(self), base].into_iter().flatten() {
            args.solver.as_deref().map_or(Ok(()), job::check_solver)?;
            args.model
                .as_deref()
                .filter(|m| *m != "auto")
                .map_or(Ok(()), |m| job::reflectance(m).map(drop))?;
        }
        // The ranges do not depend on the scene.
        self.options(base, &Suit::USUAL).check()
    }

    /// The seed that was given, else 0.
    pub fn seed(&self) -> u64 {
        match self.given.get("seed") {
            Some(Value::Count(seed)) => *seed as u64,
            _ => 0,
        }
    }

    /// Refuses options that only another solver has. Ignoring them would mislead.
    pub fn check_fit(&self) -> Result<()> {
        let name = self.solver.as_deref().unwrap_or(SolverOptions::DEFAULT);
        let options = SolverOptions::suited_to(name, &Suit::USUAL);
        options.and_then(|options| self.given.foreign(&options)).map_or(Ok(()), |option| {
            Err(Error::options(
                format!("--{option} is no option of the {name} solver"),
                "leave it out, or choose the other --solver (`thirdbounce reconstruct --help` lists both)",
            ))
        })
    }

    /// What the arguments make of `capture`.
    pub fn resolve(&self, base: Option<&SolverArgs>, capture: &Capture) -> Resolved {
        let given = self.preset.or(base.and_then(|b| b.preset));
        let preset = given.unwrap_or_else(|| job::preset_for(capture));
        let mut notes = vec![];
        if given.is_none() {
            let why = match preset {
                _ if capture.integer_counts => "the counts are whole numbers",
                Preset::Captured => "some counts are negative",
                Preset::Synthetic => "the counts are not whole numbers",
            };
            notes.push(format!("{why}: --preset {} is used", job::plain(&preset)));
        }
        let of_model = |reflectance| self.options(base, &Suit { preset, reflectance, ..Suit::of(capture) });
        // `check` has refused unknown names.
        let named = self.model(base).and_then(|name| job::reflectance(name).ok());
        let solver = of_model(named.unwrap_or(Reflectance::Cosine));
        // The paper's solver has the paper's model.
        let usual = self.model(base).is_none() && solver.name() != SolverOptions::DEFAULT;
        let models = if named.is_some() || usual { vec![] } else { job::MODELS.map(of_model).to_vec() };
        Resolved { preset, notes, solver, models }
    }

    fn model<'a>(&'a self, base: Option<&'a SolverArgs>) -> Option<&'a str> {
        self.model.as_deref().or(base.and_then(|b| b.model.as_deref()))
    }

    /// The defaults for such scenes, then the options of `base`, then the options given here. Later ones replace
    /// earlier ones.
    fn options(&self, base: Option<&SolverArgs>, suit: &Suit) -> SolverOptions {
        let named = self.solver.as_deref().or(base.and_then(|b| b.solver.as_deref()));
        // `check` has refused unknown names.
        let start = named.and_then(|name| SolverOptions::suited_to(name, suit));
        let mut options = start
            .or_else(|| SolverOptions::suited_to(SolverOptions::DEFAULT, suit))
            .expect("the default solver");
        for args in base.into_iter().chain([self]) {
            args.given.over(&mut options);
            if args.deterministic {
                options.set("accumulation", &Value::Word("fixed".into()));
            }
        }
        options
    }
}
