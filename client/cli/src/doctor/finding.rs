//! Result of one check, as a line and as JSON.

use std::fmt;

use serde::Serialize;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// The check passed.
    Ok,
    /// It works with limits.
    Warn,
    /// It does not work.
    Fail,
}

/// Result of one check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Severity.
    pub level: Level,
    /// Subject of the check.
    pub what: &'static str,
    /// Observed state.
    pub found: String,
    /// Fix; empty when the check passed.
    pub cure: String,
}

impl Finding {
    /// A check that passed.
    pub fn ok(what: &'static str, found: impl Into<String>) -> Self {
        Self {
            level: Level::Ok,
            what,
            found: found.into(),
            cure: String::new(),
        }
    }

    /// A check that passed with limits; `cure` removes them.
    pub fn warn(what: &'static str, found: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            level: Level::Warn,
            what,
            found: found.into(),
            cure: cure.into(),
        }
    }

    /// A check that failed; `cure` fixes it.
    pub fn fail(what: &'static str, found: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            level: Level::Fail,
            ..Self::warn(what, found, cure)
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = match self.level {
            Level::Ok => "ok  ",
            Level::Warn => "warn",
            Level::Fail => "FAIL",
        };
        write!(f, "{word}  {:<18} {}", self.what, self.found)?;
        if !self.cure.is_empty() {
            write!(f, "\n      {:<18} → {}", "", self.cure)?;
        }
        Ok(())
    }
}
