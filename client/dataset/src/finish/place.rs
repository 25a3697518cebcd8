//! Putting a finished file in its place: durable, atomic, never over another.

use std::fs::File;
use std::io;
use std::path::Path;

/// Gives the temporary file its final name. Fails with `AlreadyExists` when
/// the name is taken; then both files stay as they are.
pub(crate) fn place(temporary: &Path, target: &Path) -> io::Result<()> {
    File::open(temporary)?.sync_all()?;
    match std::fs::hard_link(temporary, target) {
        Ok(()) => std::fs::remove_file(temporary)?,
        Err(problem) if problem.kind() == io::ErrorKind::AlreadyExists => return Err(problem),
        // No hard links here (FAT, some network folders): take the name with
        // an empty file of our own, which the rename then replaces.
        Err(_) => {
            File::create_new(target)?;
            std::fs::rename(temporary, target)?;
        }
    }
    sync_folder(target)
}

/// Makes a new or removed name durable.
pub(crate) fn sync_folder(file: &Path) -> io::Result<()> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    File::open(folder)?.sync_all()
}
