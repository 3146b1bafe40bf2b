//! Flat things. In dim light the last word draws too much, and the fit bends away what has no light; dark print is missed. A plane is known by all
//! of its light, so its edges and tones are found on it alone.

use super::fit::{Fit, Run};
use super::held_out::{HeldOut, Left};
use super::smooth::{LEAST, blurred, scale, scaled_left, smoothed};
use super::support;
use crate::Result;
use crate::learned::promised_iou;
use crate::maps::Maps;

/// Evidence: benches/NOTES.md, "Plates".
mod constants {
    /// Probabilities from which on pixels of the mask are plates, and their least expected IoU over that of the whole mask.
    pub const PROBABLE: [f32; 6] = [0.0, 0.5, 0.6, 0.7, 0.8, 0.9];
    pub const LIKELY: f64 = 0.85;
    /// Standard errors of the difference by which plates may leave more than another surface, and smaller plates must leave less.
    pub const ERRORS: f64 = 1.0;
    /// Plates that leave more than another surface by these are followed by no others.
    pub const HOPELESS: f64 = 6.0;
    /// A part that is this flat, in pixels off its plane, is looked at whatever plates of one albedo leave.
    pub const FLAT: f64 = 2.0;
    /// The fit on a plane: of a rectangle around pixels of this probability and a margin, a share of the maps' width, with this share of the
    /// plates' albedo where these are not.
    pub const AROUND: f32 = 0.05;
    pub const MARGIN: f64 = 1.0 / 16.0;
    pub const BEGINS: f32 = 0.1;
    pub const ITERATIONS: usize = 20;
    /// What earlier fits left, as a share: it weighs the prior.
    pub const LEVEL: f64 = 0.03;
    /// Widths of Gaussian windows for albedos of the plate and of darker print, shares of the maps' width.
    pub const SHARP: f64 = 0.01;
    pub const BROAD: f64 = 0.02;
    /// Shares of the plate's albedo above which pixels are plate, and above which they are print.
    pub const PLATE: [f64; 5] = [0.4, 0.5, 0.6, 0.7, 0.8];
    pub const PRINT: [f64; 5] = [0.3, 0.2, 0.15, 0.1, 0.07];
    /// Print has no detail finer than this share of the width; gaps between it and the plate are print where that much around them is either.
    pub const DETAIL: f64 = 1.0 / 40.0;
    pub const GAP: f64 = 0.7;
    /// It must leave less than the plate alone by these standard errors, and send back this share of the plate's light, pixel by pixel.
    pub const PRINT_ERRORS: f64 = 2.5;
    pub const DARKEST: f64 = 0.05;
}
use constants::*;

/// Flat parts, in the units of the fit and as they are shown, and what they leave of held-out pairs.
struct Plates {
    left: Left,
    fitted: Maps,
    shown: Maps,
}

impl Plates {
    /// Whether the largest one lies in its plane in `layer`, too, which may have several albedos there.
    fn are_flat(&self, layer: &Maps) -> bool {
        let parts = support::objects_of(&self.shown);
        let Some(part) = parts.iter().max_by_key(|part| part.len()) else { return false };
        let off = |p: &usize| f64::from(layer.depth[*p] - self.fitted.depth[*p]).powi(2);
        let squares: Vec<f64> = part.iter().map(off).filter(|square| square.is_finite()).collect();
        let [px, py] = support::pixel_pitch(layer);
        let off = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        off < FLAT * f64::from(px.max(py))
    }
}

/// The maps as flat parts, if no other surface leaves clearly less than they do; `best` is what `maps`, shown of the fit's `layer`, leave.
///
/// # Errors
/// The device fails.
pub(super) fn plates(fit: &mut Fit, layer: &Maps, maps: &Maps, best: &Left) -> Result<Option<Maps>> {
    let Some(probability) = &maps.probability else { return Ok(None) };
    let Some(mut plates) = by_probability(fit, layer, maps, probability, best)? else { return Ok(None) };
    if plates.left.errors_below(best) >= -HOPELESS || plates.are_flat(layer) {
        let by_light = by_light(fit, &plates, probability)?;
        plates = by_light.filter(|of| of.left.errors_below(&plates.left) > ERRORS).unwrap_or(plates);
    }
    Ok(Some(plates).filter(|of| of.left.errors_below(best) >= -ERRORS).map(|of| of.shown))
}

