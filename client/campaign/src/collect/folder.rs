//! The dataset's folder: where a file is made, how it gets its final name, and the
//! leftovers of a killed run.
//!
//! | path | what |
//! |---|---|
//! | `plan.toml` | the plan |
//! | `episodes/ID.h5` | finished, successful, complete episodes and nothing else |
//! | `journal/*.jsonl` | entries of finished and failed attempts, append-only |
//! | `staging/ID/` | an episode while it is made |
//! | `failed/ID-attempt-K/` | output of the programs in failed attempts; `-2` and so on for repeated attempts |
//! | `failed_episodes/ID-attempt-K.h5` | recordings of attempts that failed at the task, where the plan keeps them |
//! | `failed/ID-not-in-journal.h5` | a file whose entry in the journal was lost in a power cut |
//! | `manifest.json`, `report.md`, `README.md` | made from the journals at the end |
//!
//! A file appears under its final name in one step and never replaces another.

use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow, bail};
use sha2::{Digest, Sha256};
use wheelarm_dataset::publish;
use wheelarm_options::choice::make_folder;

use super::episode::Shard;
use super::journal::Done;
use wheelarm_rollout::launcher::remove_socket;

/// Folder of the kept recordings of failed attempts.
const FAILED_EPISODES: &str = "failed_episodes";

/// Name of the note in a staging folder with the entry of the file to publish.
const RESULT: &str = "result.json";

/// A dataset's folder.
#[derive(Clone, Debug)]
pub struct Folder {
    root: PathBuf,
    /// Folder of running recordings; the staging folders when absent.
    scratch: Option<Scratch>,
}

/// A folder for recordings under way, and the lock by which it is one run's alone.
#[derive(Clone, Debug)]
struct Scratch {
    folder: PathBuf,
    _lock: Arc<File>,
}

impl Folder {
    /// The folder at `root`; nothing is made.
    #[must_use]
    pub fn at(root: &Path) -> Self {
        Self {
            root: root.to_owned(),
            scratch: None,
        }
    }

