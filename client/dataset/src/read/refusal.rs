//! Reasons why a path is not an episode file, with the fix. HDF5 itself
//! reports only error numbers and addresses.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::error::ReadError;

/// Bytes of the superblock that hold the file's length.
const HEAD: u64 = 48;

/// HDF5's message for a file that another process writes.
const LOCKED: [&str; 2] = ["unable to lock file", "Resource temporarily unavailable"];

/// The error of a file that HDF5 rejected with `source`.
pub(super) fn refusal(path: &Path, source: &hdf5::Error) -> ReadError {
    let path_of = || path.to_owned();
    match check_file(path) {
        Ok(Some(known)) => known,
        Ok(None)
            if LOCKED
                .iter()
                .all(|words| source.to_string().contains(words)) =>
        {
            ReadError::Unreadable {
                path: path_of(),
                reason: "another program has it open for writing: close it there".to_owned(),
            }
        }
        Ok(None) => ReadError::Unreadable {
            path: path_of(),
            reason: format!("the file is damaged; {} ({source})", cure(path)),
        },
        Err(problem) => ReadError::Unreadable {
            path: path_of(),
            reason: format!("it cannot be read: {problem}"),
        },
    }
}

/// HDF5's error where the file system does not support locks.
pub(super) fn has_no_locks(source: &hdf5::Error) -> bool {
    let words = source.to_string();
    words.contains(LOCKED[0]) && !words.contains(LOCKED[1])
}

/// A file that `problem` makes unsafe to read.
pub(super) fn untrusted(path: &Path, problem: &str) -> ReadError {
    ReadError::Unreadable {
        path: path.to_owned(),
        reason: format!(
            "{problem}: no recorder writes such a file; do not use it, or copy it again from where \
             it was recorded"
        ),
    }
}

/// Rejects a path that is neither file nor folder, because reading a pipe waits forever,
/// and a path that HDF5 cannot open.
///
/// # Errors
/// [`ReadError::Unreadable`].
pub(super) fn check_path(path: &Path) -> Result<(), ReadError> {
    if path.to_str().is_none() {
        return Err(ReadError::Unreadable {
            path: path.to_owned(),
            reason: "the path is not UTF-8, which HDF5 needs: rename the file or its folder"
                .to_owned(),
        });
    }
    match std::fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() && !metadata.is_dir() => Err(ReadError::Unreadable {
            path: path.to_owned(),
            reason: "it is a pipe, a socket or a device; name a regular file, LABEL.h5".to_owned(),
        }),
        _ => Ok(()),
    }
}

/// The log of a file, if it exists.
fn log_beside(path: &Path) -> Option<PathBuf> {
    let log = path.with_added_extension("wal");
    log.is_file().then_some(log)
}

/// The fix for a truncated file.
fn cure(path: &Path) -> String {
    match log_beside(path) {
        Some(log) => format!(
            "its log is still there: move this file away, then `wheelarm dataset recover {}`",
            log.display()
        ),
        None => "copy it again from where it was recorded".to_owned(),
    }
}

/// Checks the path itself; `None` when its beginning and its length are valid.
fn check_file(path: &Path) -> std::io::Result<Option<ReadError>> {
    let unreadable = |reason: String| {
        Ok(Some(ReadError::Unreadable {
            path: path.to_owned(),
            reason,
        }))
    };
    let no_episode = |reason: String| {
        Ok(Some(ReadError::NoEpisode {
            path: path.to_owned(),
            reason,
        }))
    };
    let metadata = match std::fs::metadata(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return unreadable(absent(path)),
        other => other?,
    };
    if metadata.is_dir() {
        return unreadable(folder(path));
    }
    if path.to_str().is_none() {
        return unreadable(
            "its path is not UTF-8, which the HDF5 library does not open: rename the file or \
             its folder"
                .to_owned(),
        );
    }
    let mut head = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(HEAD).read_to_end(&mut head)?;
    if head.is_empty() {
        return unreadable(format!("the file is empty; {}", cure(path)));
    }
    if head.starts_with(crate::log::MAGIC) {
        return no_episode(format!(
            "it is the log of a recording that was not finished; `wheelarm dataset recover {}` makes the file of it",
            path.display()
        ));
    }
    if !head.starts_with(crate::hdf::SIGNATURE) {
        return no_episode("it is not an HDF5 file".to_owned());
    }
    match stored_length(&head) {
        Some(stored) if stored > metadata.len() => unreadable(format!(
            "the file is cut off: {} of {stored} bytes are there; {}",
            metadata.len(),
            cure(path)
        )),
        _ => Ok(None),
    }
}

fn absent(path: &Path) -> String {
    if let Ok(target) = std::fs::read_link(path) {
        return format!("it is a link to {}, which does not exist", target.display());
    }
    match log_beside(path) {
        Some(log) => format!(
            "the file does not exist, but its log: `wheelarm dataset recover {}` makes the file of it",
            log.display()
        ),
        None => "the file does not exist".to_owned(),
    }
}

fn folder(path: &Path) -> String {
    let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
    let mut inside: Vec<PathBuf> = entries
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "h5"))
        .collect();
    inside.sort();
    match inside.first() {
        Some(first) => format!(
            "it is a folder; name one of its {} files, for example {}, or take `wheelarm dataset stats {}` for all",
            inside.len(),
            first.display(),
            path.display()
        ),
        None => match path.join("episodes") {
            episodes if episodes.is_dir() => format!(
                "it is the folder of a campaign; its episodes are in {}",
                episodes.display()
            ),
            _ => "it is a folder without an episode file (*.h5)".to_owned(),
        },
    }
}

/// Length of an intact file by its superblock, bytes; `None` for unknown versions.
fn stored_length(head: &[u8]) -> Option<u64> {
    // Sizes of addresses are 8 bytes in every file of ours.
    let (size, at) = match head.get(8)? {
        0 | 1 => (*head.get(13)?, 40),
        2 | 3 => (*head.get(9)?, 28),
        _ => return None,
    };
    let bytes = head.get(at..at + 8)?.try_into().ok()?;
    (size == 8).then(|| u64::from_le_bytes(bytes))
}
