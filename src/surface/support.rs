//! Data-driven support: which pixels of a layer have a surface.
//!
//! A fit of too few pixels puts the light of the missing ones on its rim, which becomes bright; a fit of too many leaves a dim
//! rim. So between short fits ([`follow`]) the support grows by a ring around bright rims, loses what is dim once its
//! surroundings are averaged, and loses islands indistinguishable from noise. One rim pixel
//! alone has too little evidence; its smoothed surroundings have enough.

use rayon::prelude::*;

use crate::maps::{Maps, percentile};

/// Constants of the support. Evidence: benches/NOTES.md, "Support by evidence".
mod constants {
    /// A ring is added around pixels with at least this share of the typical albedo.
    pub const BIRTH: f32 = 0.4;
    /// Share of its neighbours' albedo that a new pixel begins with.
    pub const BORN: f32 = 0.5;
    /// Steepest slope that depths are extrapolated by.
    pub const STEEPEST: f32 = 1.5;
    /// A pixel with a slanted rim stays where the smoothed evidence is above this share of the typical one; albedos are clamped to
    /// it from below.
    pub const STAYS: f32 = 0.28;
    /// The same for plates.
    pub const PLATE: f32 = 0.5;
    /// Power of the cosine of a slanted pixel in its evidence.
    pub const SLANT: f32 = 0.75;
    /// Smoothed evidence between these shares of the typical one is at an edge of the surface.
    pub const AT_EDGE: [f32; 2] = [0.3, 0.7];
    /// Mean cosines at edges of surfaces that bend away, and of plates.
    pub const FACING: [f32; 2] = [0.8, 0.95];
    /// Albedos are clamped to this multiple of the typical one.
    pub const BRIGHTEST: f32 = 1.25;
    /// Smoothing clips albedos at this multiple of the typical one.
    pub const CLIPPED: f32 = 3.0;
    /// Width of the smoothing Gaussian as a share of the maps' width.
    pub const SMOOTH: f64 = 1.0 / 80.0;
    /// Smallest island as a share of the maps' pixels.
    pub const ISLAND: f64 = 16.0 / 4096.0;
    /// Pixels of one island differ by at most this slope.
    pub const EDGE: f32 = 2.5;
}
use constants::*;

/// Pixels that are worth a task of their own.
const ROW_OF_WORK: usize = 1024;

/// Mean albedo weighted by its square, with outliers clipped at twice the 75th percentile of lit pixels; `None` without light.
pub fn typical_albedo(layers: &[Maps]) -> Option<f32> {
    let lit: Vec<f32> = layers
        .iter()
        .flat_map(|m| (0..m.albedo.len()).map(|i| evidence(m, i)))
        .filter(|a| *a > 0.0)
        .collect();
    let most = 2.0 * percentile(&lit, 75.0)?;
    let [cubes, squares] = lit.iter().fold([0.0f64; 2], |[c, s], a| {
        let a = f64::from(a.min(most));
        [c + a * a * a, s + a * a]
    });
    (squares > 0.0).then(|| (cubes / squares) as f32)
}

/// The albedo of a layer smoothed over its surroundings, clipped at a multiple of `typical`; pixels without a surface are dark.
pub fn smoothed(maps: &Maps, typical: f32) -> Vec<f32> {
    let sigma = SMOOTH * maps.nx.max(maps.ny) as f64;
    let reach = (3.0 * sigma).ceil() as isize;
    let mut taps: Vec<f32> =
        (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp() as f32).collect();
    let sum: f32 = taps.iter().sum();
    taps.iter_mut().for_each(|t| *t /= sum);
    let clipped: Vec<f32> = (0..maps.albedo.len())
        .into_par_iter()
        .with_min_len(ROW_OF_WORK)
        .map(|i| if maps.depth[i].is_finite() { evidence(maps, i).min(CLIPPED * typical) } else { 0.0 })
        .collect();
    let along = |from: &[f32], count: usize, stride: usize| -> Vec<f32> {
        let of = |i: usize| {
            let at = (i / stride % count) as isize;
            let [first, last] = [(-at).max(-reach), (count as isize - 1 - at).min(reach)];
            let taps = &taps[(first + reach) as usize..=(last + reach) as usize];
            let place = |k: isize| (i as isize + k * stride as isize) as usize;
            (first..=last).zip(taps).map(|(k, tap)| tap * from[place(k)]).sum()
        };
        (0..from.len()).into_par_iter().with_min_len(ROW_OF_WORK).map(of).collect()
    };
    along(&along(&clipped, maps.ny, 1), maps.nx, maps.ny)
}

