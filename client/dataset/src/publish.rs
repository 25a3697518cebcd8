//! Publication: a file or folder that was made under another name gets its final one,
//! durably, in one step and never over another. Recorder, exports and campaigns make
//! files and folders that others look for through here.
//!
//! Some file systems lack a call: VirtualBox's and old CIFS shares cannot sync a folder,
//! others have no rename that refuses a taken name. A missing call is tolerated, an error
//! of a present one is not. Behind the rename nothing is an error: the file is complete
//! and has its name.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Once;

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

/// A name that was given. Where the folder could not be synced, a loss of power may
/// still undo it.
#[derive(Debug, Default)]
pub struct Published {
    /// Why the name is not durable.
    pub not_durable: Option<io::Error>,
}

/// Makes the name of a complete file or folder durable. An error is a warning: the file
/// has its name already.
pub fn settle(target: &Path) -> Published {
    let not_durable = sync_folder(target).err();
    if let Some(problem) = &not_durable {
        let name = target.display();
        tracing::warn!("{name} is complete, but its folder cannot be synced: {problem}");
    }
    Published { not_durable }
}

/// Gives the temporary file its final name.
///
/// # Errors
/// `AlreadyExists` when the name is taken; then both files stay as they are. Else
/// what the disk says; then the final name does not exist.
pub fn file(temporary: &Path, target: &Path) -> io::Result<Published> {
    sync_file(&File::open(temporary)?)?;
    let mut done = rename(temporary, target);
    if done.is_err_and(cannot) {
        // Some network folders do not know that call, but have hard links.
        done = link(temporary, target);
    }
    match done {
        Ok(()) => {}
        Err(problem) if cannot(problem) => take_name(temporary, target)?,
        Err(problem) => return Err(problem.into()),
    }
    Ok(settle(target))
}

/// Gives the temporary folder its final name; what is in it is durable already,
/// or can be made again.
///
/// # Errors
/// `AlreadyExists` when the name is taken; then both stay as they are. Else what
/// the disk says; then the final name does not exist.
pub fn folder(temporary: &Path, target: &Path) -> io::Result<Published> {
    match rename(temporary, target) {
        Ok(()) => {}
        Err(problem) if cannot(problem) => take_folder(temporary, target)?,
        Err(problem) => return Err(problem.into()),
    }
    Ok(settle(target))
}

fn rename(temporary: &Path, target: &Path) -> Result<(), Errno> {
    renameat_with(CWD, temporary, CWD, target, RenameFlags::NOREPLACE)
}

fn link(temporary: &Path, target: &Path) -> Result<(), Errno> {
    rustix::fs::link(temporary, target)?;
    // The file has its final name; a second name does no harm.
    let _ = std::fs::remove_file(temporary);
    Ok(())
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

/// The same for a folder: only an empty one is replaced, and that is our own.
fn take_folder(temporary: &Path, target: &Path) -> io::Result<()> {
    std::fs::create_dir(target)?;
    std::fs::rename(temporary, target).inspect_err(|_| {
        let _ = std::fs::remove_dir(target);
    })
}

/// Makes a new or removed name durable, where the file system can sync folders.
///
/// # Errors
/// The I/O error of the disk.
pub fn sync_folder(file: &Path) -> io::Result<()> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // A folder that may be written and not listed cannot be opened.
    let synced = File::open(folder).and_then(|folder| folder.sync_all());
    tolerated(synced, &format!("the folder {}", folder.display()))
}

/// Brings a file to the disk, where the file system can sync files.
///
/// # Errors
/// The I/O error of the disk.
pub fn sync_file(file: &File) -> io::Result<()> {
    tolerated(file.sync_all(), "a file")
}

/// Brings the contents of a file to the disk, where the file system can sync files.
///
/// # Errors
/// The I/O error of the disk.
pub fn sync_data(file: &File) -> io::Result<()> {
    tolerated(file.sync_data(), "a file")
}

