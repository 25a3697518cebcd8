//! Errors of the conversion of a log into a file.

use std::path::PathBuf;

use crate::log::LogError;

/// Why no file was written. The log stays.
#[derive(Debug, thiserror::Error)]
pub enum FinishError {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The final name is taken.
    #[error(
        "{path} exists already and is never overwritten; the recording is still in {log}: move the file away or give another folder with --out, then `wheelarm dataset recover {log}`"
    )]
    Exists {
        /// The final name.
        path: PathBuf,
        /// The log.
        log: PathBuf,
    },
    /// A file cannot be written, for example because the disk is full.
    #[error(
        "{path} cannot be written: {source}; the recording is still in {log}, `wheelarm dataset recover {log}` tries again"
    )]
    Io {
        /// The file.
        path: PathBuf,
        /// The log.
        log: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// An HDF5 call failed.
    #[error("HDF5: {0}")]
    Hdf5(#[from] hdf5::Error),
    /// A sample in the log is not a valid message of its stream.
    #[error("{stream}, sample {sequence}: {reason}")]
    Content {
        /// The stream.
        stream: String,
        /// Sequence number of the sample.
        sequence: u64,
        /// The reason.
        reason: String,
    },
    /// The written file does not match the log.
    #[error("{dataset} has {got} samples in the written file, expected {expected}")]
    Verify {
        /// The dataset.
        dataset: String,
        /// Samples found.
        got: usize,
        /// Samples in the log.
        expected: usize,
    },
}
