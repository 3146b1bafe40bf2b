//! Chooses how surfaces reflect: the model whose surface predicts other pairs best.

use serde::{Deserialize, Serialize};

use super::pulse::Tried;
use crate::surface::Left;
use crate::transport::Reflectance;

/// The models that trials choose among; the first stands where there are no trials.
pub const MODELS: [Reflectance; 3] =
    [Reflectance::Cosine, Reflectance::Lambertian, Reflectance::Retroreflective];

/// The models that can be true of a capture. What sends light back to where it came from sends none to other points of the
/// wall.
pub fn possible_models(confocal: bool) -> impl Iterator<Item = Reflectance> {
    MODELS.into_iter().filter(move |model| confocal || *model != Reflectance::Retroreflective)
}

/// The result of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundModel {
    /// How surfaces reflect.
    pub reflectance: Reflectance,
    /// The trials that began alike: the model, the width of its pulse in metres (0: sharp paths, or the known pulse), and
    /// the share of other pairs' squares that its surface leaves.
    pub trials: Vec<(Reflectance, f64, Option<f64>)>,
    /// Whether cosine stays because photon noise alone makes what Lambertian leaves less.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_by_chance: bool,
    /// Why the trials failed, if they did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

impl FoundModel {
    pub(super) fn of(
        reflectance: Reflectance,
        tried: &[Tried],
        is_by_chance: bool,
        failed: Option<String>,
    ) -> FoundModel {
        let trials =
            tried.iter().map(|t| (t.reflectance, t.pulse.fwhm, t.left.as_ref().map(Left::share))).collect();
        FoundModel { reflectance, trials, is_by_chance, failed }
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        let name = self.reflectance.name();
        if let Some(why) = &self.failed {
            return format!(
                "the model of reflectance is not known, {name} is taken: {why} (name it if known)"
            );
        }
        // The least of each model.
        let mut each: Vec<(Reflectance, f64)> = vec![];
        for (model, _, left) in &self.trials {
            let Some(left) = *left else { continue };
            match each.iter_mut().find(|e| e.0 == *model) {
                Some(known) => known.1 = known.1.min(left),
                None => each.push((*model, left)),
            }
        }
        let reported: Vec<String> =
            each.iter().map(|(m, left)| format!("{} {:.2} %", m.name(), 100.0 * left)).collect();
        let least = each.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let why =
            least.filter(|(model, _)| *model != self.reflectance).map_or_else(String::new, |(model, _)| {
                let bound = match self.is_by_chance {
                    true => format!("{BY_CHANCE:.0} standard errors that photon noise makes"),
                    false => {
                        format!("two standard errors or {:.0} % of what is beyond noise", 100.0 * MARGIN)
                    }
                };
                format!("; {} leaves less, but by less than {bound}, so {name} is kept", model.name())
            });
        format!(
            "the model of reflectance: {name}, by trials; of pairs that it has not seen, each leaves: {}{why} (name a \
             model to skip the trials)",
            reported.join(", ")
        )
    }
}

/// A model is rejected if one of another falloff leaves less beyond photon noise by this share, and less by two standard errors.
const MARGIN: f64 = 0.06;

/// Lambertian is taken in place of cosine beyond these standard errors of the difference that photon noise of the held-out pairs alone
/// makes; that of the fitted pairs makes as much. Evidence: benches/NOTES.md, "Masks and models at few photons".
pub const BY_CHANCE: f64 = 4.0;

/// The order in which falloffs are kept where the hold-out set cannot tell them apart. Among models of one falloff the objective is
/// the same, so the one that leaves less is the better one (benches/NOTES.md, "Models by what they leave").
const FIRST: [Reflectance; 4] =
    [Reflectance::Cosine, Reflectance::Retroreflective, Reflectance::Isotropic, Reflectance::Lambertian];

/// The models that leave as little as any other, but for chance.
pub(super) fn unbeaten(left: &[(Reflectance, Option<Left>)]) -> Vec<Reflectance> {
    let found: Vec<(Reflectance, &Left)> = left.iter().filter_map(|(m, l)| Some((*m, l.as_ref()?))).collect();
    let Some(least) = found.iter().map(|f| f.1).min_by(|a, b| a.excess().total_cmp(&b.excess())) else {
        return vec![];
    };
    let by_margin = |other: &Left| least.excess() < (1.0 - MARGIN) * other.excess();
    let is_beaten = |left: &Left| least.is_less(left) && by_margin(left);
    found.into_iter().filter(|(_, left)| !is_beaten(left)).map(|(model, _)| model).collect()
}