/// Light of a pixel per lateral area: its albedo, dimmed by the cosine of a slanted surface.
fn evidence(maps: &Maps, pixel: usize) -> f32 {
    let cosine = -maps.normal[pixel][2];
    maps.albedo[pixel] * if cosine > 0.0 { cosine.powf(SLANT) } else { 1.0 }
}

/// Pixels of a neighbourhood within `reach` of a pixel, itself excluded, with their offsets.
pub fn around(maps: &Maps, pixel: usize, reach: isize) -> impl Iterator<Item = (usize, [isize; 2])> {
    let (nx, ny) = (maps.nx as isize, maps.ny as isize);
    let (x, y) = (pixel as isize / ny, pixel as isize % ny);
    let within = |at: isize, count: isize| (-reach).max(-at)..=reach.min(count - 1 - at);
    let (rows, along) = (within(x, nx), within(y, ny));
    rows.flat_map(move |i| along.clone().map(move |j| [i, j]))
        .filter(|way| *way != [0, 0])
        .map(move |[i, j]| (((x + i) * ny + y + j) as usize, [i, j]))
}

/// Width and height of a pixel, metres.
pub fn pixel_pitch(maps: &Maps) -> [f32; 2] {
    let [x0, x1, y0, y1] = maps.extent;
    [((x1 - x0) / maps.nx as f64) as f32, ((y1 - y0) / maps.ny as f64) as f32]
}

/// Slopes of a pixel's surface from its normal, limited to [`STEEPEST`].
fn slopes(normal: [f32; 3]) -> [f32; 2] {
    let of = |k: usize| (-normal[k] / normal[2]).clamp(-STEEPEST, STEEPEST);
    if normal[2] < 0.0 { [of(0), of(1)] } else { [0.0; 2] }
}

/// Depth, albedo and normal of a pixel without a surface, extrapolated along the slopes of those within two pixels of it.
fn extrapolated(maps: &Maps, pixel: usize) -> Option<(f32, f32, [f32; 3])> {
    let pitch = pixel_pitch(maps);
    let (mut weights, mut depth, mut albedo, mut slope) = (0.0, 0.0, 0.0, [0.0; 2]);
    for (other, way) in around(maps, pixel, 2).filter(|(o, _)| maps.depth[*o].is_finite()) {
        let d = [0, 1].map(|k| -(way[k] as f32) * pitch[k]);
        let s = slopes(maps.normal[other]);
        let weight =
            (-0.5 * (way[0] * way[0] + way[1] * way[1]) as f32).exp() * maps.albedo[other].max(1e-12);
        weights += weight;
        depth += weight * (maps.depth[other] + s[0] * d[0] + s[1] * d[1]);
        albedo += weight * maps.albedo[other];
        (0..2).for_each(|k| slope[k] += weight * s[k]);
    }
    if weights <= 0.0 {
        return None;
    }
    let [x, y] = slope.map(|s| s / weights);
    let long = (x * x + y * y + 1.0).sqrt();
    Some((depth / weights, albedo / weights, [x / long, y / long, -1.0 / long]))
}

/// Adds a ring of pixels around those with at least [`BIRTH`] of the typical albedo. Depths stay within `range`.
fn grow(maps: &mut Maps, typical: f32, range: [f32; 2]) {
    let is_bright = |pixel: &usize| maps.depth[*pixel].is_finite() && maps.albedo[*pixel] >= BIRTH * typical;
    let mut has_bright = vec![false; maps.depth.len()];
    for pixel in (0..maps.depth.len()).filter(is_bright) {
        around(maps, pixel, 1).for_each(|(other, _)| has_bright[other] = true);
    }
    let born: Vec<_> = (0..maps.depth.len())
        .filter(|p| !maps.depth[*p].is_finite() && has_bright[*p])
        .filter_map(|p| Some((p, extrapolated(maps, p)?)))
        .collect();
    for (pixel, (depth, albedo, normal)) in born {
        maps.depth[pixel] = depth.clamp(range[0], range[1]);
        maps.albedo[pixel] = BORN * albedo;
        maps.normal[pixel] = normal;
    }
}

