//! Pictures of results beside their truth.

use std::path::Path;

use thirdbounce::Result;
use thirdbounce::capture::scan::decimals;
use thirdbounce::export::picture::{BACKGROUND, CAPITAL, INK, Picture, colour, normal_colour, text_width};
use thirdbounce::export::png;
use thirdbounce::maps::{Maps, Truth, percentile};

const GAP: usize = 16;
/// Height of a line of text above a panel.
const LINE: usize = 20;
/// Side of a panel, and of one among many.
const PANEL: usize = 288;
const SMALL: usize = 160;
/// Labels of the rows of many methods.
const ROWS: [&str; 3] = ["albedo", "normals", "depth"];

/// Writes albedo, normals, true normals, depth and true depth side by side. Both depths share one scale and a colour
/// bar.
pub fn write(path: &Path, maps: &Maps, truth: &Truth) -> Result<()> {
    maps.check()?;
    truth.check()?;
    let real = as_maps(truth);
    let scale = Scale::of(&[maps, &real]);
    let panels = [
        ("albedo", albedo_panel(maps, PANEL)),
        ("normal", normal_panel(maps, PANEL)),
        ("true normal", normal_panel(&real, PANEL)),
        ("depth", scale.panel(maps, PANEL)),
        ("true depth", scale.panel(&real, PANEL)),
    ];
    let labels = scale.labels();
    let bar = GAP + panels.len() * (PANEL + GAP);
    let mut picture = Picture::new(bar + Picture::bar_width(&labels) + GAP, GAP + LINE + PANEL + GAP);
    let top = GAP + LINE;
    for (i, (label, panel)) in panels.iter().enumerate() {
        let x = GAP + i * (PANEL + GAP);
        picture.text(label, [x, GAP + CAPITAL]);
        picture.fill(x - 1, top - 1, PANEL + 2, PANEL + 2, [70, 70, 78]);
        picture.paste(panel, x, top);
    }
    picture.colour_bar(bar, [top, top + PANEL], 1.0, &labels, INK);
    png::write(path, &picture)
}

/// Writes the maps of several methods side by side, the truth first: albedo above normals above depth, a labelled column for
/// each. All depths share the truth's scale and a colour bar.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_all(path: &Path, named: &[(&str, &Maps)], truth: &Truth) -> Result<()> {
    truth.check()?;
    named.iter().try_for_each(|(_, maps)| maps.check())?;
    let real = as_maps(truth);
    let scale = Scale::of(&[&real]).at_least(0.01);
    let labels = scale.labels();
    let columns: Vec<(&str, &Maps)> =
        std::iter::once(("truth", &real)).chain(named.iter().copied()).collect();
    let left = GAP + ROWS.map(text_width).into_iter().fold(0, usize::max) + GAP;
    let bar = left + columns.len() * (SMALL + GAP);
    let height = GAP + LINE + 3 * (SMALL + GAP);
    let mut picture = Picture::new(bar + Picture::bar_width(&labels) + GAP, height);
    for (row, label) in ROWS.into_iter().enumerate() {
        picture.text(label, [GAP, GAP + LINE + row * (SMALL + GAP) + SMALL / 2]);
    }
    for (i, (name, maps)) in columns.into_iter().enumerate() {
        let x = left + i * (SMALL + GAP);
        picture.text(&fitted(name), [x, GAP + CAPITAL]);
        let panels = [albedo_panel(maps, SMALL), normal_panel(maps, SMALL), scale.panel(maps, SMALL)];
        for (row, panel) in panels.iter().enumerate() {
            let top = GAP + LINE + row * (SMALL + GAP);
            picture.fill(x - 1, top - 1, SMALL + 2, SMALL + 2, [70, 70, 78]);
            picture.paste(panel, x, top);
        }
    }
    let top = GAP + LINE + 2 * (SMALL + GAP);
    picture.colour_bar(bar, [top, top + SMALL], 1.0, &labels, INK);
    png::write(path, &picture)
}

/// As much of a name as fits above a panel.
fn fitted(name: &str) -> String {
    let mut short: String = name.into();
    while text_width(&short) > SMALL && short.pop().is_some() {}
    short
}

/// The depths that colours stand for, metres.
struct Scale {
    near: f32,
    far: f32,
}

impl Scale {
    /// From the 1st to the 99th percentile of the depths shown.
    fn of(all: &[&Maps]) -> Scale {
        let depths: Vec<f32> = all.iter().flat_map(|m| shown_depths(m)).collect();
        let range = percentile(&depths, 1.0).zip(percentile(&depths, 99.0));
        let (near, far) = range.map_or((0.0, 1.0), |(a, b)| (a, b.max(1.001 * a)));
        Scale { near, far }
    }

    /// At least this share of the depths to either side: a flat object is one colour, and errors are others.
    fn at_least(self, share: f32) -> Scale {
        let middle = 0.5 * (self.near + self.far);
        Scale { near: self.near.min((1.0 - share) * middle), far: self.far.max((1.0 + share) * middle) }
    }

    fn labels(&self) -> [String; 2] {
        [self.far, self.near].map(|depth| format!("{depth:.*} m", decimals(2, self.far.into())))
    }

    fn panel(&self, maps: &Maps, side: usize) -> Picture {
        let shown = |p: usize| maps.mask[p] && maps.depth[p].is_finite();
        let share = |p: usize| f64::from((maps.depth[p] - self.near) / (self.far - self.near));
        panel(maps, side, |p| if shown(p) { colour(share(p)) } else { BACKGROUND })
    }
}

fn albedo_panel(maps: &Maps, side: usize) -> Picture {
    let white = Maps::white(&maps.albedo);
    panel(maps, side, |p| {
        let share = if white > 0.0 { maps.albedo[p] / white } else { 0.0 };
        [(255.0 * share.clamp(0.0, 1.0)).round() as u8; 3]
    })
}

fn normal_panel(maps: &Maps, side: usize) -> Picture {
    panel(maps, side, |p| normal_colour(maps.normal[p]).filter(|_| maps.mask[p]).unwrap_or(BACKGROUND))
}

/// The maps as a square of `side` pixels, nearest pixel, +x to the left and +y up.
fn panel(maps: &Maps, side: usize, colour: impl Fn(usize) -> [u8; 3]) -> Picture {
    let mut picture = Picture::new(side, side);
    for row in 0..side {
        for column in 0..side {
            let (ix, iy) = ((side - 1 - column) * maps.nx / side, (side - 1 - row) * maps.ny / side);
            picture.fill(column, row, 1, 1, colour(ix * maps.ny + iy));
        }
    }
    picture
}

fn shown_depths(maps: &Maps) -> Vec<f32> {
    let shown = maps.mask.iter().zip(&maps.depth).filter(|(m, d)| **m && d.is_finite());
    shown.map(|(_, d)| *d).collect()
}

/// Truth in the form of maps, so that the same code draws both.
fn as_maps(truth: &Truth) -> Maps {
    Maps {
        nx: truth.nx,
        ny: truth.ny,
        extent: truth.extent,
        albedo: truth.mask.iter().map(|m| f32::from(u8::from(*m))).collect(),
        depth: truth.depth.clone(),
        normal: truth.normal.clone(),
        mask: truth.mask.clone(),
        mask_fraction: None,
        depth_error: None,
        probability: None,
        behind: None,
    }
}
