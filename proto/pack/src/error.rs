//! Errors of packs: file, key, value, allowed values and the fix.

use std::path::PathBuf;

/// Why a pack cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PackError {
    /// A file or folder cannot be read or written.
    #[error("cannot {action} {path}: {source}")]
    File {
        /// `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Message of the operating system.
        source: std::io::Error,
    },
    /// Neither a folder nor a zip file.
    #[error("{0} is not a pack; name a folder that contains pack.toml, or a zip file of it")]
    NotAPack(PathBuf),
    /// A damaged zip file, or one that uses other features than deflate.
    #[error("the zip file cannot be read: {0}; write it again, with deflate and no encryption")]
    Zip(String),
    /// A path that no pack contains.
    #[error("{path:?} cannot be in a pack: {reason}; {cure}")]
    Path {
        /// The path, shortened.
        path: String,
        /// What is wrong with it.
        reason: &'static str,
        /// The fix.
        cure: &'static str,
    },
    /// Too many or too large files.
    #[error("{what} is {found}, at most {most} {unit} are accepted; {cure}")]
    Large {
        /// What is too large.
        what: String,
        /// Its size.
        found: u64,
        /// The limit.
        most: u64,
        /// Unit of both.
        unit: &'static str,
        /// The fix.
        cure: &'static str,
    },
    /// A file that the pack needs is absent.
    #[error("{file} is missing; {cure}")]
    Missing {
        /// Path in the pack.
        file: String,
        /// The fix.
        cure: String,
    },
    /// Invalid TOML, an unknown key, or a value of the wrong type.
    #[error("{file}: {source}correct the key or the value at the mark")]
    Parse {
        /// Path in the pack.
        file: String,
        /// Message of the parser, with line and column.
        source: Box<toml::de::Error>,
    },
    /// An invalid value.
    #[error("{file}: {key} is {found}, expected {expected}; {cure}")]
    Value {
        /// Path in the pack.
        file: String,
        /// Place in the file.
        key: String,
        /// Value found.
        found: String,
        /// Allowed values.
        expected: String,
        /// The fix.
        cure: String,
    },
}

/// Place of a value in a pack, for error messages.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    file: String,
    key: String,
}

impl Place {
    /// A file.
    pub(crate) fn file(file: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            key: String::new(),
        }
    }

    /// A key below this place.
    pub(crate) fn key(&self, key: &str) -> Self {
        let key = match self.key.as_str() {
            "" => key.to_owned(),
            above => format!("{above}.{key}"),
        };
        Self {
            file: self.file.clone(),
            key,
        }
    }

    /// An entry of a list below this place.
    pub(crate) fn entry(&self, list: &str, entry: impl std::fmt::Display) -> Self {
        self.key(&format!("{list}[{entry}]"))
    }

    /// The error for a value at this place.
    pub(crate) fn wrong(
        &self,
        found: impl std::fmt::Display,
        expected: impl std::fmt::Display,
        cure: impl std::fmt::Display,
    ) -> PackError {
        PackError::Value {
            file: self.file.clone(),
            key: self.key.clone(),
            found: found.to_string(),
            expected: expected.to_string(),
            cure: cure.to_string(),
        }
    }

    /// Rejects a number outside `[low, high]`; NaN is outside.
    pub(crate) fn within(
        &self,
        value: f64,
        low: f64,
        high: f64,
        unit: &str,
        cure: &str,
    ) -> Result<f64, PackError> {
        if value >= low && value <= high {
            return Ok(value);
        }
        Err(self.wrong(
            format!("{value} {unit}").trim_end(),
            format!("{low} to {high} {unit}").trim_end(),
            cure,
        ))
    }

    /// Rejects a list of more than `most` entries.
    pub(crate) fn at_most(&self, found: usize, most: usize, cure: &str) -> Result<(), PackError> {
        if found <= most {
            return Ok(());
        }
        Err(self.wrong(
            format!("a list of {found}"),
            format!("at most {most} entries"),
            cure,
        ))
    }

    /// Rejects a name that is not 1 to 64 letters, digits, `-` or `_`.
    pub(crate) fn name(&self, name: &str) -> Result<(), PackError> {
        wheelarm_proto::keys::check_name(name).map_err(|_| {
            self.wrong(
                format!("{:?}", wheelarm_proto::check::beginning(name)),
                "1 to 64 letters, digits, `-` or `_`",
                "choose such a name",
            )
        })
    }
}