/// Flat parts of one albedo each, with the largest mask of a least probability that no smaller one contradicts.
fn by_probability(
    fit: &mut Fit,
    layer: &Maps,
    maps: &Maps,
    probability: &[f32],
    best: &Left,
) -> Result<Option<Plates>> {
    let whole = promised_iou(&maps.mask, probability);
    let mut found: Option<Plates> = None;
    for least in PROBABLE {
        let mask: Vec<bool> = maps.mask.iter().zip(probability).map(|(m, p)| *m && *p >= least).collect();
        if promised_iou(&mask, probability) < LIKELY * whole {
            break;
        }
        let [mut fitted, mut shown] = [layer, maps].map(Maps::clone);
        for pixel in (0..mask.len()).filter(|pixel| !mask[*pixel]) {
            (fitted.depth[pixel], fitted.albedo[pixel]) = (f32::NAN, 0.0);
            shown.albedo[pixel] = 0.0;
        }
        shown.mask = mask;
        for part in support::objects_of(&shown).iter().filter(|part| part.len() >= LEAST) {
            [fitted, shown] = [fitted, shown].map(|of| smoothed(&of, part, Some(None), None));
        }
        let Some((factor, left)) = scaled_left(fit, &fitted)? else { break };
        scale(&mut fitted, factor);
        scale(&mut shown, factor);
        let is_hopeless = left.errors_below(best) < -HOPELESS;
        if found.as_ref().is_none_or(|larger| left.errors_below(&larger.left) > ERRORS) {
            found = Some(Plates { left, fitted, shown });
        }
        if is_hopeless {
            break;
        }
    }
    Ok(found)
}

/// Plates on the plane of the largest one: a fit on all of that plane around them shows where it is bright, where darker, and where it ends.
fn by_light(fit: &mut Fit, plates: &Plates, probability: &[f32]) -> Result<Option<Plates>> {
    let Some(plane) = Plane::of(plates, probability) else { return Ok(None) };
    // Other parts may be what the last word has seen of print: they would keep the light of all of it.
    let mut begun: Vec<f32> =
        plane.is_on.iter().map(|on| if *on { BEGINS * plane.albedo } else { 0.0 }).collect();
    plane.plate.iter().for_each(|p| begun[*p] = plane.albedo);
    let mut layers = [plane.maps(&|p| begun[p])];
    fit.step = 1.0;
    fit.begin(&layers, Run { known: Some(LEVEL), ..Run::of(ITERATIONS, ITERATIONS) }, 0)?;
    if fit.end(&mut layers)?.is_none() {
        return Ok(None);
    }
    let [layer] = layers;
    let seen = |width: f64| plane.means(&|p| f64::from(layer.albedo[p].max(0.0)), width);
    let [sharp, broad] = [seen(SHARP), seen(BROAD)];
    let typical = {
        let mut lit: Vec<f64> = plane.plate.iter().map(|p| broad[*p]).collect();
        let at = lit.len() * 3 / 5;
        *lit.select_nth_unstable_by(at, f64::total_cmp).1
    };
    let above = |of: &[f64], share: f64| -> Vec<bool> {
        of.iter().zip(&plane.is_on).map(|(v, on)| *on && *v >= share * typical).collect()
    };
    let mut found: Option<(Tones, HeldOut)> = None;
    for share in PLATE {
        let plate = above(&sharp, share);
        let Some(light) = plane.light(fit, &plate)? else { break };
        let tones = Tones::of(&plate, &vec![false; plate.len()], &[&light]);
        if found.as_ref().is_none_or(|(best, _)| tones.left.errors_below(&best.left) > 0.0) {
            found = Some((tones, light));
        }
    }
    let Some((mut best, of_plate)) = found else { return Ok(None) };
    let (plate, alone) = (best.plate.clone(), best.left.clone());
    let mut is_first = true;
    for share in PRINT {
        let print = plane.print(&plate, &above(&broad, share));
        if print.iter().filter(|is| **is).count() < 4 * LEAST {
            continue;
        }
        let Some(light) = plane.light(fit, &print)? else { continue };
        let tones = Tones::of(&plate, &print, &[&of_plate, &light]);
        let is_print =
            tones.factors[1] > DARKEST * tones.factors[0] && tones.left.errors_below(&alone) > PRINT_ERRORS;
        // More print while no less of it leaves clearly less.
        if is_print && (is_first || tones.left.errors_below(&best.left) > -ERRORS) {
            (best, is_first) = (tones, false);
        }
    }
    Ok(Some(plane.plates(&best, plates)))
}

