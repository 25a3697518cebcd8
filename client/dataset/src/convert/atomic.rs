//! Files and folders that are made under another name and renamed when they
//! are whole; an existing one is never replaced.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, bail};

use crate::publish;

/// Counts what was made under another name.
static MADE: AtomicU64 = AtomicU64::new(0);

fn beside(target: &Path) -> anyhow::Result<PathBuf> {
    if target.symlink_metadata().is_ok() {
        bail!(
            "{} exists already and is never overwritten: move it away or choose another place with --out",
            target.display()
        );
    }
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{} cannot be made", folder.display()))?;
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    // Two inputs may lead to one name at the same time: the first keeps it.
    let (process, count) = (std::process::id(), MADE.fetch_add(1, Ordering::Relaxed));
    Ok(folder.join(format!(".{name}.{process}-{count}.part")))
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

    /// Where to write.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// Makes it durable and gives it its name.
    ///
    /// # Errors
    /// When the name was taken meanwhile.
    pub fn commit(mut self) -> anyhow::Result<PathBuf> {
        publish::file(&self.temporary, &self.target).with_context(|| not_in_place(&self.target))?;
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

fn not_in_place(target: &Path) -> String {
    let target = target.display();
    format!(
        "{target} cannot be put in place; where it exists, another recording of the same label, \
         or another export, has written it meanwhile: say another --out for one of them"
    )
}

/// A folder that is not there yet.
#[derive(Debug)]
pub struct PendingFolder {
    temporary: PathBuf,
    target: PathBuf,
    done: bool,
}

impl PendingFolder {
    /// Makes a folder to fill for `target`.
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

    /// Where to write.
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
        publish::folder(&self.temporary, &self.target)
            .with_context(|| not_in_place(&self.target))?;
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
