//! World packs of a recording, unpacked for the server of a replay: it needs no folder of
//! packs.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use tempfile::TempDir;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::keys::check_name;
use wheelarm_proto::v1;

/// Writes the packs of the recording at `file` as NAME.zip into the folder `out` and returns
/// the files.
///
/// # Errors
/// When the recording is damaged or has no packs, or a file exists or cannot be written.
pub fn extract_packs(file: &Path, out: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let packs = Episode::open(file)?.packs()?;
    if packs.is_empty() {
        bail!(
            "{} has no world packs: it was made in a scene of the assets",
            file.display()
        );
    }
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    write(packs, out)
}

fn write(packs: Vec<v1::PackFile>, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut written = Vec::new();
    for file in packs {
        let name = file.pack.unwrap_or_default().name;
        check_name(&name)?;
        let path = folder.join(format!("{name}.zip"));
        // Never over another file.
        std::fs::File::create_new(&path)
            .and_then(|mut new| new.write_all(&file.zip))
            .with_context(|| format!("cannot write {}", path.display()))?;
        written.push(path);
    }
    Ok(written)
}

/// The packs of a recording in a folder that is removed when this is dropped.
#[derive(Default)]
pub(crate) struct RecordedPacks(Option<TempDir>);

impl RecordedPacks {
    /// Writes the packs of an episode as zip files; the server checks their digests.
    ///
    /// # Errors
    /// When the file is damaged, or a pack cannot be written.
    pub fn unpack(episode: &Episode) -> anyhow::Result<Self> {
        let packs = episode.packs()?;
        if packs.is_empty() {
            return Ok(Self(None));
        }
        let folder = tempfile::Builder::new()
            .prefix("wheelarm-packs-")
            .tempdir()
            .context("cannot make a folder for the recorded world packs")?;
        write(packs, folder.path())?;
        Ok(Self(Some(folder)))
    }

    /// Folders for the server: that of these packs, then `others`.
    pub fn before(&self, others: &[PathBuf]) -> Vec<PathBuf> {
        let own = self.0.iter().map(|folder| folder.path().to_owned());
        own.chain(others.iter().cloned()).collect()
    }
}