/// The plate and darker print on it, with the factors of their albedos, and what they leave.
struct Tones {
    plate: Vec<bool>,
    print: Vec<bool>,
    factors: [f64; 2],
    left: Left,
}

impl Tones {
    fn of(plate: &[bool], print: &[bool], lights: &[&HeldOut]) -> Tones {
        let (factors, left) = HeldOut::mixed(lights);
        Tones {
            plate: plate.to_vec(),
            print: print.to_vec(),
            factors: [factors[0], factors.get(1).copied().unwrap_or(0.0)],
            left,
        }
    }
}

/// The plane of the largest of some plates.
struct Plane {
    /// Maps without a surface.
    blank: Maps,
    /// Pixels of the plate, and its albedo.
    plate: Vec<usize>,
    albedo: f32,
    /// A pixel of it, its depth and its normal.
    at: usize,
    depth: f32,
    normal: [f32; 3],
    /// The pixels that are looked at.
    is_on: Vec<bool>,
}

impl Plane {
    fn of(plates: &Plates, probability: &[f32]) -> Option<Plane> {
        let Plates { fitted, shown, .. } = plates;
        let plate =
            support::objects_of(shown).into_iter().max_by_key(Vec::len).filter(|p| p.len() >= LEAST)?;
        let at = *plate.iter().find(|p| fitted.depth[**p].is_finite() && fitted.albedo[**p] > 0.0)?;
        let around: Vec<usize> =
            (0..shown.mask.len()).filter(|p| shown.mask[*p] || probability[*p] >= AROUND).collect();
        let margin = (MARGIN * shown.nx.max(shown.ny) as f64) as usize;
        let places = |p: usize| [p / shown.ny, p % shown.ny];
        let bounds = [0, 1].map(|k| {
            let of = || around.iter().map(|p| places(*p)[k]);
            of().min().unwrap_or(0).saturating_sub(margin)..=of().max().unwrap_or(0) + margin
        });
        let is_on = |p: usize| bounds.iter().zip(places(p)).all(|(bounds, at)| bounds.contains(&at));
        let mut blank = fitted.clone();
        blank.albedo.fill(0.0);
        blank.depth.fill(f32::NAN);
        Some(Plane {
            blank,
            plate,
            albedo: fitted.albedo[at],
            at,
            depth: fitted.depth[at],
            normal: fitted.normal[at],
            is_on: (0..shown.mask.len()).map(is_on).collect(),
        })
    }

    /// The plane's depth at a pixel.
    fn depth(&self, p: usize) -> f32 {
        let [px, py] = support::pixel_pitch(&self.blank);
        let (ny, at, [a, b, c]) = (self.blank.ny, self.at, self.normal);
        let way = [(p / ny) as f32 - (at / ny) as f32, (p % ny) as f32 - (at % ny) as f32];
        self.depth - (a * way[0] * px + b * way[1] * py) / c
    }

    /// A surface on the plane where there is albedo.
    fn maps(&self, albedo: &dyn Fn(usize) -> f32) -> Maps {
        let mut maps = self.blank.clone();
        for p in (0..maps.albedo.len()).filter(|p| albedo(*p) > 0.0) {
            (maps.depth[p], maps.normal[p], maps.albedo[p]) = (self.depth(p), self.normal, albedo(p));
        }
        maps
    }

    /// What pixels with the plate's albedo send to held-out pairs.
    fn light(&self, fit: &mut Fit, there: &[bool]) -> Result<Option<HeldOut>> {
        fit.rendered(&[self.maps(&|p| if there[p] { self.albedo } else { 0.0 })])
    }

