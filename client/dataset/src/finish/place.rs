//! Putting a finished file in its place: durable, atomic, never over another.

use std::fs::File;
use std::io;
use std::path::Path;

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

/// Gives the temporary file its final name. Fails with `AlreadyExists` when
/// the name is taken; then both files stay as they are.
///
/// # Errors
/// As the file system says.
pub fn place(temporary: &Path, target: &Path) -> io::Result<()> {
    File::open(temporary)?.sync_all()?;
    let mut done = renameat_with(CWD, temporary, CWD, target, RenameFlags::NOREPLACE);
    if done.is_err_and(cannot) {
        // Some network folders do not know that call, but have hard links.
        done = rustix::fs::link(temporary, target);
        if done.is_ok() {
            // The file is in its place; a second name harms nobody.
            let _ = std::fs::remove_file(temporary);
        }
    }
    match done {
        Ok(()) => {}
        Err(problem) if cannot(problem) => take_name(temporary, target)?,
        Err(problem) => return Err(problem.into()),
    }
    sync_folder(target)
}

/// Whether a file system does not have a call, rather than failing in it.
fn cannot(problem: Errno) -> bool {
    let missing = [
        Errno::INVAL,
        Errno::NOSYS,
        Errno::PERM,
        Errno::OPNOTSUPP,
        Errno::MLINK,
    ];
    missing.contains(&problem)
}

/// Where there is neither: takes the name with an empty file of our own, which
/// the rename then replaces.
fn take_name(temporary: &Path, target: &Path) -> io::Result<()> {
    File::create_new(target)?;
    std::fs::rename(temporary, target).inspect_err(|_| {
        // No empty file may keep the final name.
        let _ = std::fs::remove_file(target);
    })
}

/// Makes a new or removed name durable.
pub(crate) fn sync_folder(file: &Path) -> io::Result<()> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taken_name_is_never_replaced_by_any_of_the_ways() {
        let folder = tempfile::tempdir().unwrap();
        let (temporary, target) = (folder.path().join("t"), folder.path().join("f"));
        for way in [place, take_name] {
            std::fs::write(&temporary, "new").unwrap();
            std::fs::write(&target, "old").unwrap();
            let problem = way(&temporary, &target).unwrap_err();
            assert_eq!(problem.kind(), io::ErrorKind::AlreadyExists);
            assert_eq!(std::fs::read(&target).unwrap(), b"old");
            std::fs::remove_file(&target).unwrap();
            way(&temporary, &target).unwrap();
            assert_eq!(std::fs::read(&target).unwrap(), b"new");
            assert!(!temporary.exists());
        }
        // What cannot be renamed leaves no empty file behind.
        std::fs::remove_file(&target).unwrap();
        assert!(take_name(&temporary, &target).is_err());
        assert!(!target.exists());
    }
}
