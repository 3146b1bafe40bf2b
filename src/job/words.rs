//! Values as words.

use serde_json::Value;

/// The word for a value in files ("cpu", "captured").
pub fn plain(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(Value::String(word)) => word,
        _ => String::new(),
    }
}