    /// Means of values on the plane over Gaussian windows.
    fn means(&self, of: &dyn Fn(usize) -> f64, width: f64) -> Vec<f64> {
        let [nx, ny] = [self.blank.nx, self.blank.ny];
        let sums = |of: &dyn Fn(usize) -> f64| {
            let on: Vec<f64> =
                self.is_on.iter().enumerate().map(|(p, on)| if *on { of(p) } else { 0.0 }).collect();
            blurred(&on, [nx, ny], width * nx.max(ny) as f64)
        };
        let of_area = |(sum, area): (f64, f64)| if area > 0.0 { sum / area } else { 0.0 };
        sums(of).into_iter().zip(sums(&|_| 1.0)).map(of_area).collect()
    }

    /// What is print of the pixels that are bright enough and no plate: rims of the plate are not, gaps beside it are.
    fn print(&self, plate: &[bool], bright: &[bool]) -> Vec<bool> {
        let share = |of: &dyn Fn(usize) -> bool| self.means(&|p| f64::from(u8::from(of(p))), DETAIL);
        let is_dark = |p: usize| bright[p] && !plate[p];
        let whole = share(&is_dark);
        let print: Vec<bool> = (0..plate.len()).map(|p| is_dark(p) && whole[p] > 0.5).collect();
        if !print.contains(&true) {
            return print;
        }
        let either = share(&|p| plate[p] || print[p]);
        (0..plate.len()).map(|p| self.is_on[p] && !plate[p] && (print[p] || either[p] > GAP)).collect()
    }

    /// The plates of some tones, in place of others.
    fn plates(&self, tones: &Tones, before: &Plates) -> Plates {
        let [plate, print] = tones.factors.map(|factor| factor as f32 * self.albedo);
        let albedo = |p: usize| match (tones.plate[p], tones.print[p]) {
            (true, _) => plate,
            (_, true) => print,
            _ => 0.0,
        };
        let (fitted, mut shown) = (self.maps(&albedo), before.shown.clone());
        let unit = before.shown.albedo[self.at] / before.fitted.albedo[self.at];
        for p in 0..shown.mask.len() {
            shown.mask[p] = albedo(p) > 0.0;
            shown.albedo[p] = unit * albedo(p);
            if shown.mask[p] {
                (shown.depth[p], shown.normal[p]) = (fitted.depth[p], self.normal);
            }
        }
        Plates { left: tones.left.clone(), fitted, shown }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 80;

    /// A plane that is tilted along x, looked at everywhere.
    fn plane() -> Plane {
        Plane {
            blank: Maps::empty([N, N], [-0.4, 0.4, -0.4, 0.4]),
            plate: vec![],
            albedo: 2.0,
            at: 0,
            depth: 0.5,
            normal: [0.6, 0.0, -0.8],
            is_on: vec![true; N * N],
        }
    }

    fn within(from: usize, to: usize) -> Vec<bool> {
        (0..N * N).map(|p| (from..to).contains(&(p / N)) && (20..60).contains(&(p % N))).collect()
    }

    #[test]
    fn a_plane_has_its_slope_at_every_pixel() {
        // Pixels are .01 wide.
        let plane = plane();
        assert!(
            (plane.depth(10 * N + 3) - (0.5 + 0.1 * 0.6 / 0.8)).abs() < 1e-6,
            "{}",
            plane.depth(10 * N + 3)
        );
        let maps = plane.maps(&|p| if p == 7 { 1.0 } else { 0.0 });
        assert!((maps.depth[7] - 0.5).abs() < 1e-6 && maps.albedo[7] == 1.0 && maps.depth[8].is_nan());
    }

    #[test]
    fn a_rim_is_no_print_and_a_gap_beside_it_is() {
        let plane = plane();
        // Bright enough up to two pixels beyond a plate: its blurred rim.
        let plate = within(40, 60);
        assert!(!plane.print(&plate, &within(38, 62)).contains(&true));
        // Print of 20 pixels up to one before the plate.
        let print = plane.print(&plate, &within(19, 39));
        let of = |x: usize| print[x * N + 40];
        assert!(
            of(25) && of(38) && of(39) && !of(40) && !of(15),
            "{:?}",
            (10..42).map(of).collect::<Vec<_>>()
        );
    }
}