/// Turns the answer of a file system without such a call into success, which is logged
/// once.
fn tolerated(synced: io::Result<()>, what: &str) -> io::Result<()> {
    static TOLD: Once = Once::new();
    let missing = [
        Errno::ACCESS,
        Errno::NOTSUP,
        Errno::BADF,
        Errno::ISDIR,
        Errno::NOTTY,
    ];
    let is_missing = |problem: &io::Error| {
        let number = Errno::from_io_error(problem);
        number.is_some_and(|number| cannot(number) || missing.contains(&number))
    };
    match synced {
        Err(problem) if is_missing(&problem) => {
            TOLD.call_once(|| {
                tracing::warn!(
                    "this file system cannot sync {what} ({problem}): files are complete, but a \
                     loss of power may cost the newest"
                );
            });
            Ok(())
        }
        synced => synced,
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Barrier;

    use super::*;

    /// A way of giving a name.
    type Way = fn(&Path, &Path) -> io::Result<()>;

    const FILES: [Way; 4] = [
        |from, to| file(from, to).map(drop),
        |from, to| rename(from, to).map_err(Into::into),
        |from, to| link(from, to).map_err(Into::into),
        take_name,
    ];
    const FOLDERS: [Way; 3] = [
        |from, to| folder(from, to).map(drop),
        |from, to| rename(from, to).map_err(Into::into),
        take_folder,
    ];

    /// Something to publish that says whose it is: a file, or a folder with one.
    fn make(path: &Path, words: &str, is_folder: bool) {
        if is_folder {
            std::fs::create_dir(path).unwrap();
            std::fs::write(path.join("words"), words).unwrap();
        } else {
            std::fs::write(path, words).unwrap();
        }
    }

    fn words(path: &Path) -> String {
        let inside = if path.is_dir() {
            path.join("words")
        } else {
            path.to_owned()
        };
        std::fs::read_to_string(inside).unwrap()
    }

    #[test]
    fn of_several_publishers_one_wins_and_the_others_keep_their_files() {
        let ways = FILES.map(|way| (way, false)).into_iter();
        for (way, is_folder) in ways.chain(FOLDERS.map(|way| (way, true))) {
            for _ in 0..50 {
                let place = tempfile::tempdir().unwrap();
                let target = place.path().join("final");
                let made: Vec<PathBuf> = (0..4)
                    .map(|i| place.path().join(format!("made-{i}")))
                    .collect();
                for (i, path) in made.iter().enumerate() {
                    make(path, &i.to_string(), is_folder);
                }
                let start = Barrier::new(made.len());
                let done: Vec<io::Result<()>> = std::thread::scope(|scope| {
                    let threads: Vec<_> = made
                        .iter()
                        .map(|path| {
                            let (start, target) = (&start, &target);
                            scope.spawn(move || {
                                start.wait();
                                way(path, target)
                            })
                        })
                        .collect();
                    threads.into_iter().map(|t| t.join().unwrap()).collect()
                });
                let winners: Vec<usize> = (0..made.len()).filter(|&i| done[i].is_ok()).collect();
                assert_eq!(winners.len(), 1, "{done:?}");
                assert_eq!(words(&target), winners[0].to_string());
                for (i, path) in made.iter().enumerate() {
                    assert_eq!(path.exists(), i != winners[0]);
                    if let Err(problem) = &done[i] {
                        assert_eq!(problem.kind(), io::ErrorKind::AlreadyExists);
                        assert_eq!(words(path), i.to_string());
                    }
                }
            }
        }
    }

    #[test]
    fn an_existing_name_is_never_replaced() {
        let ways = FILES.map(|way| (way, false)).into_iter();
        for (way, is_folder) in ways.chain(FOLDERS.map(|way| (way, true))) {
            let place = tempfile::tempdir().unwrap();
            let (temporary, target) = (place.path().join("t"), place.path().join("f"));
            make(&temporary, "new", is_folder);
            make(&target, "old", is_folder);
            let problem = way(&temporary, &target).unwrap_err();
            assert_eq!(problem.kind(), io::ErrorKind::AlreadyExists);
            assert_eq!(
                (words(&target), words(&temporary)),
                ("old".into(), "new".into())
            );
        }
    }

    #[test]
    fn a_failed_rename_leaves_no_empty_file_under_the_final_name() {
        let place = tempfile::tempdir().unwrap();
        let (temporary, target) = (place.path().join("t"), place.path().join("f"));
        for way in [take_name, take_folder] {
            assert!(way(&temporary, &target).is_err());
            assert!(!target.exists());
        }
    }

    #[test]
    fn a_missing_sync_is_tolerated_and_a_failed_one_is_not() {
        let answer = |number: Errno| tolerated(Err(number.into()), "the folder f");
        for missing in [Errno::INVAL, Errno::OPNOTSUPP, Errno::NOSYS, Errno::BADF] {
            assert!(answer(missing).is_ok(), "{missing}");
        }
        for failed in [Errno::IO, Errno::NOSPC, Errno::DQUOT] {
            assert!(answer(failed).is_err(), "{failed}");
        }
    }
}
