//! A font of strokes for pictures, drawn for this crate: no system fonts, any size.
//!
//! A glyph is a list of strokes with blanks between. A stroke is a list of points, each two digits, x from 0 to
//! 6 and y from 0 (top of a capital) over 2 (top of an x) and 6 (base line) to 8 (bottom of a p). A stroke that
//! begins with `~` is smoothed: its points are those of a quadratic B-spline that begins and ends at its ends.

/// Height of a capital in units of the grid.
const CAPITAL: f64 = 6.0;
/// Between two glyphs, and the width of a blank.
const GAP: f64 = 1.7;
const BLANK: f64 = 1.4;

/// The strokes of a text whose capitals are `size` high: points (x, y), y downwards, (0, 0) at the left end of the
/// base line.
pub fn strokes(text: &str, size: f64) -> Vec<Vec<[f64; 2]>> {
    lay_out(text, size).0
}

/// How long a text is.
pub fn width(text: &str, size: f64) -> f64 {
    lay_out(text, size).1
}

fn lay_out(text: &str, size: f64) -> (Vec<Vec<[f64; 2]>>, f64) {
    let unit = size / CAPITAL;
    let (mut all, mut x) = (Vec::new(), 0.0);
    for character in text.chars() {
        let lines: Vec<_> = glyph(character).split_whitespace().map(stroke).collect();
        let right = lines.iter().flatten().map(|p| p[0]).fold(0.0, f64::max);
        let right = if character == ' ' { BLANK } else { right };
        for line in lines {
            all.push(line.iter().map(|p| [(x + p[0]) * unit, (p[1] - CAPITAL) * unit]).collect());
        }
        x += right + GAP;
    }
    (all, (x - GAP).max(0.0) * unit)
}

fn stroke(code: &str) -> Vec<[f64; 2]> {
    let smooth = code.starts_with('~');
    let digits: Vec<f64> = code.chars().filter_map(|c| c.to_digit(10)).map(f64::from).collect();
    let mut points: Vec<[f64; 2]> = digits.chunks_exact(2).map(|p| [p[0], p[1]]).collect();
    for _ in 0..if smooth { 3 } else { 0 } {
        points = cut_corners(&points);
    }
    points
}

/// A step of Chaikin's subdivision that keeps the ends.
fn cut_corners(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let between = |a: [f64; 2], b: [f64; 2], t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
    let last = points.len().saturating_sub(2);
    let mut cut = Vec::new();
    for (i, pair) in points.windows(2).enumerate() {
        cut.push(if i == 0 { pair[0] } else { between(pair[0], pair[1], 0.25) });
        cut.push(if i == last { pair[1] } else { between(pair[0], pair[1], 0.75) });
    }
    cut
}

fn glyph(character: char) -> &'static str {
    match character {
        ' ' => "",
        'a' => "~444202064644 4246",
        'b' => "0006 ~040242460604",
        'c' => "~434202064645",
        'd' => "4046 ~444202064644",
        'e' => "0444 ~444202064645",
        'f' => "~40201315 1516 0333",
        'g' => "~444202064644 4246 ~46481807",
        'h' => "0006 ~04024244 4446",
        'i' => "0206 0000",
        'j' => "1216 ~161808 1010",
        'k' => "0006 320436",
        'l' => "0006",
        'm' => "0206 ~04023234 3436 ~34326264 6466",
        'n' => "0206 ~04024244 4446",
        'o' => "~224246060222",
        'p' => "0208 ~040242460604",
        'q' => "4248 ~444202064644",
        'r' => "0206 ~040232",
        's' => "~4342020444460605",
        't' => "1014 ~141636 0232",
        'u' => "0204 ~04064644 4246",
        'v' => "022642",
        'w' => "0216335662",
        'x' => "0246 4206",
        'y' => "0226 4218",
        'z' => "02420646",
        'A' => "062046 1434",
        'B' => "0006 0020 ~20404323 2303 ~23434626 2606",
        'C' => "~414000064645",
        'D' => "0006 0010 ~10404616 1606",
        'E' => "40000646 0333",
        'F' => "400006 0333",
        'G' => "~41400006464443 4323",
        'H' => "0006 4046 0343",
        'I' => "0006",
        'J' => "3034 ~34360605",
        'K' => "0006 400346",
        'L' => "000646",
        'M' => "0600346066",
        'N' => "06004640",
        'O' => "~204046060020",
        'P' => "0006 0020 ~20404323 2303",
        'Q' => "~204046060020 3447",
        'R' => "0006 0020 ~20404323 2303 2346",
        'S' => "~4140000343460605",
        'T' => "0040 2026",
        'U' => "0003 ~03064643 4340",
        'V' => "002640",
        'W' => "0016325660",
        'X' => "0046 4006",
        'Y' => "002340 2326",
        'Z' => "00400646",
        '0' => "~204046060020",
        '1' => "122026",
        '2' => "~0100404306 0646",
        '3' => "~0100404323 ~234346060605",
        '4' => "36300444",
        '5' => "400003 0323 ~2343460605",
        '6' => "~400004 ~040242460604",
        '7' => "004016",
        '8' => "~204043030020 ~234346060323",
        '9' => "~424404004042 ~424606",
        '.' => "0606",
        ',' => "0607",
        ':' => "0303 0606",
        ';' => "1313 1607",
        '-' | '\u{2212}' => "0333",
        '\u{2013}' => "0343",
        '+' => "0343 2125",
        '=' => "0242 0444",
        '(' => "~20020426",
        ')' => "~00222406",
        '[' => "10000616",
        ']' => "00101606",
        '{' => "~20101304 ~04131626",
        '}' => "~00101324 ~24131606",
        '/' => "0640",
        '\\' => "0046",
        '|' => "0007",
        '%' => "0640 ~00100111010000 ~35454636353535",
        '<' => "410345",
        '>' => "014305",
        '_' => "0747",
        '*' => "2125 1234 3214",
        '#' => "1026 3046 0242 0444",
        '\'' => "0001",
        '"' => "0001 1011",
        '!' => "0004 0606",
        '?' => "~0100404323 2324 2626",
        '~' => "~04123442",
        '@' => "~3422131434 ~34303000 ~30000646",
        '&' => "461100 ~11002011 ~0406063643",
        '\u{b0}' => "~102022020010",
        '\u{b7}' => "0303",
        _ => "0040 4046 4606 0600",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_plain_character_has_a_glyph_within_its_box() {
        let box_of_nothing = glyph('\u{1}');
        for c in (' '..='~').filter(|c| !"`$^".contains(*c)) {
            assert!(glyph(c) != box_of_nothing, "{c:?}");
            for code in glyph(c).split_whitespace() {
                let digits = code.trim_start_matches('~');
                assert!(digits.len() >= 4 && digits.len() % 2 == 0, "{c:?} {code}");
                assert!(stroke(code).iter().all(|[x, y]| *x <= 6.0 && *y <= 8.0), "{c:?} {code}");
            }
        }
        assert!(width("MM", 12.0) > width("ii", 12.0) && width("", 12.0) == 0.0);
    }
}
