//! Text on pictures, in the compiled-in font.
//!
//! `assets/DejaVuSans.ttf` is DejaVu Sans 2.37 with the characters of Latin, Greek and common signs only, made by
//! `pyftsubset DejaVuSans.ttf --no-hinting --layout-features= --unicodes=20-7E,A0-17F,370-3FF,2010-2026,2030,2032,2033,
//! 2070-209F,20AC,2190-2193,2212,221E,2248,2260,2264,2265`.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};

pub(super) const FONT: &[u8] = include_bytes!("../assets/DejaVuSans.ttf");

static DEJAVU: LazyLock<FontRef<'static>> =
    LazyLock::new(|| FontRef::try_from_slice(FONT).expect("the compiled-in font is whole"));

/// The scale at which an em of the font is `em` pixels.
fn scale(em: f32) -> PxScale {
    PxScale::from(em * DEJAVU.height_unscaled() / DEJAVU.units_per_em().unwrap_or(1.0))
}

/// Length of a line of text in pixels, at `em` pixels per em.
pub fn width(text: &str, em: f32) -> f32 {
    let font = DEJAVU.as_scaled(scale(em));
    text.chars().map(|c| font.h_advance(font.glyph_id(c))).sum()
}

/// Calls `ink` with `[column, row]` and coverage (0 to 1) for every pixel of a line of text. The text begins at
/// `[x, y]` on the base line, in pixels from the upper left corner.
pub fn write(text: &str, [mut x, y]: [f32; 2], em: f32, mut ink: impl FnMut([i32; 2], f64)) {
    let font = DEJAVU.as_scaled(scale(em));
    for character in text.chars() {
        let glyph = font.glyph_id(character);
        if let Some(outline) = font.outline_glyph(glyph.with_scale_and_position(scale(em), point(x, y))) {
            let corner = outline.px_bounds().min;
            outline.draw(|column, row, cover| {
                let at = [corner.x as i32 + column as i32, corner.y as i32 + row as i32];
                ink(at, f64::from(cover));
            });
        }
        x += font.h_advance(glyph);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_every_character_that_plots_and_captions_use() {
        let nothing = DEJAVU.glyph_id('\u{1}');
        for c in (' '..='~').chain("°·×–−²³µλπσ€≤≥äöüéñß".chars()) {
            assert!(DEJAVU.glyph_id(c) != nothing, "{c:?}");
        }
        assert!(width("MM", 12.0) > width("ii", 12.0) && width("", 12.0) == 0.0);
        assert!((width("depth", 24.0) - 2.0 * width("depth", 12.0)).abs() < 1e-3);
    }

    #[test]
    fn text_stands_on_its_base_line_and_stays_within_its_width() {
        let mut all = vec![];
        write("Hill", [10.0, 30.0], 20.0, |[x, y], cover| all.extend((cover > 0.5).then_some((x, y))));
        let [left, right] =
            [all.iter().map(|p| p.0).min(), all.iter().map(|p| p.0).max()].map(Option::unwrap);
        assert!(left >= 10 && right as f32 <= 10.0 + width("Hill", 20.0));
        // A capital of this font is 0.73 em high.
        assert_eq!(all.iter().map(|p| p.1).max(), Some(29));
        assert!((15..=16).contains(&all.iter().map(|p| p.1).min().unwrap()));
    }
}
