//! The zip archive of a `.sh3d` file, read with bounds: number, size and compression ratio
//! of entries, their paths and depth.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use zip::ZipArchive;

use crate::error::ImportError;

/// Largest file that is read, bytes.
pub const MAX_FILE: u64 = 512 << 20;
/// Largest number of entries.
pub const MAX_ENTRIES: usize = 20_000;
/// Largest entry, bytes.
pub const MAX_ENTRY: u64 = 64 << 20;
/// Largest sum of the entries that one import unpacks, bytes.
pub const MAX_TOTAL: u64 = 1 << 30;
/// Largest compression ratio of an entry above 1 MiB. Texts of models reach 20.
pub const MAX_RATIO: u64 = 200;
/// Largest number of folders in a path.
const MAX_DEPTH: usize = 16;
/// Longest path, bytes.
const MAX_PATH: usize = 512;

/// An archive in memory; entries are unpacked when they are requested.
pub struct Archive {
    file: String,
    zip: ZipArchive<Cursor<Vec<u8>>>,
    /// Index of each path.
    paths: BTreeMap<String, usize>,
    unpacked: u64,
}

impl Archive {
    /// Opens an archive and checks its directory. `file` is its name in errors.
    ///
    /// # Errors
    /// When it is not a zip archive, or above a limit.
    pub fn open(file: &str, bytes: Vec<u8>) -> Result<Self, ImportError> {
        let reject = |reason: String| ImportError::Unsafe {
            file: file.to_owned(),
            reason,
        };
        if bytes.len() as u64 > MAX_FILE {
            return Err(reject(format!(
                "{} MiB, at most {} MiB are read; leave out unused models",
                bytes.len() >> 20,
                MAX_FILE >> 20
            )));
        }
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| ImportError::NotZip {
            file: file.to_owned(),
            reason: error.to_string(),
        })?;
        if zip.len() > MAX_ENTRIES {
            return Err(reject(format!(
                "{} entries, at most {MAX_ENTRIES} are read; leave out unused models",
                zip.len()
            )));
        }
        let mut paths = BTreeMap::new();
        for index in 0..zip.len() {
            let entry = zip
                .by_index_raw(index)
                .map_err(|error| reject(format!("entry {index}: {error}")))?;
            let path = entry
                .name()
                .map_err(|error| reject(format!("entry {index}: {error}")))?
                .into_owned();
            if let Some(why) = unsafe_path(&path) {
                return Err(reject(format!(
                    "entry {path:?} {why}; save the home again with Sweet Home 3D"
                )));
            }
            let (size, packed) = (entry.size(), entry.compressed_size());
            if size > MAX_ENTRY {
                return Err(reject(format!(
                    "entry {path:?} has {} MiB, at most {} MiB are read; simplify the model",
                    size >> 20,
                    MAX_ENTRY >> 20
                )));
            }
            if size > 1 << 20 && size / packed.max(1) > MAX_RATIO {
                return Err(reject(format!(
                    "entry {path:?} is packed {} to 1, at most {MAX_RATIO} to 1 is read; it looks like a zip bomb",
                    size / packed.max(1)
                )));
            }
            paths.insert(path, index);
        }
        Ok(Self {
            file: file.to_owned(),
            zip,
            paths,
            unpacked: 0,
        })
    }

    /// The paths of all entries, sorted.
    pub fn paths(&self) -> impl Iterator<Item = &str> {
        self.paths.keys().map(String::as_str)
    }

    /// Whether there is an entry of this path.
    #[must_use]
    pub fn has(&self, path: &str) -> bool {
        self.paths.contains_key(path)
    }

    /// Unpacks one entry; `None` when there is none of this path.
    ///
    /// # Errors
    /// When the entry is damaged or encrypted, longer than its header says, or when the
    /// import unpacks more than [`MAX_TOTAL`] bytes.
    pub fn read(&mut self, path: &str) -> Result<Option<Vec<u8>>, ImportError> {
        let Some(&index) = self.paths.get(path) else {
            return Ok(None);
        };
        let file = self.file.clone();
        let reject = |reason: String| ImportError::Unsafe {
            file: file.clone(),
            reason,
        };
        let left = MAX_ENTRY.min(MAX_TOTAL.saturating_sub(self.unpacked));
        let entry = self.zip.by_index(index).map_err(|error| {
            reject(format!(
                "entry {path:?} cannot be unpacked ({error}); save the home again with Sweet Home 3D"
            ))
        })?;
        let size = entry.size();
        let mut bytes = Vec::new();
        entry
            .take(left + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| {
                reject(format!(
                    "entry {path:?} is damaged ({error}); save the home again with Sweet Home 3D"
                ))
            })?;
        let length = bytes.len() as u64;
        if length > left || length > size {
            return Err(reject(format!(
                "entry {path:?} unpacks to more than {} bytes; it looks like a zip bomb",
                size.min(left)
            )));
        }
        self.unpacked += length;
        Ok(Some(bytes))
    }
}

/// Why a path may not be used, if so.
fn unsafe_path(path: &str) -> Option<&'static str> {
    let folders = path.split('/').count();
    if path.is_empty() || path.len() > MAX_PATH {
        Some("has an empty or a very long name")
    } else if path.starts_with('/') || path.contains('\\') || path.contains(':') {
        Some("has an absolute path")
    } else if path.split('/').any(|part| part == ".." || part == ".") {
        Some("leaves the archive")
    } else if path.chars().any(char::is_control) {
        Some("has a control character in its name")
    } else if folders > MAX_DEPTH {
        Some("lies too many folders deep")
    } else {
        None
    }
}
