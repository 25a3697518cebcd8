//! Errors in files below `assets/`, with their fix.

use std::path::PathBuf;

/// An invalid scene, object, material or task.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A missing or unreadable file.
    #[error("{path}: cannot be read ({source}); {cure}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Message of the operating system.
        source: std::io::Error,
        /// The fix.
        cure: String,
    },
    /// Invalid TOML, an unknown key, or a value of the wrong type.
    #[error("{file}: {source}{cure}")]
    Parse {
        /// The file, below the assets folder.
        file: String,
        /// Message of the parser, with line and column.
        source: Box<toml::de::Error>,
        /// The fix.
        cure: String,
    },
    /// An invalid world pack.
    #[error(transparent)]
    Pack(#[from] Box<wheelarm_pack::PackError>),
    /// An invalid file of the grammar.
    #[error(transparent)]
    Language(Box<wheelarm_language::GrammarError>),
    /// A task that a home does not satisfy.
    #[error(
        "{missing} in {scene}, for the task {task:?}; {available}; take a task that this home \
         offers (--list-tasks lists them), or another home"
    )]
    NotOffered {
        /// The task.
        task: String,
        /// What the home lacks.
        missing: String,
        /// The home.
        scene: String,
        /// What it has.
        available: String,
    },
    /// An invalid value.
    #[error("{file}: {key} is {found}, expected {expected}; {cure}")]
    Value {
        /// The file, below the assets folder.
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

/// Place of a value in the assets, for error messages.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    file: String,
    key: String,
}

impl Place {
    /// The file as a whole, named below the assets folder.
    pub(crate) fn file(file: &str) -> Self {
        Self {
            file: file.to_owned(),
            key: String::new(),
        }
    }

    /// A key below this place.
    pub(crate) fn key(&self, key: &str) -> Self {
        let joined = if self.key.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.key)
        };
        Self {
            file: self.file.clone(),
            key: joined,
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
    ) -> SceneError {
        SceneError::Value {
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
    ) -> Result<f64, SceneError> {
        if value >= low && value <= high {
            Ok(value)
        } else {
            Err(self.wrong(
                format!("{value} {unit}").trim_end(),
                format!("{low} to {high} {unit}").trim_end(),
                cure,
            ))
        }
    }

    /// Rejects an edge of a box that no floor or wall of a home has.
    pub(crate) fn edge(&self, metres: f64) -> Result<f64, SceneError> {
        self.within(
            metres,
            0.0005,
            100.0,
            "m",
            "lengths are metres: 250 mm is 0.25",
        )
    }

    /// Rejects a length that no object in a home has.
    pub(crate) fn length(&self, metres: f64) -> Result<f64, SceneError> {
        self.within(
            metres,
            0.0005,
            20.0,
            "m",
            "lengths are metres: 250 mm is 0.25",
        )
    }

    /// Rejects a position that is not finite or outside any home.
    pub(crate) fn position(&self, at: [f64; 3]) -> Result<[f64; 3], SceneError> {
        for value in at {
            self.within(value, -50.0, 50.0, "m", "positions are metres")?;
        }
        Ok(at)
    }
}
