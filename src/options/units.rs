//! Lengths and times as text, with or without a unit.

use crate::capture::METRES_PER_PICOSECOND;

/// Metres in a unit of length.
const LENGTHS: [(&str, f64); 4] = [("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6), ("m", 1.0)];
/// Seconds in a unit of time.
const TIMES: [(&str, f64); 5] = [("ps", 1e-12), ("ns", 1e-9), ("us", 1e-6), ("ms", 1e-3), ("s", 1.0)];
/// Metres that light travels in a second.
const LIGHT: f64 = METRES_PER_PICOSECOND * 1e12;

/// A number with a unit of these behind it; its value in that unit and the unit's size. `None` without unit.
fn with_unit(text: &str, units: &[(&str, f64)]) -> Option<(f64, f64)> {
    let text = text.trim();
    let number = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let (_, size) = units.iter().find(|(name, _)| *name == &text[number.len()..])?;
    Some((plain(number)?, *size))
}

fn plain(text: &str) -> Option<f64> {
    number(text).ok()
}

/// A number. One of too many digits is refused: it would become infinite.
pub fn number(text: &str) -> Result<f64, String> {
    let is_beyond = |value: &f64| value.is_infinite() && text.contains(|c: char| c.is_ascii_digit());
    match text.trim().parse() {
        Ok(value) if is_beyond(&value) => Err("it is beyond all numbers: give one below 1.7e308".into()),
        parsed => parsed.map_err(|_| "it is no number".into()),
    }
}

/// A length: `2m`, `50cm`, `4mm`, or metres as a plain number.
pub fn length(text: &str) -> Result<f64, String> {
    plain(text)
        .or_else(|| with_unit(text, &LENGTHS).map(|(value, size)| value * size))
        .ok_or_else(|| "give a length: metres, or a number with m, cm, mm or um behind it".into())
}

/// A path: a length, or a time at light speed: `32ps`, `1.2ns`.
pub fn path(text: &str) -> Result<f64, String> {
    length(text)
        .ok()
        .or_else(|| with_unit(text, &TIMES).map(|(value, size)| value * size * LIGHT))
        .ok_or_else(|| "give a path: metres, or a number with m, cm, mm, um, ps or ns behind it".into())
}

/// A time: `12.5ns`, `80ps`, seconds as a plain number, or the length of a path at light speed.
pub fn time(text: &str) -> Result<f64, String> {
    plain(text)
        .or_else(|| with_unit(text, &TIMES).map(|(value, size)| value * size))
        .or_else(|| with_unit(text, &LENGTHS).map(|(value, size)| value * size / LIGHT))
        .ok_or_else(|| "give a time: seconds, or a number with ps, ns, us, ms or s behind it".into())
}

/// A time of a computer, in seconds: `200ms`, `0.2s`, or milliseconds as a plain number.
pub fn milliseconds(text: &str) -> Result<f64, String> {
    plain(text)
        .map(|ms| 1e-3 * ms)
        .or_else(|| with_unit(text, &TIMES).map(|(value, size)| value * size))
        .ok_or_else(|| "give a time: milliseconds, or a number with ms or s behind it".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_units_or_none() {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        for (text, metres) in
            [("2m", 2.0), ("2", 2.0), ("1e-3", 1e-3), ("50 cm", 0.5), (" 4mm ", 4e-3), ("1e1mm", 1e-2)]
        {
            assert!(near(length(text).unwrap(), metres) && near(path(text).unwrap(), metres), "{text}");
        }
        assert!(near(path("32ps").unwrap(), 32.0 * METRES_PER_PICOSECOND));
        assert!(near(path("-1.5ns").unwrap(), -1.5 * LIGHT * 1e-9));
        assert!(near(time("12.5ns").unwrap(), 12.5e-9) && near(time("3e-9").unwrap(), 3e-9));
        assert!(near(time("299.792458mm").unwrap(), 1e-9));
        assert!(near(milliseconds("200").unwrap(), 0.2) && near(milliseconds("0.2s").unwrap(), 0.2));
        assert!(near(milliseconds("200 ms").unwrap(), 0.2) && milliseconds("200m").is_err());
        for wrong in ["", "m", "32 parsec", "1,5m", "2mm2", "ps32", "32p s", "é🦀", "3🦀m"] {
            assert!(length(wrong).is_err() && path(wrong).is_err() && time(wrong).is_err(), "{wrong}");
        }
        assert!(length("32ps").is_err(), "a wall is no time");
        let digits = "9".repeat(400);
        assert!(number(&digits).is_err() && length(&digits).is_err() && time(&(digits + "s")).is_err());
        assert!(number("-inf").is_ok_and(f64::is_infinite) && number("1e308").is_ok());
        assert!(length("NaN").is_ok_and(f64::is_nan), "checks of values explain better");
    }
}
