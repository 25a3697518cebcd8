//! Which files are meant and where results go.

use std::path::{Path, PathBuf};

use anyhow::bail;
use wheelarm_dataset::align::AlignOptions;
use wheelarm_dataset::convert::{ReadOptions, batch};
use wheelarm_dataset::label::Corrections;

use super::arguments::{Files, Input};

/// Recordings named directly or found in folders, in the order of their names;
/// aligned files are no recordings.
pub fn recordings(files: &Files) -> anyhow::Result<Vec<PathBuf>> {
    let mut out = Vec::new();
    for path in &files.files {
        if path.is_dir() {
            let mut inside: Vec<PathBuf> = std::fs::read_dir(path)?
                .filter_map(|entry| Some(entry.ok()?.path()))
                .filter(|p| {
                    let name = p.file_name().unwrap_or_default().to_string_lossy();
                    name.ends_with(".h5")
                        && !name.ends_with(".aligned.h5")
                        && !name.starts_with('.')
                })
                .collect();
            if inside.is_empty() {
                bail!("{} holds no episode file (*.h5)", path.display());
            }
            inside.sort();
            out.extend(inside);
        } else {
            out.push(path.clone());
        }
    }
    Ok(out)
}

/// Files at once.
pub fn jobs(files: &Files) -> usize {
    files.jobs.unwrap_or_else(batch::threads).max(1)
}

/// How the recordings are read.
pub fn options(input: &Input) -> anyhow::Result<ReadOptions> {
    let corrections = match &input.corrections {
        Some(path) => Corrections::read(path)?,
        None => Corrections::default(),
    };
    Ok(ReadOptions {
        align: AlignOptions {
            reference: input.reference.clone(),
            limits: input.limits.iter().cloned().collect(),
            interpolation: input.interpolation,
        },
        corrections,
    })
}

/// `LABEL.ending` beside the recording or in a folder.
pub fn beside(file: &Path, out: Option<&Path>, ending: &str) -> PathBuf {
    let name = file.with_extension(ending);
    match (out, name.file_name()) {
        (Some(folder), Some(name)) => folder.join(name),
        _ => name,
    }
}
