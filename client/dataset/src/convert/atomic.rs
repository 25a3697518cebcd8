//! Files and folders that are made under another name and renamed when they
//! are whole; an existing one is never replaced, but by [`change`], which puts a
//! changed copy of it in its place.

use std::collections::BTreeSet;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, OnceLock};
use std::time::SystemTime;

use anyhow::{Context, bail};
use parking_lot::Mutex;

use crate::publish;

/// Counter of temporary names.
static MADE: AtomicU64 = AtomicU64::new(0);

/// The output exists already.
#[derive(Debug, thiserror::Error)]
pub enum AlreadyThere {
    /// From before.
    #[error(
        "{} exists already and is never overwritten: move it away or choose another place with --out", .0.display()
    )]
    Before(PathBuf),
    /// By the same command, which began again since.
    #[error("{} was written before this command began again", .0.display())]
    Again(PathBuf),
    /// For another input, or by another program.
    #[error(
        "{} was written meanwhile by another recording of the same label, or by another export: give another --out for one of them", .0.display()
    )]
    Meanwhile(PathBuf),
}

/// When the command began, and when this process began to work on it.
static BEGAN: OnceLock<[SystemTime; 2]> = OnceLock::new();

/// Sets the start time of the command that this process executes.
pub fn begin(command: SystemTime) {
    // The first value counts.
    let _ = BEGAN.set([command, SystemTime::now()]);
}

/// Determines who wrote the existing output.
fn written_by(target: &Path, there: &Metadata) -> AlreadyThere {
    /// Files that this process has written already.
    static WRITTEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let target = target.to_owned();
    let is_repeated = !WRITTEN.lock().insert(target.clone());
    let written = there.modified().unwrap_or(SystemTime::UNIX_EPOCH);
    match BEGAN.get() {
        _ if is_repeated => AlreadyThere::Meanwhile(target),
        Some([_, work]) if written > *work => AlreadyThere::Meanwhile(target),
        Some([command, _]) if written > *command => AlreadyThere::Again(target),
        _ => AlreadyThere::Before(target),
    }
}

fn beside(target: &Path) -> anyhow::Result<PathBuf> {
    if let Ok(there) = target.symlink_metadata() {
        return Err(written_by(target, &there).into());
    }
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    make_folder(folder)?;
    remove_left_behind(folder);
    // Two inputs may lead to one name at the same time: the first keeps it.
    Ok(hidden(target))
}

/// A name in the target's folder that is unique, and that identifies leftovers of
/// ended processes.
fn hidden(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let (process, count) = (std::process::id(), MADE.fetch_add(1, Ordering::Relaxed));
    target.with_file_name(format!(".{name}.{}-{process}-{count}.part", *HOST))
}

/// Changes a file that has its final name already: `edit` gets a copy of it, which
/// takes its place, durably and in one step. A process killed meanwhile leaves the file
/// unchanged. For recordings that is a copy of gigabytes.
///
/// # Errors
/// Those of `edit`, and those of the disk: then the file is unchanged.
pub fn change(file: &Path, edit: impl FnOnce(&Path) -> anyhow::Result<()>) -> anyhow::Result<()> {
    // A link leads to the file itself.
    let file = &file.canonicalize()?;
    let copy = hidden(file);
    let changed = || {
        std::fs::copy(file, &copy)
            .with_context(|| format!("copying {} beside itself", file.display()))?;
        edit(&copy)?;
        publish::sync_file(&std::fs::File::open(&copy)?)?;
        Ok(std::fs::rename(&copy, file)?)
    };
    let changed: anyhow::Result<()> = changed();
    changed.inspect_err(|_| {
        let _ = std::fs::remove_file(&copy);
    })?;
    publish::settle(file);
    Ok(())
}

fn make_folder(folder: &Path) -> anyhow::Result<()> {
    let made = std::fs::create_dir_all(folder);
    let in_the_way = folder.ancestors().find(|path| path.is_file());
    match (made, in_the_way) {
        (Err(_), Some(file)) => bail!(
            "{} cannot be made: {} is a file; choose another place with --out",
            folder.display(),
            file.display()
        ),
        (made, _) => made.with_context(|| format!("{} cannot be made", folder.display())),
    }
}

/// Identifies the PID namespace: this machine, outside of other containers.
static HOST: LazyLock<String> = LazyLock::new(|| {
    let own = std::fs::read_link("/proc/self/ns/pid").unwrap_or_default();
    let name = rustix::system::uname();
    let machine = std::fs::read_to_string("/etc/machine-id").unwrap_or_default();
    let identity = format!(
        "{machine} {} {}",
        name.nodename().to_string_lossy(),
        own.display()
    );
    format!("{:08x}", crc32fast::hash(identity.as_bytes()))
});

