//! Reading a log that may end anywhere: the valid prefix is kept, the rest is
//! reported. No input bytes cause a panic.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use prost::Message;

use super::format::{FILE_MAGIC, parse_header};
use super::{Closing, Kind, Locked, LogError, MAX_PAYLOAD, Preamble, RECORD_HEADER, RecordHeader};

/// One record of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its header.
    pub header: RecordHeader,
    /// Offset of its payload in the file, bytes.
    pub offset: u64,
    /// Length of its payload, bytes.
    pub length: usize,
    /// Checksum of the record, from its header.
    crc: u32,
}

/// The index of a log.
#[derive(Debug)]
pub struct Scan {
    file: File,
    path: PathBuf,
    /// The preamble.
    pub preamble: Preamble,
    /// Samples in the order in which they were written.
    pub entries: Vec<Entry>,
    /// The last record, when the log was closed in order.
    pub closing: Option<Closing>,
    /// Length of the valid prefix, bytes.
    pub good: u64,
    /// Bytes behind it that are lost.
    pub lost: u64,
    /// Why reading stopped there; `None` for an undamaged log.
    pub damage: Option<String>,
}

impl Scan {
    /// Reads a record's payload into `buffer`, whose content is dropped and which
    /// is best reused for the next one, and compares its checksum.
    ///
    /// # Errors
    /// [`LogError::Io`]; [`LogError::Damaged`].
    pub fn payload<'a>(
        &self,
        entry: &Entry,
        buffer: &'a mut Vec<u8>,
    ) -> Result<&'a [u8], LogError> {
        let path = || self.path.display().to_string();
        let whole = RECORD_HEADER + entry.length;
        if buffer.len() < whole {
            buffer.resize(whole, 0);
        }
        let record = &mut buffer[..whole];
        let at = entry.offset - RECORD_HEADER as u64;
        self.file
            .read_exact_at(record, at)
            .map_err(|source| LogError::Io {
                path: path(),
                source,
            })?;
        match crc32fast::hash(&record[8..]) == entry.crc {
            true => Ok(&buffer[RECORD_HEADER..whole]),
            false => Err(LogError::Damaged { path: path(), at }),
        }
    }

    /// Path of the log.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Locks a log for as long as the file that it gives lives, so that no recorder writes
/// it and no other process makes a file of it. `None` without anything that could be
/// locked; reading it returns the reason.
///
/// # Errors
/// [`LogError::InUse`].
pub fn hold(path: &Path) -> Result<Option<Locked>, LogError> {
    if !std::fs::metadata(path).is_ok_and(|m| m.is_file()) {
        return Ok(None);
    }
    let Ok(file) = File::open(path) else {
        return Ok(None);
    };
    match Locked::lock(file) {
        Ok(file) if !path.exists() || is_at(&file, path) => Ok(Some(file)),
        Ok(_) | Err(_) => Err(LogError::InUse(path.display().to_string())),
    }
}

/// Whether an open file is the one at `path`.
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let of = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    let there = path.metadata().map(of);
    file.metadata().map(of).ok() == there.ok()
}

/// Reads the index of a log and checks every record.
///
/// # Errors
/// [`LogError::NoLog`] when the beginning is not readable; damage behind it is
/// not an error but reported in [`Scan::damage`].
pub fn scan(path: &Path) -> Result<Scan, LogError> {
    read(path, Payloads::Checked)
}

/// The index of a log that was closed in order, by the headers of its records;
/// `None` when it ends otherwise; use [`scan`] then. Damage of payloads
/// shows when they are read ([`Scan::payload`]), so that
/// nothing is read twice.
///
/// # Errors
/// [`LogError::NoLog`] when the beginning is not readable.
pub fn outline(path: &Path) -> Result<Option<Scan>, LogError> {
    let found = read(path, Payloads::Skipped)?;
    Ok((found.closing.is_some() && found.damage.is_none()).then_some(found))
}

/// How payloads are checked while the index is built.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Payloads {
    Checked,
    Skipped,
}

