//! Appends records: a record is in the log entirely or not at all.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use prost::Message;

use super::format::{FILE_MAGIC, Preamble};
use super::locked::Locked;
use super::{LogError, MAX_MESSAGE, MAX_PAYLOAD, MAX_SNAPSHOT};

/// The file of a log. Tests substitute a full disk.
pub trait LogFile: Send {
    /// Appends all bytes with `write(2)`.
    ///
    /// # Errors
    /// Those of the file, for example a full disk.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;
    /// Cuts the file to `length` bytes.
    ///
    /// # Errors
    /// Those of the file.
    fn truncate(&mut self, length: u64) -> io::Result<()>;
}

impl LogFile for Locked {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).append(bytes)
    }

    fn truncate(&mut self, length: u64) -> io::Result<()> {
        (**self).truncate(length)
    }
}

impl LogFile for File {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.write_all(bytes)
    }

    fn truncate(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }
}

/// Creates the file of a log and locks it; an existing file is refused.
///
/// # Errors
/// [`LogError::Io`].
pub(crate) fn create_file(path: &Path) -> Result<Locked, LogError> {
    let io = |source| LogError::Io {
        path: path.display().to_string(),
        source,
    };
    let file = File::options()
        .append(true)
        .create_new(true)
        .open(path)
        .map_err(io)?;
    // The file is exclusively ours: `create_new` succeeds only once.
    Locked::lock(file).map_err(|_| LogError::InUse(path.display().to_string()))
}

/// Appends records and keeps the log valid when an append fails.
pub struct Appender<F> {
    file: F,
    good: u64,
    failure: Option<String>,
}

impl<F: LogFile> Appender<F> {
    /// Writes the preamble.
    ///
    /// # Errors
    /// Those of the file.
    pub fn start(mut file: F, preamble: &Preamble) -> io::Result<Self> {
        let started = preamble.started.as_ref().map_or(0, Message::encoded_len);
        let snapshot = preamble.snapshot.as_ref().map_or(0, |s| s.snapshot.len());
        // A reader rejects more.
        for (what, bytes, most) in [
            ("the episode's description", started, MAX_MESSAGE),
            ("the snapshot", snapshot, MAX_SNAPSHOT),
        ] {
            if bytes > most {
                let words = format!("{what} has {bytes} bytes, at most {most} fit");
                return Err(io::Error::new(io::ErrorKind::InvalidInput, words));
            }
        }
        let body = preamble.encode_to_vec();
        let length = u32::try_from(body.len())
            .ok()
            .filter(|&n| n as usize <= MAX_PAYLOAD)
            .ok_or_else(|| {
                io::Error::new(
                    io::ErrorKind::InvalidInput,
                    format!(
                        "snapshot and assets have {} bytes, at most {MAX_PAYLOAD} fit",
                        body.len()
                    ),
                )
            })?;
        let mut head = FILE_MAGIC.to_vec();
        head.extend(length.to_le_bytes());
        head.extend(crc32fast::hash(&body).to_le_bytes());
        head.extend(body);
        file.append(&head)?;
        Ok(Self {
            file,
            good: head.len() as u64,
            failure: None,
        })
    }

    /// Appends whole records. When it returns Ok they are acknowledged: they
    /// survive the death of this process.
    ///
    /// # Errors
    /// The first failure cuts the log back to the last good record; from then
    /// on every append fails with the same error.
    pub fn append(&mut self, records: &[u8]) -> Result<(), String> {
        if let Some(failure) = &self.failure {
            return Err(failure.clone());
        }
        match self.file.append(records) {
            Ok(()) => {
                self.good += records.len() as u64;
                Ok(())
            }
            Err(problem) => {
                let mut words = format!(
                    "cannot append to the log after {} good bytes: {problem}",
                    self.good
                );
                if problem.kind() == io::ErrorKind::StorageFull {
                    words.push_str("; free space on the disk, then `wheelarm dataset recover LOG` keeps what was acknowledged");
                }
                // A torn record at the end does no harm: the reader stops there.
                if let Err(cut) = self.file.truncate(self.good) {
                    words.push_str(&format!(" (and it could not be cut back: {cut})"));
                }
                self.failure = Some(words.clone());
                Err(words)
            }
        }
    }

    /// Length of the good part, bytes.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.good
    }
}
