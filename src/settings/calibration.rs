//! What was undone of an instrument, as a file that the next capture of the rig takes.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Error, Result};

/// The key of a report that has the calibration, among its settings.
pub const KEY: &str = "calibration_found";

/// A correction: a law of the instrument with its numbers, about the wall on which they were found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// The name of the law.
    pub law: String,
    /// Its numbers (docs/options.md, "Calibration").
    pub numbers: Vec<f64>,
    /// The middle of the wall points, and half the longer side of the rectangle around them, metres.
    pub middle: [f64; 2],
    pub half: f64,
}

/// The corrections of a file in their order: of the report of a run, or an object with `corrections` alone.
///
/// # Errors
/// A file that cannot be read, or that holds no calibration.
pub fn corrections(path: &Path) -> Result<Vec<Correction>> {
    let name = path.display();
    let wrong = |what: String| {
        Error::input(
            format!("{name}: {what}"),
            "give the report.json of a capture of the same rig, or a file with its calibration_found",
        )
    };
    let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
    let mut all: Value = serde_json::from_slice(&bytes).map_err(|e| wrong(e.to_string()))?;
    let of_report = all.get_mut("settings").and_then(|settings| settings.get_mut(KEY)).map(Value::take);
    let mut found = match of_report {
        // A proper rig.
        Some(Value::Null) => return Ok(vec![]),
        Some(found) => found,
        None => all,
    };
    let list =
        found.get_mut("corrections").map(Value::take).ok_or_else(|| wrong("holds no calibration".into()))?;
    let list: Vec<Correction> = serde_json::from_value(list).map_err(|e| wrong(e.to_string()))?;
    let is_sound = |of: &Correction| {
        of.half > 0.0 && of.numbers.iter().chain(&of.middle).chain([&of.half]).all(|n| n.is_finite())
    };
    match list.iter().find(|of| !is_sound(of)) {
        Some(of) => Err(wrong(format!("the numbers of {:?} are not finite, or half is not above 0", of.law))),
        None => Ok(list),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_and_plain_files_hold_corrections() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            corrections(&path)
        };
        let one = r#"{"corrections": [{"law": "shear", "numbers": [0.2], "middle": [0, 0.1], "half": 1}]}"#;
        let shear = Correction { law: "shear".into(), numbers: vec![0.2], middle: [0.0, 0.1], half: 1.0 };
        assert_eq!(read(one).unwrap(), std::slice::from_ref(&shear));
        assert_eq!(read(&format!(r#"{{"settings": {{"calibration_found": {one}}}}}"#)).unwrap(), [shear]);
        assert_eq!(read(r#"{"settings": {"calibration_found": null}}"#).unwrap(), []);
        for (text, what) in [
            ("{", "EOF"),
            ("{}", "holds no calibration"),
            (r#"{"settings": {}}"#, "holds no calibration"),
            (r#"{"corrections": [{"law": "shear"}]}"#, "missing field"),
            (&one.replace("\"half\": 1", "\"half\": 0"), "half"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.what.contains(what) && error.what.contains("report.json"), "{text}: {error}");
        }
        assert!(corrections(Path::new("nowhere.json")).unwrap_err().what.starts_with("nowhere.json: "));
    }
}