/// How flat surfaces are at their edges: 0 where they bend away from the wall, 1 for plates that face it.
pub fn flatness(layers: &[Maps], typical: f32) -> f32 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for maps in layers {
        let smooth = smoothed(maps, typical);
        let (nx, ny) = (maps.nx, maps.ny);
        for pixel in (0..smooth.len()).filter(|p| maps.depth[*p].is_finite()) {
            let (x, y) = (pixel / ny, pixel % ny);
            let on_edge = (AT_EDGE[0] * typical..AT_EDGE[1] * typical).contains(&smooth[pixel]);
            if !on_edge || x == 0 || y == 0 || x + 1 == nx || y + 1 == ny {
                continue;
            }
            let fall = (smooth[pixel + ny] - smooth[pixel - ny]).hypot(smooth[pixel + 1] - smooth[pixel - 1]);
            sum += fall * -maps.normal[pixel][2];
            weights += fall;
        }
    }
    let facing = if weights > 0.0 { sum / weights } else { 0.0 };
    ((facing - FACING[0]) / (FACING[1] - FACING[0])).clamp(0.0, 1.0)
}

/// The share of the typical evidence above which a pixel is surface. The smoothed evidence of a plate with a sharp edge is half
/// of the typical one at the edge; where a surface bends away, its rim is dim.
pub fn share(flatness: f32) -> f32 {
    STAYS + (PLATE - STAYS) * flatness
}

/// Removes pixels whose smoothed evidence is at most `share` of the typical one, and clamps the albedo of the others if the support
/// still changes.
fn settle(maps: &mut Maps, typical: f32, share: f32, clamps: bool) {
    let smooth = smoothed(maps, typical);
    for (pixel, smooth) in smooth.into_iter().enumerate() {
        if smooth > share * typical && maps.depth[pixel].is_finite() {
            if clamps {
                maps.albedo[pixel] = maps.albedo[pixel].clamp(STAYS * typical, BRIGHTEST * typical);
            }
        } else {
            remove(maps, pixel);
        }
    }
}

/// The support follows the evidence of layers of this flatness: dim pixels and small islands are removed, pixels around bright rims
/// are added first, by number of rings, if depths of new ones may be in a range.
pub fn follow(layers: &mut [Maps], [typical, flatness]: [f32; 2], grows_in: Option<([f32; 2], usize)>) {
    for maps in layers {
        if let Some((range, rings)) = grows_in {
            (0..rings).for_each(|_| grow(maps, typical, range));
        }
        settle(maps, typical, share(flatness), grows_in.is_some());
        drop_islands(maps);
    }
}

/// Removes a pixel's surface.
pub fn remove(maps: &mut Maps, pixel: usize) {
    put(maps, None, pixel);
}

/// Gives a pixel the surface that `from` has there; none without `from`.
pub fn put(to: &mut Maps, from: Option<&Maps>, pixel: usize) {
    (to.albedo[pixel], to.depth[pixel], to.normal[pixel]) =
        from.map_or((0.0, f32::NAN, [f32::NAN; 3]), |m| (m.albedo[pixel], m.depth[pixel], m.normal[pixel]));
}

/// Removes connected regions smaller than [`ISLAND`] of the maps.
fn drop_islands(maps: &mut Maps) {
    let least = (ISLAND * maps.depth.len() as f64).round() as usize;
    retain_regions(maps, |_, region| region.len() >= least);
}

/// Removes the objects that `is_kept` rejects.
pub fn retain_regions(maps: &mut Maps, is_kept: impl Fn(&Maps, &[usize]) -> bool) {
    let rejected: Vec<usize> =
        objects(maps).into_iter().filter(|region| !is_kept(maps, region)).flatten().collect();
    rejected.into_iter().for_each(|pixel| remove(maps, pixel));
}

/// Connected pixels of the surface. Steps in depth above [`EDGE`] separate objects.
fn objects(maps: &Maps) -> Vec<Vec<usize>> {
    let edge = edge(maps);
    let there: Vec<bool> = maps.depth.iter().map(|z| z.is_finite()).collect();
    regions(
        &there,
        |pixel| around(maps, pixel, 1).map(|(other, _)| other),
        |pixel, other, _| (maps.depth[other] - maps.depth[pixel]).abs() < edge,
    )
}

/// Connected pixels of the mask, as [`objects`].
pub fn objects_of(maps: &Maps) -> Vec<Vec<usize>> {
    let mut masked = maps.clone();
    (0..maps.mask.len()).filter(|p| !maps.mask[*p]).for_each(|p| masked.depth[p] = f32::NAN);
    objects(&masked)
}

/// Steps in depth between neighbouring pixels of a region are below this.
pub fn edge(maps: &Maps) -> f32 {
    let [px, py] = pixel_pitch(maps);
    EDGE * px.max(py)
}

