//! What a scene does not need, one line each.

/// What is left out, one line each.
#[derive(Debug, Default)]
pub struct LeftOut {
    pub(crate) lines: Vec<String>,
}

impl LeftOut {
    /// Adds `what` and what leaving it out saves.
    pub fn add(&mut self, what: impl Into<String>, saves: impl Into<String>) {
        self.lines.push(format!("{} (saves {})", what.into(), saves.into()));
    }
}
