//! Smooth parts of surfaces: planes within windows, or of a whole part.

use super::fit::Fit;
use super::held_out::Left;
use super::support;
use crate::Result;
use crate::maps::Maps;

/// The least pixels of a part.
pub(super) const LEAST: usize = 16;

/// A variance of places that is added to that of a window, squared pixels, so that few pixels have no steep plane.
const STIFF: f64 = 0.05;

/// The factor of a layer's albedos that suits the pairs that are held out, and what it leaves of them: another shape sends another share of
/// the light to the wall.
pub(super) fn scaled_left(fit: &mut Fit, layer: &Maps) -> Result<Option<(f64, Left)>> {
    Ok(fit.rendered(std::slice::from_ref(layer))?.map(|held| held.scaled()))
}

pub(super) fn scale(maps: &mut Maps, factor: f64) {
    maps.albedo.iter_mut().for_each(|albedo| *albedo *= factor as f32);
}

/// The maps with a smooth `part`: its depths are those of planes fitted within a Gaussian window, of one plane without a window, and its
/// albedos means within another. `None` leaves depths as they are. Pixels without a surface stay so.
pub(super) fn smoothed(
    maps: &Maps,
    part: &[usize],
    depths: Option<Option<f64>>,
    albedos: Option<f64>,
) -> Maps {
    let mut to = maps.clone();
    let size = [maps.nx, maps.ny];
    let there: Vec<usize> = part.iter().copied().filter(|p| maps.depth[*p].is_finite()).collect();
    let means = |window: Option<f64>, of: &dyn Fn(usize) -> f64| {
        let mut all = vec![0.0; maps.depth.len()];
        there.iter().for_each(|p| all[*p] = of(*p));
        match window {
            Some(sigma) => blurred(&all, size, sigma),
            None => vec![all.iter().sum(); all.len()],
        }
    };
    let bright = |p: usize| f64::from(maps.albedo[p].max(0.0));
    let albedo = |window| {
        let [light, area] = [means(window, &bright), means(window, &|_| 1.0)];
        move |p: usize| if area[p] > 0.0 { light[p] / area[p] } else { 0.0 }
    };
    let shown = albedo(albedos);
    there.iter().for_each(|p| to.albedo[*p] = shown(*p) as f32);
    let Some(window) = depths else { return to };
    // Places in pixels from the middle of the part.
    let middle = [0, 1].map(|k| {
        there.iter().map(|p| [p / maps.ny, p % maps.ny][k] as f64).sum::<f64>() / there.len().max(1) as f64
    });
    let place = |p: usize| [(p / maps.ny) as f64 - middle[0], (p % maps.ny) as f64 - middle[1]];
    let z = |p: usize| f64::from(maps.depth[p]);
    let of = |of: &dyn Fn(f64, f64, f64) -> f64| {
        means(window, &|p| {
            let [x, y] = place(p);
            bright(p) * of(x, y, z(p))
        })
    };
    let sums = [
        of(&|_, _, _| 1.0),
        of(&|x, _, _| x),
        of(&|_, y, _| y),
        of(&|_, _, z| z),
        of(&|x, _, _| x * x),
        of(&|x, y, _| x * y),
        of(&|_, y, _| y * y),
        of(&|x, _, z| x * z),
        of(&|_, y, z| y * z),
    ];
    let pitch = support::pixel_pitch(maps).map(f64::from);
    for &p in &there {
        let [all, x, y, z, xx, xy, yy, xz, yz] = sums.each_ref().map(|sum| sum[p]);
        if all <= 0.0 {
            continue;
        }
        let [x, y, z, xx, xy, yy, xz, yz] = [x, y, z, xx, xy, yy, xz, yz].map(|sum| sum / all);
        let [xx, xy, yy] = [xx - x * x + STIFF, xy - x * y, yy - y * y + STIFF];
        let [xz, yz] = [xz - x * z, yz - y * z];
        let determinant = xx * yy - xy * xy;
        let slope = [(yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant];
        let at = place(p);
        to.depth[p] = (z + slope[0] * (at[0] - x) + slope[1] * (at[1] - y)) as f32;
        let [a, b] = [slope[0] / pitch[0], slope[1] / pitch[1]];
        let long = (a * a + b * b + 1.0).sqrt();
        to.normal[p] = [a / long, b / long, -1.0 / long].map(|v| v as f32);
    }
    to
}

/// Values averaged by a Gaussian of `sigma` pixels; nothing beyond the borders.
pub(super) fn blurred(values: &[f64], [nx, ny]: [usize; 2], sigma: f64) -> Vec<f64> {
    let reach = (3.0 * sigma).ceil() as usize;
    let taps: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let along = |from: &[f64], count: usize, stride: usize| -> Vec<f64> {
        let of = |i: usize| {
            let at = i / stride % count;
            let near = at.saturating_sub(reach)..=(at + reach).min(count - 1);
            near.map(|k| taps[k.abs_diff(at)] * from[i + k * stride - at * stride]).sum()
        };
        (0..from.len()).map(of).collect()
    };
    along(&along(values, ny, 1), nx, ny)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 32;

    /// A tilted plate with dimples of `deep` metres and albedos that vary by a fifth.
    fn plate(deep: f32) -> (Maps, Vec<usize>) {
        let mut maps = Maps::empty([N, N], [-0.5, 0.5, -0.5, 0.5]);
        let part: Vec<usize> =
            (0..N * N).filter(|p| (8..24).contains(&(p / N)) && (6..20).contains(&(p % N))).collect();
        for &p in &part {
            let odd = if (p / N + p % N).is_multiple_of(2) { 1.0 } else { -1.0 };
            let [x, y] = maps.centre(p / N, p % N);
            maps.depth[p] = 0.8 + 0.5 * x as f32 - 0.2 * y as f32 + deep * odd;
            maps.albedo[p] = 1.0 + 0.2 * odd;
            maps.normal[p] = [0.0, 0.0, -1.0];
        }
        (maps, part)
    }

    fn off(a: &Maps, b: &Maps, part: &[usize]) -> f32 {
        part.iter().map(|p| (a.depth[*p] - b.depth[*p]).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn planes_within_windows_keep_a_plane_up_to_its_edges_and_take_dimples_away() {
        let (flat, part) = plate(0.0);
        let (rough, _) = plate(0.01);
        // The added variance makes slopes at edges a little less steep; bright dimples weigh more by a fifth of their depth, 2 mm.
        for (window, kept, most) in [(Some(1.0), 2e-3, 6e-3), (Some(4.0), 1e-3, 3e-3), (None, 1e-3, 3e-3)] {
            assert!(off(&smoothed(&flat, &part, Some(window), window), &flat, &part) < kept, "{window:?}");
            let smooth = smoothed(&rough, &part, Some(window), window);
            assert!(off(&smooth, &flat, &part) < most, "{window:?} {}", off(&smooth, &flat, &part));
        }
        let plane = smoothed(&rough, &part, Some(None), None);
        let long = (0.25f32 + 0.04 + 1.0).sqrt();
        let normal = plane.normal[part[0]];
        assert!((normal[0] - 0.5 / long).abs() < 0.01 && (normal[1] + 0.2 / long).abs() < 0.01, "{normal:?}");
        assert!(part.iter().all(|p| (plane.albedo[*p] - 1.0).abs() < 1e-6));
        let outside = (0..N * N).filter(|p| !part.contains(p));
        assert!(outside.into_iter().all(|p| plane.albedo[p] == 0.0 && plane.depth[p].is_nan()));
    }

    #[test]
    fn albedos_alone_leave_the_depths() {
        let (rough, part) = plate(0.01);
        let smooth = smoothed(&rough, &part, None, Some(2.0));
        assert_eq!(off(&smooth, &rough, &part), 0.0);
        assert!(part.iter().all(|p| (smooth.albedo[*p] - 1.0).abs() < 0.1));
    }
}