fn read(path: &Path, payloads: Payloads) -> Result<Scan, LogError> {
    let io = |source| LogError::Io {
        path: path.display().to_string(),
        source,
    };
    let no_log = |reason: String| LogError::NoLog {
        path: path.display().to_string(),
        reason,
    };
    let absent = |reason: &str| LogError::Absent {
        path: path.display().to_string(),
        reason: reason.to_owned(),
    };
    // Opening a pipe would block until it has a writer.
    if std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        return Err(absent(
            "it is a pipe, a socket or a device; name a regular file, LABEL.h5.wal",
        ));
    }
    let file = match File::open(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(absent("the file does not exist"));
        }
        other => other.map_err(io)?,
    };
    let metadata = file.metadata().map_err(io)?;
    if metadata.is_dir() {
        return Err(absent("it is a folder; name a log in it, LABEL.h5.wal"));
    }
    let total = metadata.len();
    let ahead = match payloads {
        Payloads::Checked => 1 << 18,
        Payloads::Skipped => 1 << 13,
    };
    let mut input = BufReader::with_capacity(ahead, file.try_clone().map_err(io)?);

    let mut head = [0; 16];
    input
        .read_exact(&mut head)
        .map_err(|_| no_log(format!("it has {total} bytes, a log has at least 16")))?;
    if &head[..8] != FILE_MAGIC {
        return Err(no_log(foreign(path, &head)));
    }
    let length = u32::from_le_bytes([head[8], head[9], head[10], head[11]]) as usize;
    let crc = u32::from_le_bytes([head[12], head[13], head[14], head[15]]);
    if length > MAX_PAYLOAD || 16 + length as u64 > total {
        return Err(no_log(format!(
            "its preamble should have {length} bytes, the file has {total}"
        )));
    }
    let mut body = vec![0; length];
    input.read_exact(&mut body).map_err(io)?;
    if crc32fast::hash(&body) != crc {
        return Err(no_log("the checksum of its preamble is wrong".into()));
    }
    let preamble = Preamble::decode(body.as_slice()).map_err(|e| no_log(e.to_string()))?;

    let mut out = Scan {
        file,
        path: path.to_owned(),
        preamble,
        entries: Vec::new(),
        closing: None,
        good: 16 + length as u64,
        lost: 0,
        damage: None,
    };
    out.damage = records(&mut input, total, payloads, &mut out).err();
    out.lost = total.saturating_sub(out.good);
    Ok(out)
}

/// Describes a file that does not begin like a log, with the fix.
fn foreign(path: &Path, head: &[u8]) -> String {
    const NAME: &str = "a log is named LABEL.h5.wal and stands where the file will be";
    if head.starts_with(crate::hdf::SIGNATURE) {
        let log = path.with_added_extension("wal");
        let beside = if log.is_file() {
            format!("its log is {}", log.display())
        } else {
            format!("{NAME}; no log exists beside it, so it cannot be recovered")
        };
        return format!(
            "it is an HDF5 file, `wheelarm dataset info {}` shows what it holds; {beside}",
            path.display()
        );
    }
    let (magic, version) = FILE_MAGIC.split_at(6);
    if head.starts_with(magic) {
        return format!(
            "it is a log of format {:?}, this program reads {:?}: use the version of WheelArm that recorded it",
            char::from(head[6]),
            char::from(version[0])
        );
    }
    format!("it does not begin like a log; {NAME}")
}

/// Reads records up to the end or the first bad one, which it describes.
fn records(
    input: &mut (impl Read + Seek),
    total: u64,
    payloads: Payloads,
    out: &mut Scan,
) -> Result<(), String> {
    let mut block = vec![0; 1 << 16];
    while out.good < total && out.closing.is_none() {
        let at = out.good;
        let mut head = [0; RECORD_HEADER];
        input
            .read_exact(&mut head)
            .map_err(|_| format!("the record at byte {at} is cut off within its header"))?;
        let raw = parse_header(&head)
            .ok_or_else(|| format!("no record begins at byte {at} (damaged header)"))?;
        let offset = at + RECORD_HEADER as u64;
        if offset + raw.length as u64 > total {
            return Err(format!(
                "the record at byte {at} should have {} bytes, {} follow",
                raw.length,
                total.saturating_sub(offset)
            ));
        }
        let bad = |e| format!("the record at byte {at} cannot be read: {e}");
        let checked = payloads == Payloads::Checked || raw.header.kind == Kind::Closing;
        let mut crc = crc32fast::Hasher::new();
        crc.update(&head[8..]);
        let mut closing = Vec::new();
        let mut rest = raw.length;
        if !checked {
            input.seek_relative(rest as i64).map_err(bad)?;
            rest = 0;
        }
        while rest > 0 {
            let piece = &mut block[..rest.min(1 << 16)];
            input.read_exact(piece).map_err(bad)?;
            crc.update(piece);
            if raw.header.kind == Kind::Closing {
                closing.extend_from_slice(piece);
            }
            rest -= piece.len();
        }
        if checked && crc.finalize() != raw.crc {
            return Err(format!("the checksum of the record at byte {at} is wrong"));
        }
        if raw.header.kind == Kind::Closing {
            let message = Closing::decode(closing.as_slice())
                .map_err(|e| format!("the closing record at byte {at} cannot be decoded: {e}"))?;
            out.closing = Some(message);
        } else if usize::from(raw.header.stream) >= out.preamble.streams.len() {
            return Err(format!(
                "the record at byte {at} names stream {} of {}",
                raw.header.stream,
                out.preamble.streams.len()
            ));
        } else {
            out.entries.push(Entry {
                header: raw.header,
                offset,
                length: raw.length,
                crc: raw.crc,
            });
        }
        out.good = offset + raw.length as u64;
    }
    if out.good < total {
        return Err("bytes follow the closing record".to_owned());
    }
    Ok(())
}