    /// The same with running recordings in a folder of `scratch` that belongs to this
    /// dataset and shard. Leftovers of a killed run are removed, because their episodes are
    /// repeated.
    ///
    /// # Errors
    /// When the folder cannot be made, or another run uses it.
    pub fn with_scratch(self, scratch: &Path, shard: Shard) -> anyhow::Result<Self> {
        let making = || format!("making a folder in --scratch {}", scratch.display());
        let root = std::path::absolute(&self.root).with_context(making)?;
        let root = root.canonicalize().unwrap_or(root);
        let digest = Sha256::digest(format!("{} {shard}", root.display()));
        let name: String = digest.iter().take(8).map(|b| format!("{b:02x}")).collect();
        let scratch = std::path::absolute(scratch).with_context(making)?;
        let own = scratch.join(format!("wheelarm-collect-{name}"));
        std::fs::create_dir_all(&scratch).with_context(making)?;
        // Beside the folder, which is removed at the end.
        let lock = own.with_extension("lock");
        let lock = File::create(&lock).with_context(|| format!("making {}", lock.display()))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!(
                "another `wheelarm collect` has {}; wait for its end, or use another --scratch",
                own.display()
            ),
            Err(TryLockError::Error(e)) => {
                tracing::warn!(
                    "{} cannot be locked ({e}); make sure that no other host uses this --scratch",
                    own.display()
                );
            }
        }
        let own = Scratch {
            folder: own,
            _lock: Arc::new(lock),
        };
        remove(&own.folder)?;
        Ok(Self {
            scratch: Some(own),
            ..self
        })
    }

    /// Folder of the running recording of an episode, if it is not its staging folder.
    #[must_use]
    pub fn scratch(&self, episode: &str) -> Option<PathBuf> {
        let scratch = self.scratch.as_ref();
        scratch.map(|scratch| scratch.folder.join(episode))
    }

    /// The folder of all of them.
    #[must_use]
    pub fn all_scratch(&self) -> Option<&Path> {
        self.scratch.as_ref().map(|scratch| &*scratch.folder)
    }

    /// Removes the folder for running recordings after their end. A failure only costs
    /// disk space.
    pub fn clear_scratch(&self) {
        if let Some(scratch) = &self.scratch {
            let lock = scratch.folder.with_extension("lock");
            let removed = remove(&scratch.folder).and_then(|()| Ok(std::fs::remove_file(lock)?));
            if let Err(problem) = removed {
                tracing::warn!("{problem:#}; it can be deleted");
            }
        }
    }

    /// Makes what is absent.
    ///
    /// # Errors
    /// When a folder cannot be made.
    pub fn make(root: &Path) -> anyhow::Result<Self> {
        let folder = Self::at(root);
        for part in ["episodes", "journal", "staging", "failed"] {
            make_folder(&folder.root.join(part))?;
        }
        Ok(folder)
    }

    /// Its path.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The journals.
    #[must_use]
    pub fn journal(&self) -> PathBuf {
        self.root.join("journal")
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> PathBuf {
        self.root.join("plan.toml")
    }

    /// The file of an episode, relative to the root.
    #[must_use]
    pub fn file_name(episode: &str) -> String {
        format!("episodes/{episode}.h5")
    }

    /// The file of an episode.
    #[must_use]
    pub fn file(&self, episode: &str) -> PathBuf {
        self.root.join(Self::file_name(episode))
    }

    /// Keeps the text of the plan beside the data.
    ///
    /// # Errors
    /// When the disk does not accept it.
    pub fn keep_plan(&self, text: &str) -> anyhow::Result<()> {
        let kept = std::fs::read_to_string(self.plan());
        match kept.is_ok_and(|kept| kept == text) {
            true => Ok(()),
            false => write_whole(&self.plan(), text.as_bytes()),
        }
    }

    /// Staging folder of an episode.
    #[must_use]
    pub fn staging(&self, episode: &str) -> PathBuf {
        self.root.join("staging").join(episode)
    }

    /// An empty staging folder for an episode.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn stage(&self, episode: &str) -> anyhow::Result<PathBuf> {
        self.clean(episode)?;
        let path = self.staging(episode);
        std::fs::create_dir_all(&path)
            .with_context(|| format!("making the folder {}", path.display()))?;
        Ok(path)
    }

    /// Removes an episode's staging folder.
    ///
    /// # Errors
    /// When it exists and cannot be removed.
    pub fn clean(&self, episode: &str) -> anyhow::Result<()> {
        let path = self.staging(episode);
        remove_socket(&path);
        remove(&path)?;
        self.scratch(episode).map_or(Ok(()), |path| remove(&path))
    }

    /// Gives the staged file of an episode its final name. `done` is noted
    /// first, so that a crash in between is finished by [`Folder::resume`].
    ///
    /// # Errors
    /// When a file of that name exists, or the disk does not accept it.
    pub fn publish(&self, done: &Done) -> anyhow::Result<()> {
        let staging = self.staging(&done.episode);
        write_whole(&staging.join(RESULT), &serde_json::to_vec(done)?)?;
        let staged = staging.join(format!("{}.h5", done.episode));
        move_file(&staged, &self.file(&done.episode))
    }

    /// Result of an episode that a killed run finished but did not enter into a journal; the
    /// file has its final name afterwards. `None` without a usable file.
    ///
    /// # Errors
    /// When a file cannot be read or named.
    pub fn resume(&self, episode: &str) -> anyhow::Result<Option<Done>> {
        let staging = self.staging(episode);
        let Ok(note) = std::fs::read(staging.join(RESULT)) else {
            return Ok(None);
        };
        let Ok(done) = serde_json::from_slice::<Done>(&note) else {
            return Ok(None);
        };
        let file = self.file(episode);
        if file.is_file() {
            return Ok((sha256(&file)? == done.sha256).then_some(done));
        }
        let staged = staging.join(format!("{episode}.h5"));
        if done.episode != episode || !staged.is_file() || sha256(&staged)? != done.sha256 {
            return Ok(None);
        }
        move_file(&staged, &file)?;
        Ok(Some(done))
    }

    /// Keeps the output of the programs of a failed attempt and removes its recording.
    ///
    /// # Errors
    /// When the folder cannot be moved.
    pub fn keep_failed(&self, episode: &str, attempt: u32) -> anyhow::Result<()> {
        let staging = self.staging(episode);
        for entry in std::fs::read_dir(&staging)
            .with_context(|| format!("reading {}", staging.display()))?
            .flatten()
        {
            let path = entry.path();
            if path.extension().is_none_or(|e| e != "log") {
                std::fs::remove_file(&path)
                    .with_context(|| format!("removing {}", path.display()))?;
            }
        }
        let name = format!("failed/{episode}-attempt-{attempt}");
        // The same attempt is repeated after a server's death.
        let kept = free(&self.root.join(name), "");
        std::fs::rename(&staging, &kept).with_context(|| format!("making {}", kept.display()))?;
        let scratch = self.scratch(episode);
        scratch.map_or(Ok(()), |scratch| remove(&scratch))
    }

    /// Moves the recording of a failed attempt to `failed_episodes/`; its new path,
    /// relative to the root.
    ///
    /// # Errors
    /// When it cannot be moved.
    pub fn keep_recording(&self, file: &Path, name: &str) -> anyhow::Result<String> {
        let folder = self.root.join(FAILED_EPISODES);
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("making the folder {}", folder.display()))?;
        let kept = free(&folder.join(name), ".h5");
        move_file(file, &kept)?;
        let stem = kept.file_name().unwrap_or_default().to_string_lossy();
        Ok(format!("{FAILED_EPISODES}/{stem}"))
    }

    /// Moves recordings of failed attempts at `episodes` to `failed/` that are not
    /// among the `listed` ones, relative to the root; their new paths.
    ///
    /// # Errors
    /// When one cannot be moved.
    pub fn set_orphans_aside<'a>(
        &self,
        episodes: impl Iterator<Item = &'a str>,
        listed: &[&str],
    ) -> anyhow::Result<Vec<PathBuf>> {
        let episodes: Vec<&str> = episodes.collect();
        let kept = std::fs::read_dir(self.root.join(FAILED_EPISODES));
        let mut moved = Vec::new();
        for entry in kept.into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_mine = name
                .rsplit_once("-attempt-")
                .is_some_and(|(episode, _)| episodes.contains(&episode));
            if !is_mine || listed.contains(&format!("{FAILED_EPISODES}/{name}").as_str()) {
                continue;
            }
            let stem = name.strip_suffix(".h5").unwrap_or(&name);
            let aside = self.root.join(format!("failed/{stem}-not-in-journal"));
            let aside = free(&aside, ".h5");
            move_file(&entry.path(), &aside)?;
            moved.push(aside);
        }
        Ok(moved)
    }

    /// Moves the file of an episode that no journal knows out of the dataset; its
    /// new path.
    ///
    /// # Errors
    /// When it cannot be moved.
    pub fn set_aside(&self, episode: &str) -> anyhow::Result<PathBuf> {
        let name = format!("failed/{episode}-not-in-journal");
        let aside = free(&self.root.join(name), ".h5");
        move_file(&self.file(episode), &aside)?;
        Ok(aside)
    }
}

