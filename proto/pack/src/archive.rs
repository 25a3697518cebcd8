//! Zip files of packs. Equal packs give equal bytes: entries are sorted and have one time.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use crate::error::PackError;

/// Largest zip file, bytes.
pub const MOST_ZIP_BYTES: usize = 64 << 20;
/// Largest number of files in a pack.
pub const MOST_FILES: usize = 4096;
/// Largest file in a pack, bytes.
pub const MOST_FILE_BYTES: u64 = 32 << 20;
/// Largest total size of the files, bytes.
pub const MOST_BYTES: u64 = 256 << 20;
/// Largest ratio of the size of a file to its compressed size, for files of more than
/// [`SMALL`] bytes. Texts of a pack shrink to a fifth, images not at all.
const MOST_RATIO: u64 = 200;
const SMALL: u64 = 1 << 20;
/// Entries that macOS adds to a zip file.
const FOREIGN: &str = "__MACOSX/";
/// Signature and length of the record at the end of a zip file.
const END: [u8; 4] = *b"PK\x05\x06";
const END_BYTES: usize = 22;

/// Total size of files so far, checked against the limits.
#[derive(Default)]
pub(crate) struct Sum {
    files: usize,
    bytes: u64,
}

impl Sum {
    /// Adds a file of `bytes`.
    pub(crate) fn add(&mut self, path: &str, bytes: u64) -> Result<(), PackError> {
        self.files += 1;
        self.bytes = self.bytes.saturating_add(bytes);
        let large = |what: String, found, most, unit, cure| PackError::Large {
            what,
            found,
            most,
            unit,
            cure,
        };
        if bytes > MOST_FILE_BYTES {
            return Err(large(
                format!("{:?}", wheelarm_proto::check::beginning(path)),
                bytes,
                MOST_FILE_BYTES,
                "bytes",
                "simplify the mesh or make the image smaller",
            ));
        }
        if self.files > MOST_FILES {
            let found = self.files as u64;
            return Err(too_many(found));
        }
        if self.bytes > MOST_BYTES {
            return Err(large(
                "the size of all files".to_owned(),
                self.bytes,
                MOST_BYTES,
                "bytes",
                "leave out or simplify meshes",
            ));
        }
        Ok(())
    }
}

fn too_many(found: u64) -> PackError {
    PackError::Large {
        what: "the number of files".to_owned(),
        found,
        most: MOST_FILES as u64,
        unit: "files",
        cure: "leave out files, or split the pack",
    }
}

/// Files of a zip file, by path, checked for count, size, ratio, names and links. A single
/// folder around all files is removed from their paths.
///
/// # Errors
/// [`PackError`] when the file is damaged or exceeds a limit.
pub fn read(bytes: &[u8]) -> Result<BTreeMap<String, Vec<u8>>, PackError> {
    if bytes.len() > MOST_ZIP_BYTES {
        return Err(PackError::Large {
            what: "the zip file".to_owned(),
            found: bytes.len() as u64,
            most: MOST_ZIP_BYTES as u64,
            unit: "bytes",
            cure: "leave out or simplify meshes",
        });
    }
    let entries = number_of_entries(bytes)?;
    if entries > MOST_FILES {
        return Err(too_many(entries as u64));
    }
    let damaged = |error: zip::result::ZipError| PackError::Zip(error.to_string());
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(damaged)?;
    if archive.len() != entries {
        return Err(PackError::Zip(format!(
            "{entries} entries have {} different names",
            archive.len()
        )));
    }
    let mut sum = Sum::default();
    let mut files = BTreeMap::new();
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?.into_owned();
        if name.starts_with(FOREIGN) || entry.is_dir() {
            continue;
        }
        if !entry.is_file() {
            return Err(PackError::Path {
                path: wheelarm_proto::check::beginning(&name),
                reason: "it is a link",
                cure: "replace it by the file",
            });
        }
        let size = entry.size();
        sum.add(&name, size)?;
        let packed = entry.compressed_size().max(1);
        if size > SMALL && size / packed > MOST_RATIO {
            return Err(PackError::Large {
                what: format!(
                    "the compression of {:?}",
                    wheelarm_proto::check::beginning(&name)
                ),
                found: size / packed,
                most: MOST_RATIO,
                unit: ": 1",
                cure: "no file of a pack shrinks that much: remove it",
            });
        }
        let mut content = Vec::new();
        entry
            .take(size + 1)
            .read_to_end(&mut content)
            .map_err(|error| PackError::Zip(format!("{name:?}: {error}")))?;
        if content.len() as u64 != size {
            return Err(PackError::Zip(format!(
                "{name:?} has another size than it states"
            )));
        }
        files.insert(name, content);
    }
    Ok(without_folder(files))
}

/// Number of entries that the record at the end of a zip file states.
fn number_of_entries(bytes: &[u8]) -> Result<usize, PackError> {
    let none = || PackError::Zip("it has no end record".to_owned());
    let last = bytes.len().checked_sub(END_BYTES).ok_or_else(none)?;
    // A comment of up to 65,535 bytes may follow the record.
    let first = last.saturating_sub(usize::from(u16::MAX));
    let at = (first..=last)
        .rev()
        .find(|at| bytes[*at..].starts_with(&END))
        .ok_or_else(none)?;
    Ok(usize::from(u16::from_le_bytes([
        bytes[at + 10],
        bytes[at + 11],
    ])))
}

/// Removes the folder in which all files are, if `pack.toml` is directly in it.
fn without_folder(files: BTreeMap<String, Vec<u8>>) -> BTreeMap<String, Vec<u8>> {
    let folder = files
        .keys()
        .find_map(|path| path.strip_suffix("/pack.toml"))
        .map(|folder| format!("{folder}/"));
    match folder {
        Some(folder) if files.keys().all(|path| path.starts_with(&folder)) => files
            .into_iter()
            .map(|(path, bytes)| (path[folder.len()..].to_owned(), bytes))
            .collect(),
        _ => files,
    }
}

/// A zip file of these files. Equal files give equal bytes.
///
/// # Errors
/// [`PackError`] when a file cannot be compressed.
pub fn write(files: &BTreeMap<String, Vec<u8>>) -> Result<Vec<u8>, PackError> {
    let damaged = |error: zip::result::ZipError| PackError::Zip(error.to_string());
    let options = SimpleFileOptions::default()
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (path, bytes) in files {
        // Images are compressed already.
        let method = match path.ends_with(".png") {
            true => CompressionMethod::Stored,
            false => CompressionMethod::Deflated,
        };
        writer
            .start_file(path.as_str(), options.compression_method(method))
            .map_err(damaged)?;
        writer
            .write_all(bytes)
            .map_err(|error| PackError::Zip(error.to_string()))?;
    }
    Ok(writer.finish().map_err(damaged)?.into_inner())
}
