//! Errors in a parameter file: file, line, key, value found, allowed values.

use std::fmt;

/// An error in a parameter file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}: `{key}` is {found}; allowed: {allowed}")]
pub struct BadParameter {
    /// Path below the assets folder.
    pub file: String,
    /// Line, counting from 1.
    pub line: usize,
    /// The key, for example `depth.baseline`.
    pub key: String,
    /// Value found.
    pub found: String,
    /// Allowed values.
    pub allowed: String,
}

/// Smallest and largest value of a parameter, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds(pub f64, pub f64);

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.0, self.1)
    }
}