/// A path that does not exist: `path`, else `path-2` and so on before its `ending`.
fn free(path: &Path, ending: &str) -> PathBuf {
    let numbered = (1..).map(|number| match number {
        1 => format!("{}{ending}", path.display()),
        _ => format!("{}-{number}{ending}", path.display()),
    });
    let mut paths = numbered.map(PathBuf::from);
    paths.find(|path| !path.exists()).unwrap_or_default()
}

/// Gives `from` the name `to` in one step; an existing file is never replaced.
///
/// # Errors
/// When `to` exists or the file system refuses.
pub fn move_file(from: &Path, to: &Path) -> anyhow::Result<()> {
    publish::file(from, to)
        .map(drop)
        .map_err(|problem| match problem.kind() {
            ErrorKind::AlreadyExists => anyhow!(
                "{} exists already and is never overwritten; no journal has an entry for it, move it away",
                to.display()
            ),
            _ => anyhow!("making {}: {problem}", to.display()),
        })
}

/// Writes a file atomically.
///
/// # Errors
/// When the disk does not accept it.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let new = path.with_extension(format!("new-{}", std::process::id()));
    let written = File::create(&new)
        .and_then(|mut file| {
            file.write_all(bytes)
                .and_then(|()| publish::sync_file(&file))
        })
        .and_then(|()| std::fs::rename(&new, path));
    written.with_context(|| format!("writing {}", path.display()))?;
    publish::settle(path);
    Ok(())
}

