//! What one look found, as a line and as JSON.

use std::fmt;

use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Ok,
    /// It works, but not well, or not for everything.
    Warn,
    /// It does not work.
    Fail,
}

/// What one look found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub level: Level,
    /// What was looked at.
    pub what: &'static str,
    /// What was found.
    pub found: String,
    /// What to do; empty when nothing is wrong.
    pub cure: String,
}

impl Finding {
    /// Nothing is wrong.
    pub fn ok(what: &'static str, found: impl Into<String>) -> Self {
        Self {
            level: Level::Ok,
            what,
            found: found.into(),
            cure: String::new(),
        }
    }

    /// It works, but `cure` would do it good.
    pub fn warn(what: &'static str, found: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            level: Level::Warn,
            what,
            found: found.into(),
            cure: cure.into(),
        }
    }

    /// It does not work until `cure` is done.
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