/// Removes partial files of ended processes of this machine from a folder.
fn remove_left_behind(folder: &Path) {
    static CLEANED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    if !CLEANED.lock().insert(folder.to_owned()) {
        return;
    }
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if process_of(&entry.file_name().to_string_lossy()).is_some_and(is_gone) {
            // A remaining file does no harm.
            let _ = std::fs::remove_file(entry.path());
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}

/// Process of this machine that created the partial file of this name.
fn process_of(name: &str) -> Option<i32> {
    let (_, suffix) = name
        .strip_prefix('.')?
        .strip_suffix(".part")?
        .rsplit_once('.')?;
    let (process, _count) = suffix
        .strip_prefix(&*HOST)?
        .strip_prefix('-')?
        .split_once('-')?;
    process.parse().ok()
}

fn is_gone(process: i32) -> bool {
    use rustix::{io::Errno, process::Pid};
    let process = Pid::from_raw(process);
    process.is_some_and(|id| rustix::process::test_kill_process(id) == Err(Errno::SRCH))
}

/// A file that is not there yet.
#[derive(Debug)]
pub struct PendingFile {
    temporary: PathBuf,
    target: PathBuf,
    done: bool,
}

impl PendingFile {
    /// Prepares `target`; its folder is made when it is missing.
    ///
    /// # Errors
    /// When it exists already.
    pub fn new(target: &Path) -> anyhow::Result<Self> {
        let temporary = beside(target)?;
        let _ = std::fs::remove_file(&temporary);
        Ok(Self {
            temporary,
            target: target.to_owned(),
            done: false,
        })
    }

    /// Path to write to.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// Makes it durable and renames it to its final name.
    ///
    /// # Errors
    /// When the name was taken meanwhile.
    pub fn commit(mut self) -> anyhow::Result<PathBuf> {
        placed(publish::file(&self.temporary, &self.target), &self.target)?;
        self.done = true;
        Ok(self.target.clone())
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        if !self.done {
            let _ = std::fs::remove_file(&self.temporary);
        }
    }
}

/// Handles the result of the rename.
fn placed(named: std::io::Result<publish::Published>, target: &Path) -> anyhow::Result<()> {
    match named {
        Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {
            Err(AlreadyThere::Meanwhile(target.to_owned()).into())
        }
        Err(e) => Err(e).with_context(|| format!("{} cannot be put in place", target.display())),
        Ok(_) => Ok(()),
    }
}

/// Writes a file, which may exist with the same content.
///
/// # Errors
/// When it exists with other content, or cannot be written.
pub fn hold(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    if std::fs::read(path).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    let pending = PendingFile::new(path)?;
    std::fs::write(pending.path(), bytes)?;
    pending.commit()?;
    Ok(())
}

/// A folder that is not there yet.
#[derive(Debug)]
pub struct PendingFolder {
    temporary: PathBuf,
    target: PathBuf,
    done: bool,
}

impl PendingFolder {
    /// Creates a temporary folder for `target`.
    ///
    /// # Errors
    /// When `target` exists already or no folder can be made.
    pub fn new(target: &Path) -> anyhow::Result<Self> {
        let temporary = beside(target)?;
        let _ = std::fs::remove_dir_all(&temporary);
        std::fs::create_dir(&temporary)
            .with_context(|| format!("{} cannot be made", temporary.display()))?;
        Ok(Self {
            temporary,
            target: target.to_owned(),
            done: false,
        })
    }

    /// Path to write to.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// The final name.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Gives it its name.
    ///
    /// # Errors
    /// When the name was taken meanwhile.
    pub fn commit(mut self) -> anyhow::Result<PathBuf> {
        placed(publish::folder(&self.temporary, &self.target), &self.target)?;
        self.done = true;
        Ok(self.target.clone())
    }
}

impl Drop for PendingFolder {
    fn drop(&mut self) {
        if !self.done {
            let _ = std::fs::remove_dir_all(&self.temporary);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_changed_whole_or_not_at_all() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("f.h5");
        let words = |path: &Path| std::fs::read_to_string(path).unwrap();
        std::fs::write(&file, "old").unwrap();
        let refused = change(&file, |copy| {
            std::fs::write(copy, "half")?;
            bail!("no room")
        });
        assert_eq!(refused.unwrap_err().to_string(), "no room");
        assert_eq!(words(&file), "old");
        let done = change(&file, |copy| {
            assert_eq!(words(copy), "old");
            std::fs::write(copy, "new")?;
            assert_eq!(words(&file), "old");
            Ok(())
        });
        done.unwrap();
        assert_eq!(words(&file), "new");
        assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_leftovers_of_ended_processes_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let gone = child.id();
        child.wait().unwrap();
        let own = std::process::id();
        let names = [
            format!(".a.csv.{}-{gone}-0.part", *HOST),
            format!(".b.{}-{gone}-1.part", *HOST),
            format!(".c.csv.{}-{own}-0.part", *HOST),
            format!(".d.csv.00000000-{gone}-0.part"),
            ".e.part".to_owned(),
        ];
        for name in &names {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        std::fs::remove_file(folder.path().join(&names[1])).unwrap();
        std::fs::create_dir_all(folder.path().join(&names[1]).join("x")).unwrap();
        let pending = PendingFile::new(&folder.path().join("f.csv")).unwrap();
        let there = names.map(|name| folder.path().join(name).exists());
        assert_eq!(there, [false, false, true, true, true]);
        drop(pending);
    }

    #[test]
    fn a_file_in_the_way_of_a_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let error = PendingFile::new(&file.join("inner/a.csv")).unwrap_err();
        let error = format!("{error:#}");
        assert!(
            error.contains(&format!("{} is a file", file.display())),
            "{error}"
        );
    }

    #[test]
    fn older_files_are_distinguished_from_concurrent_ones() {
        let folder = tempfile::tempdir().unwrap();
        let (first, second) = (folder.path().join("first"), folder.path().join("second"));
        let kind = |path: &Path| {
            let problem = PendingFile::new(path).unwrap_err();
            matches!(problem.downcast_ref(), Some(AlreadyThere::Before(_)))
        };
        for path in [&first, &second] {
            std::fs::write(path, "").unwrap();
        }
        assert!(kind(&first) && kind(&second));
        // Two inputs lead to it.
        assert!(!kind(&first));
    }
}