/// SHA-256 of a file, hexadecimal.
///
/// # Errors
/// When it cannot be read.
pub fn sha256(path: &Path) -> anyhow::Result<String> {
    use std::fmt::Write;
    let mut hash = Sha256::new();
    let mut file = File::open(path).with_context(|| format!("opening {}", path.display()))?;
    let mut block = vec![0; 1 << 20];
    loop {
        let read = file
            .read(&mut block)
            .with_context(|| format!("reading {}", path.display()))?;
        if read == 0 {
            break;
        }
        hash.update(&block[..read]);
    }
    let mut text = String::new();
    for byte in hash.finalize() {
        // Writing into a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}

/// Removes a folder, if it exists.
fn remove(path: &Path) -> anyhow::Result<()> {
    match std::fs::remove_dir_all(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => {
            Err(e).with_context(|| format!("removing {}", path.display()))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn done(sha256: String) -> Done {
        Done {
            episode: "a-0000".into(),
            task: "a".into(),
            attempt: 0,
            seed: 0,
            settings: String::new(),
            file: Folder::file_name("a-0000"),
            sha256,
            bytes: 3,
            success: true,
            instruction: String::new(),
            seconds: 1.0,
            wall_seconds: 1.0,
            counts: BTreeMap::new(),
            missed: 0,
            finished_unix_millis: 0,
            target_in_first_images: None,
            origin: Default::default(),
            scenario: serde_json::Value::Null,
        }
    }

    #[test]
    fn kill_during_publication_neither_loses_nor_duplicates_a_file() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::make(root.path()).unwrap();
        let staged = folder.stage("a-0000").unwrap().join("a-0000.h5");
        std::fs::write(&staged, "abc").unwrap();
        assert_eq!(folder.resume("a-0000").unwrap(), None, "before the note");
        let note = done(sha256(&staged).unwrap());
        let result = staged.with_file_name(RESULT);
        write_whole(&result, &serde_json::to_vec(&note).unwrap()).unwrap();
        // Killed after the note; then after the file has its name.
        assert_eq!(folder.resume("a-0000").unwrap(), Some(note.clone()));
        assert_eq!(folder.resume("a-0000").unwrap(), Some(note.clone()));
        assert_eq!(std::fs::read(folder.file("a-0000")).unwrap(), b"abc");
        // A foreign file of that name is neither accepted nor replaced.
        std::fs::write(folder.file("a-0000"), "foreign").unwrap();
        std::fs::write(&staged, "abc").unwrap();
        assert_eq!(folder.resume("a-0000").unwrap(), None);
        assert!(folder.publish(&note).is_err());
        assert_eq!(std::fs::read(folder.file("a-0000")).unwrap(), b"foreign");
    }

    #[test]
    fn hashes_are_sha_256() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("x");
        std::fs::write(&file, "abc").unwrap();
        let hash = sha256(&file).unwrap();
        assert!(
            hash.starts_with("ba7816bf8f01cfea") && hash.len() == 64,
            "{hash}"
        );
    }
}
