//! Write-ahead log of one episode: already compressed chunks, each with its
//! length and CRC-32. What was appended survives the death of the process;
//! what was synced survives the loss of power. This module uses neither HDF5 nor threads.
//!
//! ```text
//! file    magic[8] · length u32 · crc32 u32 · Preamble (protobuf) · record*
//! record  magic u32 · crc32 u32 · kind u8 · 0 u8 · stream u16 · length u32
//!         · sequence u64 · stamp_nanos u64 · tick u64 · payload[length]
//! ```
//! All numbers are little-endian; a record's CRC covers everything after it.

mod ahead;
mod append;
mod format;
mod locked;
mod scan;

pub use ahead::{Ahead, read_ahead};
pub(crate) use append::create_file;
pub use append::{Appender, LogFile};
pub(crate) use format::FILE_MAGIC as MAGIC;
pub use format::{
    CameraParts, Closing, Kind, MAX_MESSAGE, MAX_PAYLOAD, MAX_SNAPSHOT, Preamble, RECORD_HEADER,
    Received, RecordHeader, Recovered, begin_record, begin_record_in, finish_record,
};
pub use locked::Locked;
pub(crate) use scan::is_at;
pub use scan::{Entry, Scan, hold, outline, scan};

/// Errors of a log.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read or written.
    #[error("log {path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// The reason.
        source: std::io::Error,
    },
    /// The file does not exist or cannot be read.
    #[error("{path}: {reason}")]
    Absent {
        /// The path.
        path: String,
        /// The reason.
        reason: String,
    },
    /// The file is not a log, or its beginning is damaged.
    #[error("{path} is not a WheelArm log: {reason}")]
    NoLog {
        /// The file.
        path: String,
        /// The reason.
        reason: String,
    },
    /// A record does not match its checksum.
    #[error("log {path}: the checksum of the record at byte {at} is wrong")]
    Damaged {
        /// The file.
        path: String,
        /// Offset of the record, bytes.
        at: u64,
    },
    /// A recorder still writes to it.
    #[error(
        "log {0} is being written by a recorder; wait until it has finished, or stop that recorder"
    )]
    InUse(String),
}
