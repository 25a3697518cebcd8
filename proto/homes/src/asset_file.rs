//! Files of the assets folder: bytes and TOML tables of bounded size.

use std::io::Read;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

/// Largest table that is read, bytes.
const MOST_BYTES: u64 = 1 << 20;

/// A file of the assets that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AssetFileError {
    /// A file or folder cannot be read.
    #[error("cannot read {path}: {source}; is the assets folder complete?")]
    Read {
        /// File or folder.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A table is malformed.
    #[error("cannot read {path}: {source}")]
    Toml {
        /// File.
        path: PathBuf,
        /// Cause, with line and column.
        source: Box<toml::de::Error>,
    },
}

/// Reads a file, at most one byte more than `most`, which shows that it is too large.
///
/// # Errors
/// [`AssetFileError::Read`].
pub(crate) fn bytes(path: &Path, most: u64) -> Result<Vec<u8>, AssetFileError> {
    let failed = |source| AssetFileError::Read {
        path: path.to_owned(),
        source,
    };
    let file = std::fs::File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    let mut limited = file.take(most + 1);
    limited.read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// Reads a TOML table.
///
/// # Errors
/// [`AssetFileError`].
pub(crate) fn table<T: DeserializeOwned>(path: &Path) -> Result<T, AssetFileError> {
    let text = bytes(path, MOST_BYTES)?;
    if text.len() as u64 > MOST_BYTES {
        return Err(AssetFileError::Read {
            path: path.to_owned(),
            source: std::io::Error::other(format!("more than {MOST_BYTES} bytes")),
        });
    }
    let text = String::from_utf8_lossy(&text);
    toml::from_str(&text).map_err(|source| AssetFileError::Toml {
        path: path.to_owned(),
        source: Box::new(source),
    })
}
