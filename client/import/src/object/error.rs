//! Errors of an object's import: what was found and how to fix it.

/// An object that cannot be imported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObjectError {
    /// A file that cannot be read.
    #[error("cannot read {path}: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// Message of the system.
        reason: String,
    },
    /// A file of another format.
    #[error("{file} is {format}; export it as GLB, OBJ, STL, DAE, URDF or MJCF")]
    Format {
        /// The file.
        file: String,
        /// Its format.
        format: String,
    },
    /// A damaged file, or one above a limit.
    #[error("{file}: {reason}")]
    Malformed {
        /// The file.
        file: String,
        /// What is wrong, and the fix.
        reason: String,
    },
    /// A size that is not usual for the category.
    #[error("{file} is {found} wide; {fix}")]
    Size {
        /// The file.
        file: String,
        /// Its largest extent in words.
        found: String,
        /// Which option helps.
        fix: String,
    },
    /// An unknown category.
    #[error("no category named {name:?}; available: {available}")]
    Category {
        /// The requested name.
        name: String,
        /// All names.
        available: String,
    },
    /// An invalid option.
    #[error("invalid {option} {value}: expected {expected}")]
    Option {
        /// The option.
        option: &'static str,
        /// Its value.
        value: String,
        /// What is expected.
        expected: String,
    },
    /// A pack that cannot be used or written.
    #[error("{path}: {reason}")]
    Pack {
        /// The pack.
        path: String,
        /// Why, with the fix.
        reason: String,
    },
    /// An asset that cannot be used.
    #[error("cannot use {path}: {reason}; is the assets folder complete?")]
    Asset {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
}

/// A length in the unit that reads best.
#[must_use]
pub fn length(metres: f64) -> String {
    match metres {
        m if m >= 1.0 => format!("{m:.3} m").replace(".000", ""),
        m if m >= 0.001 => format!("{:.0} mm", m * 1000.0),
        m => format!("{:.3} mm", m * 1000.0),
    }
}
