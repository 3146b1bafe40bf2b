//! Two surfaces behind each other: which parts of a closed-form volume's maps form which layer, and the maps of both.
//!
//! The brightest voxel of a column is now on one surface, now on the other. So voxels are first joined to sheets:
//! neighbouring columns with similar depths. Then every sheet goes to one of two layers, in which the surface refines
//! it as a height field of its own. Second surfaces that are dim or small are noise, or light from elsewhere, and do
//! not count.

use std::collections::BTreeMap;

use super::pixels::white;
use super::support::{edge, put, regions};
use crate::engine::AMPLE;
use crate::maps::{Layer, Maps};

/// Share of white that a first surface's albedo must have.
const SUPPORT: f32 = 0.1;

/// Share of white that a second surface's albedo must have: everywhere, and that of the dimmer of two surfaces in the
/// mean over the columns that two sheets share. Measured means: plates 0.51 to 0.93; haze of real captures that go on
/// beyond the scan 0.31 and less.
const SHARE: f32 = 0.2;
const MEAN_SHARE: f32 = 0.4;

/// Two sheets that share fewer columns do not count. In cells of a grid of [`AMPLE`] lateral voxels.
const LEAST_CELLS: f64 = 4.0;

/// The fewest columns that two sheets share, at maps of `nx` pixels.
pub fn least_columns(nx: usize) -> f64 {
    LEAST_CELLS * (nx as f64 / AMPLE as f64).powi(2)
}

/// Divides the volume's surfaces between two layers: `first` and `second` are the brightest and the second surface of
/// every column. `least`: the columns that two sheets share at least if they count. `None` if no second surface counts.
pub fn split(first: &Maps, second: &Maps, least: f64) -> Option<[Maps; 2]> {
    let white = Maps::white(&first.albedo);
    let of = |maps: &Maps, share: f32| -> Vec<bool> {
        maps.albedo.iter().zip(&maps.depth).map(|(a, z)| *a > share * white && z.is_finite()).collect()
    };
    // Nodes: the first surfaces of all columns, then the second ones.
    let count = first.albedo.len();
    let depth = [&first.depth[..], &second.depth].concat();
    let lit = of(first, SUPPORT);
    let mut there = [&lit[..], &of(second, SHARE)].concat();
    let counts = |columns: &&Vec<usize>| {
        let dimmer = |c: &usize| first.albedo[*c].min(second.albedo[*c]);
        let mean = columns.iter().map(dimmer).sum::<f32>() / columns.len() as f32;
        columns.len() as f64 >= least && mean >= MEAN_SHARE * white
    };
    let shared = shared(&sheets(first, &depth, &there), count);
    let kept: Vec<usize> = shared.iter().filter(counts).flatten().copied().collect();
    if kept.is_empty() {
        return None;
    }
    there[count..].fill(false);
    kept.into_iter().for_each(|c| there[count + c] = true);
    let mut sheets = sheets(first, &depth, &there);
    sheets.sort_by_key(|s| std::cmp::Reverse(s.len()));
    let mut layers = [first.clone(), nothing(first)];
    for (c, in_behind) in assigned(&sheets, count).into_iter().enumerate().filter_map(|(c, l)| Some((c, l?)))
    {
        // The surface that is not of this layer, if the column has two.
        let other = there[count + c].then_some(second);
        let of_layers = if in_behind { [other, Some(first)] } else { [Some(first), other] };
        for (layer, from) in layers.iter_mut().zip(of_layers) {
            put(layer, from, c);
        }
    }
    Some(layers)
}

/// The columns that two sheets share, for every two that share some.
fn shared(sheets: &[Vec<usize>], count: usize) -> Vec<Vec<usize>> {
    let mut sheet_of = vec![usize::MAX; 2 * count];
    sheets.iter().enumerate().for_each(|(k, s)| s.iter().for_each(|node| sheet_of[*node] = k));
    let mut all: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
    for c in 0..count {
        let (a, b) = (sheet_of[c], sheet_of[count + c]);
        if a.max(b) < usize::MAX {
            all.entry([a.min(b), a.max(b)]).or_default().push(c);
        }
    }
    all.into_values().collect()
}

