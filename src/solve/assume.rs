//! Which reflectance a capture suggests.
//!
//! The total of a confocal pair falls with its mean path t: as t^-2 where surfaces are retroreflective, as t^-4 where
//! they are isotropic, and faster where cosines at the wall add to it. Matt surfaces that face the wall reach t^-8.
//! Curved surfaces, which face some pair anywhere, stay near t^-4 whatever their material. So the slope tells
//! retroreflective surfaces, and matt ones that face the wall, from the rest, and no more.

use crate::capture::Capture;
use crate::solve::background;
use crate::transport::Reflectance;

/// Slopes above this are retroreflective.
const RETROREFLECTIVE_ABOVE: f64 = -2.75;
/// Slopes below this are matt surfaces that face the wall.
const LAMBERTIAN_BELOW: f64 = -5.5;
/// A slope is believed if its standard error is not above this.
const LARGEST_ERROR: f64 = 0.5;
/// Pairs with less than this share of the brightest pair's total do not count.
const DIM: f64 = 0.02;

/// The slope of log(total) over log(mean path) of the pairs, weighted by their totals, and its standard error. `None`
/// with fewer than four pairs that see anything, or with all at one path.
pub fn falloff_slope(capture: &Capture) -> Option<[f64; 2]> {
    let dark = background(capture);
    let moments = |h: &[f32]| {
        let mut sums = [0.0f64; 2];
        for (b, v) in h.iter().enumerate() {
            let (t, v) = (capture.t_start + (b as f64 + 0.5) * capture.bin_width, f64::from(*v) - dark);
            sums = [sums[0] + v, sums[1] + v * t];
        }
        sums
    };
    let all: Vec<[f64; 2]> = capture.histograms.chunks_exact(capture.bins).map(moments).collect();
    let brightest = all.iter().fold(0.0f64, |a, s| a.max(s[0]));
    let seen: Vec<[f64; 3]> = all
        .iter()
        .filter(|s| s[0] > DIM * brightest && s[1] > 0.0)
        .map(|[total, first]| [(first / total).ln(), total.ln(), *total])
        .collect();
    if seen.len() < 4 {
        return None;
    }
    let weight: f64 = seen.iter().map(|s| s[2]).sum();
    let mean = |k: usize| seen.iter().map(|s| s[2] * s[k]).sum::<f64>() / weight;
    let (x, y) = (mean(0), mean(1));
    let moment = |f: &dyn Fn(&[f64; 3]) -> f64| seen.iter().map(|s| s[2] * f(s)).sum::<f64>() / weight;
    let xx = moment(&|s| (s[0] - x).powi(2));
    let yy = moment(&|s| (s[1] - y).powi(2));
    let xy = moment(&|s| (s[0] - x) * (s[1] - y));
    if xx <= 0.0 {
        return None;
    }
    let rest = (yy - xy * xy / xx).max(0.0);
    Some([xy / xx, (rest / xx / (seen.len() - 2) as f64).sqrt()])
}

/// The reflectance of an automatic model, and the reason in a sentence.
pub fn assume_reflectance(capture: &Capture) -> (Reflectance, String) {
    let assumed = |why: String| (Reflectance::Cosine, format!("automatic model: {why}, cosine is assumed"));
    if !capture.is_confocal() {
        return assumed("pairs of two points tell nothing of the falloff".into());
    }
    let Some([slope, error]) = falloff_slope(capture).filter(|s| s[1] <= LARGEST_ERROR) else {
        return assumed("the pairs are too few or too much alike to show the falloff".into());
    };
    let shown = format!("what a pair sees falls with its path to the power {slope:.1} ± {error:.1}");
    let found = |model, kind: &str| (model, format!("automatic model: {shown}, as from {kind} surfaces"));
    if slope > RETROREFLECTIVE_ABOVE {
        found(Reflectance::Retroreflective, "retroreflective")
    } else if slope < LAMBERTIAN_BELOW {
        found(Reflectance::Lambertian, "matt")
    } else {
        assumed(format!("{shown}, which many surfaces do"))
    }
}
