//! Why an episode file cannot be read, in words that name the file.

use std::path::PathBuf;

/// Why an episode file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file does not exist or cannot be read.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The path.
        path: PathBuf,
        /// What is wrong, with the cure.
        reason: String,
    },
    /// The file is not an episode.
    #[error("{path} is not a WheelArm episode: {reason}")]
    NoEpisode {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// Something in it is absent or has another type.
    #[error("{path}: {what}: {source}")]
    Hdf5 {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        what: String,
        /// The reason.
        source: hdf5::Error,
    },
    /// Stored bytes are not the message that they should be.
    #[error("{path}: {what}: {source}")]
    Message {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        what: String,
        /// The reason.
        source: prost::DecodeError,
    },
    /// A dataset has another size than it must have.
    #[error(
        "{path}: {dataset} has {found}, expected {expected}: the file was changed or is damaged; leave it out, or copy it again from where it was recorded"
    )]
    Shape {
        /// The file.
        path: PathBuf,
        /// The dataset.
        dataset: String,
        /// The size that it has, in words.
        found: String,
        /// The size that it must have, in words.
        expected: String,
    },
    /// Stored values do not mean what they should.
    #[error("{path}: {what}: {reason}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        what: String,
        /// The reason.
        reason: String,
    },
}