/// Connected regions of the nodes that are `there`, each breadth first. A node joins the region of `from` where
/// `joins(from, node, is_in)`; `is_in` says whether a node is in that region.
pub fn regions<N: Iterator<Item = usize>>(
    there: &[bool],
    beside: impl Fn(usize) -> N,
    joins: impl Fn(usize, usize, &dyn Fn(usize) -> bool) -> bool,
) -> Vec<Vec<usize>> {
    let mut region_of = vec![usize::MAX; there.len()];
    let mut all: Vec<Vec<usize>> = vec![];
    for begin in (0..there.len()).filter(|node| there[*node]) {
        if region_of[begin] != usize::MAX {
            continue;
        }
        let number = all.len();
        let mut region = vec![begin];
        region_of[begin] = number;
        let mut at = 0;
        while at < region.len() {
            let from = region[at];
            at += 1;
            for node in beside(from) {
                let is_free = there[node] && region_of[node] == usize::MAX;
                if is_free && joins(from, node, &|other| region_of[other] == number) {
                    region_of[node] = number;
                    region.push(node);
                }
            }
        }
        all.push(region);
    }
    all
}

/// Replaces albedos by their geometric mean with those of the closed form, which errs in other ways: where the model error is
/// large, surface is where both have light.
pub fn blend(maps: &mut Maps, first: &Maps) {
    let Some((own, other)) =
        typical_albedo(std::slice::from_ref(maps)).zip(typical_albedo(std::slice::from_ref(first)))
    else {
        return;
    };
    for (albedo, first) in maps.albedo.iter_mut().zip(&first.albedo) {
        *albedo = (*albedo * first.max(0.0) * own / other).sqrt();
    }
}

/// Pixels that have a surface in fitted layers, too, take it over; the others have the typical albedo of these.
pub fn take_over(maps: &mut Maps, fitted: &[Maps]) {
    let typical = typical_albedo(fitted).unwrap_or(1.0);
    for pixel in 0..maps.depth.len() {
        if !maps.depth[pixel].is_finite() {
            continue;
        }
        match fitted.iter().find(|from| from.depth[pixel].is_finite()) {
            Some(from) => put(maps, Some(from), pixel),
            None => maps.albedo[pixel] = typical,
        }
    }
}

/// The mask of a surface by the probabilities of its pixels, changed by their evidence: smoothed albedo against the typical one of
/// the same object, so that the brightest object does not decide on others. `albedos`: how many independent albedos the maps' one is
/// the mean of; their evidence adds up.
pub fn weighed(maps: &Maps, probability: &[f32], albedos: usize) -> Vec<bool> {
    let mut mask = vec![false; maps.depth.len()];
    for object in objects(maps) {
        let mut alone = Maps::empty([maps.nx, maps.ny], maps.extent);
        object.iter().for_each(|pixel| put(&mut alone, Some(maps), *pixel));
        let one = std::slice::from_ref(&alone);
        let Some(typical) = typical_albedo(one) else { continue };
        let least = share(flatness(one, typical)) * typical;
        let smooth = smoothed(&alone, typical);
        for pixel in object {
            let p = probability[pixel].clamp(1e-4, 1.0 - 1e-4);
            let evidence = (smooth[pixel] / least).max(1e-4).ln();
            mask[pixel] = (p / (1.0 - p)).ln() + albedos as f32 * evidence > 0.0;
        }
    }
    mask
}

/// A layer on a grid with `factor` × `factor` pixels for each of its own: depths follow the slopes.
pub fn finer(maps: &Maps, factor: usize) -> Maps {
    let (nx, ny) = (maps.nx * factor, maps.ny * factor);
    let mut fine = Maps { mask_fraction: maps.mask_fraction, ..Maps::empty([nx, ny], maps.extent) };
    let pitch = pixel_pitch(&fine);
    for pixel in 0..nx * ny {
        let (x, y) = (pixel / ny, pixel % ny);
        let from = x / factor * maps.ny + y / factor;
        if !maps.depth[from].is_finite() {
            continue;
        }
        let offset = |i: usize, pitch: f32| ((i % factor) as f32 - 0.5 * (factor as f32 - 1.0)) * pitch;
        let s = slopes(maps.normal[from]);
        fine.albedo[pixel] = maps.albedo[from];
        fine.depth[pixel] = maps.depth[from] + s[0] * offset(x, pitch[0]) + s[1] * offset(y, pitch[1]);
        fine.normal[pixel] = maps.normal[from];
    }
    fine
}
