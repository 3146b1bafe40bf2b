//! Text on pictures, by compiled-in outlines, and on pages.
//!
//! `assets/DejaVuSans.txt` has a line for each character of DejaVu Sans 2.37 (Latin, Greek, common signs): its code point, its
//! advance, and its outline as an SVG path, in units of which an em has 2048; see `assets/README.md`.

use std::collections::HashMap;
use std::sync::LazyLock;

use zeno::{Mask, Transform};

const EM: f32 = 2048.0;

/// Advance and outline of each character.
static GLYPHS: LazyLock<HashMap<char, (f32, &'static str)>> = LazyLock::new(|| {
    let glyph = |line: &'static str| {
        let (code, rest) = line.split_once(' ')?;
        let (advance, outline) = rest.split_once(' ')?;
        Some((char::from_u32(u32::from_str_radix(code, 16).ok()?)?, (advance.parse().ok()?, outline)))
    };
    include_str!("../assets/DejaVuSans.txt").lines().filter_map(glyph).collect()
});

/// Advance and outline of a character; those of a question mark for missing ones.
fn glyph(character: char) -> (f32, &'static str) {
    GLYPHS.get(&character).or_else(|| GLYPHS.get(&'?')).copied().unwrap_or_default()
}

/// Length of a line of text in pixels, at `em` pixels per em.
pub fn width(text: &str, em: f32) -> f32 {
    text.chars().map(|c| glyph(c).0).sum::<f32>() * em / EM
}

/// Calls `ink` with `[column, row]` and coverage (0 to 1) for every pixel of a line of text. The text begins at
/// `[x, y]` on the base line, in pixels from the upper left corner.
pub fn write(text: &str, [mut x, y]: [f32; 2], em: f32, mut ink: impl FnMut([i32; 2], f64)) {
    let scale = em / EM;
    for (advance, outline) in text.chars().map(glyph) {
        let at = Transform { xx: scale, xy: 0.0, yx: 0.0, yy: -scale, x, y };
        paint(Mask::new(outline).transform(Some(at)), &mut ink);
        x += scale * advance;
    }
}

/// Calls `ink` with `[column, row]` and coverage (0 to 1) for every pixel of a mask.
pub fn paint(mask: &Mask<'_, '_, impl zeno::PathData>, ink: &mut impl FnMut([i32; 2], f64)) {
    let (cover, place) = mask.render();
    for (at, cover) in cover.iter().enumerate().filter(|(_, cover)| **cover > 0) {
        let [column, row] = [at % place.width as usize, at / place.width as usize].map(|v| v as i32);
        ink([place.left + column, place.top + row], f64::from(*cover) / 255.0);
    }
}

/// Text escaped for HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Text as a cell of a table with commas.
pub fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_every_character_that_plots_and_captions_use() {
        for c in (' '..='~').chain("°·×–−²³µλπσ€≤≥äöüéñß".chars()) {
            assert!(GLYPHS.contains_key(&c), "{c:?}");
        }
        assert!(width("MM", 12.0) > width("ii", 12.0) && width("", 12.0) == 0.0);
        assert!((width("depth", 24.0) - 2.0 * width("depth", 12.0)).abs() < 1e-3);
        assert_eq!(width("\u{1}", 12.0), width("?", 12.0));
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