/// Sheets of the nodes that are `there`: connected by neighbouring columns with similar depths, and with one node of a
/// column at most. `maps` gives the columns; `depth` is by node.
fn sheets(maps: &Maps, depth: &[f32], there: &[bool]) -> Vec<Vec<usize>> {
    let count = maps.nx * maps.ny;
    let edge = edge(maps);
    regions(
        there,
        |node| beside(maps, node % count).flat_map(move |c| [c, count + c]),
        |node, next, is_in| (depth[next] - depth[node]).abs() < edge && !is_in((next + count) % (2 * count)),
    )
}

/// The four neighbours of a column, fewer at borders.
fn beside(maps: &Maps, column: usize) -> impl Iterator<Item = usize> {
    let (nx, ny, x, y) = (maps.nx, maps.ny, column / maps.ny, column % maps.ny);
    let all = [
        (x > 0).then(|| column - ny),
        (x + 1 < nx).then_some(column + ny),
        (y > 0).then(|| column - 1),
        (y + 1 < ny).then_some(column + 1),
    ];
    all.into_iter().flatten()
}

/// For each of `count` columns with a surface, whether its first surface is of the second layer. Sheets come in order
/// and take the layer in which fewer of their columns are taken; a column's two surfaces never share a layer.
fn assigned(sheets: &[Vec<usize>], count: usize) -> Vec<Option<bool>> {
    // By node.
    let mut behind: Vec<Option<bool>> = vec![None; 2 * count];
    for sheet in sheets {
        let mate = |node: &usize| (node + count) % (2 * count);
        let taken = |layer: bool| sheet.iter().filter(|n| behind[mate(n)] == Some(layer)).count();
        let wanted = taken(true) < taken(false);
        for node in sheet {
            behind[*node] = Some(behind[mate(node)].map_or(wanted, |layer| !layer));
        }
    }
    (0..count).map(|c| behind[c].or(behind[count + c].map(|layer| !layer))).collect()
}

/// Maps of that size without any surface.
fn nothing(maps: &Maps) -> Maps {
    Maps { mask_fraction: maps.mask_fraction, ..Maps::empty([maps.nx, maps.ny], maps.extent) }
}

/// The maps of two refined layers: the nearer surface of every column, and the other one behind it. Where the dimmer of
/// two has become dark over a whole region, or the region is smaller than `least` pixels, only the brighter one stays.
/// So it does where the nearer one is too dim for the mask: the rim of a plate must not hide what is behind it.
pub fn merge(layers: &[Maps; 2], least: f64) -> Maps {
    let [one, two] = layers;
    let count = one.albedo.len();
    let white = white(layers);
    let nearer_is_two = |c: usize| two.depth[c] < one.depth[c];
    let is_double = |c: usize| {
        let [near, far] = if nearer_is_two(c) { [two, one] } else { [one, two] };
        let bright = near.albedo[c] > Maps::MASK_FRACTION as f32 * white && far.albedo[c] > SUPPORT * white;
        bright && near.depth[c].is_finite() && far.depth[c].is_finite()
    };
    let mut both: Vec<bool> = (0..count).map(is_double).collect();
    both.resize(2 * count, false);
    let dimmer = |c: usize| one.albedo[c].min(two.albedo[c]);
    let mut double = vec![false; count];
    for region in sheets(one, &vec![0.0; 2 * count], &both) {
        let mean = region.iter().map(|c| dimmer(*c)).sum::<f32>() / region.len() as f32;
        if region.len() as f64 >= least && mean >= SHARE * white {
            region.into_iter().for_each(|c| double[c] = true);
        }
    }
    let (mut maps, mut behind) = (one.clone(), nothing(one));
    for (c, is_double) in double.iter().enumerate() {
        let second_first = if *is_double { nearer_is_two(c) } else { two.albedo[c] > one.albedo[c] };
        let [near, far] = if second_first { [two, one] } else { [one, two] };
        put(&mut maps, Some(near), c);
        put(&mut behind, is_double.then_some(far), c);
    }
    let Maps { albedo, depth, normal, mask, .. } = behind;
    maps.behind = double.contains(&true).then_some(Layer { albedo, depth, normal, mask, depth_error: None });
    maps.set_mask(maps.mask_fraction);
    maps
}