/// Of the falloffs whose models leave as little as any other, but for chance, the one that comes first; of its models the one that
/// leaves least. `None` if no trial found a surface.
pub(super) fn choose(left: &[(Reflectance, Option<Left>)]) -> Option<Reflectance> {
    let unbeaten = unbeaten(left);
    let first = FIRST.into_iter().find(|model| unbeaten.contains(model))?;
    let alike = left.iter().filter(|(model, _)| model.falloff_power() == first.falloff_power());
    let found = alike.filter_map(|(model, left)| Some((*model, left.as_ref()?.share())));
    found.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(model, _)| model)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Reflectance::{Cosine, Lambertian, Retroreflective};

    /// Pairs that leave `mean` on average, which differ by `noise`, of squares of 100.
    fn left(mean: f64, noise: f64) -> Option<Left> {
        let of = |i: usize| [mean + noise * if i.is_multiple_of(2) { 1.0 } else { -1.0 }, 100.0];
        Some(Left { pairs: (0..64).map(of).collect(), noise: 0.0 })
    }

    #[test]
    fn the_first_falloff_is_kept_unless_another_is_better_beyond_chance() {
        let of = |retroreflective: Option<Left>| {
            choose(&[
                (Cosine, left(5.0, 0.0)),
                (Lambertian, left(6.0, 0.0)),
                (Retroreflective, retroreflective),
            ])
        };
        // The standard error is an eighth of the noise.
        assert_eq!(of(left(4.4, 0.2)), Some(Retroreflective));
        assert_eq!(of(left(4.4, 4.0)), Some(Cosine), "less than two standard errors of a half");
        assert_eq!(of(left(4.75, 0.0)), Some(Cosine), "by less than the margin");
    }

    #[test]
    fn of_models_with_one_falloff_the_one_that_leaves_least_is_chosen() {
        let of = |lambertian: Option<Left>| {
            choose(&[(Cosine, left(5.0, 0.0)), (Lambertian, lambertian), (Retroreflective, left(5.0, 2.0))])
        };
        assert_eq!(of(left(4.99, 4.0)), Some(Lambertian), "however little the difference is");
        assert_eq!(of(left(5.01, 0.0)), Some(Cosine));
        assert_eq!(of(None), Some(Cosine));
        // Retroreflective is beaten by the better one of the two.
        assert_eq!(of(left(3.0, 0.1)), Some(Lambertian));
    }

    #[test]
    fn a_model_without_a_surface_is_not_chosen() {
        assert_eq!(choose(&[(Cosine, None), (Lambertian, None)]), None);
        assert_eq!(choose(&[(Cosine, left(5.0, 0.1)), (Lambertian, None)]), Some(Cosine));
        assert_eq!(choose(&[(Cosine, None), (Lambertian, left(5.0, 0.1))]), Some(Lambertian));
    }

    #[test]
    fn the_note_tells_the_least_of_each_model() {
        let trials = vec![
            (Cosine, 0.0, Some(0.05)),
            (Lambertian, 0.0, Some(0.08)),
            (Retroreflective, 0.0, None),
            (Lambertian, 0.02, Some(0.03)),
        ];
        let found = FoundModel { reflectance: Lambertian, trials, is_by_chance: false, failed: None };
        let note = found.note();
        assert!(
            note.contains("lambertian, by trials") && note.contains("cosine 5.00 %, lambertian 3.00 %"),
            "{note}"
        );
        assert!(!note.contains("retroreflective") && !note.contains("is kept"), "{note}");
        let simple = FoundModel { reflectance: Cosine, ..found.clone() }.note();
        assert!(simple.contains("lambertian leaves less, but by less than two standard errors"), "{simple}");
        let by_chance = FoundModel { reflectance: Cosine, is_by_chance: true, ..found.clone() }.note();
        assert!(by_chance.contains("less than 4 standard errors that photon noise makes"), "{by_chance}");
        let failed = FoundModel { failed: Some("no surface".into()), ..found };
        assert!(
            failed.note().contains("is not known") && failed.note().contains("no surface"),
            "{}",
            failed.note()
        );
    }
}
