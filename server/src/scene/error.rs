//! What can be wrong with a file below `assets/`, said so that it can be cured.

use std::path::PathBuf;

/// A scene, object, material or task that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file is missing or unreadable.
    #[error("{path}: cannot be read ({source}); {cure}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's words.
        source: std::io::Error,
        /// What to do.
        cure: String,
    },
    /// Not TOML, a key that does not exist, or a value of the wrong type.
    #[error("{file}: {source}{cure}")]
    Parse {
        /// The file, below the assets folder.
        file: String,
        /// The parser's words, with the place.
        source: Box<toml::de::Error>,
        /// What to do.
        cure: String,
    },
    /// A file of the grammar that cannot be used.
    #[error(transparent)]
    Language(Box<wheelarm_language::GrammarError>),
    /// A value that cannot be.
    #[error("{file}: {key} is {found}, expected {expected}; {cure}")]
    Value {
        /// The file, below the assets folder.
        file: String,
        /// Where in the file.
        key: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        expected: String,
        /// What to do.
        cure: String,
    },
}

/// Where in the assets a value stands: makes errors that name it.
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

    /// The error for a value that stands here.
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

    /// Refuses a number outside `[low, high]`; NaN is outside.
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

    /// Refuses a length that is not that of a thing in a home.
    pub(crate) fn length(&self, metres: f64) -> Result<f64, SceneError> {
        self.within(
            metres,
            0.0005,
            20.0,
            "m",
            "lengths are metres: 250 mm is 0.25",
        )
    }

    /// Refuses a position that is not finite or outside any home.
    pub(crate) fn position(&self, at: [f64; 3]) -> Result<[f64; 3], SceneError> {
        for value in at {
            self.within(value, -50.0, 50.0, "m", "positions are metres")?;
        }
        Ok(at)
    }
}
