//! Selects input files and output paths.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::bail;
use wheelarm_dataset::align::AlignOptions;
use wheelarm_dataset::convert::{ReadOptions, batch};
use wheelarm_dataset::label::Corrections;
use wheelarm_dataset::read::Episode;

use super::arguments::{Files, Input};

/// Ending of labelled copies.
const LABELLED: &str = ".labels.h5";

/// Recordings named directly or found in folders, in the order of their names;
/// aligned files are not recordings, and a labelled copy counts only where its
/// recording is not beside it.
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
            leave_copies_out(&mut inside);
            if inside.is_empty() {
                bail!("{}", without_episodes(path));
            }
            inside.sort();
            out.extend(inside);
        } else {
            out.push(path.clone());
        }
    }
    out.retain(|file| !files.left_out.contains(file));
    Ok(out)
}

/// Rejects an image path without a `.png` extension: an image replaces the existing
/// file, and a typo would destroy a recording.
pub fn check_image_path(out: &Path) -> anyhow::Result<()> {
    let is_png = out
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    if !is_png {
        bail!(
            "{}: an image is written as PNG: name it *.png",
            out.display()
        );
    }
    Ok(())
}

/// Leaves out labelled copies whose recording is present.
fn leave_copies_out(files: &mut Vec<PathBuf>) {
    let all: BTreeSet<PathBuf> = files.iter().cloned().collect();
    files.retain(|file| {
        let name = file.to_string_lossy();
        let recording = name.strip_suffix(LABELLED).map(|stem| format!("{stem}.h5"));
        recording.is_none_or(|recording| !all.contains(Path::new(&recording)))
    });
}

/// Why a folder has no input files, with the fix.
fn without_episodes(folder: &Path) -> String {
    let episodes = folder.join("episodes");
    if episodes.is_dir() {
        return format!(
            "{} is the folder of a campaign; its episodes are in {}: name that folder",
            folder.display(),
            episodes.display()
        );
    }
    format!(
        "{} contains no episode file (*.h5): name recordings, or a folder with some",
        folder.display()
    )
}

/// Files at once.
pub fn jobs(files: &Files) -> usize {
    files.jobs.unwrap_or_else(batch::threads)
}

/// Options for reading the recordings `files`.
pub fn options(input: &Input, files: &[PathBuf]) -> anyhow::Result<ReadOptions> {
    let corrections = match &input.corrections {
        Some(path) => Corrections::read(path)?,
        None => Corrections::default(),
    };
    // A process of an export has some of the files, all of which were checked before.
    if !corrections.is_empty() && !super::parts::is_one() {
        check_episodes(&corrections, files.iter().chain(&input.files.left_out))?;
    }
    Ok(ReadOptions {
        align: AlignOptions {
            reference: input.reference.clone(),
            limits: input.limits.iter().cloned().collect(),
            interpolation: input.interpolation,
        },
        corrections,
    })
}

/// Rejects corrections of an episode that is neither among the files nor beside one of
/// them: a misspelt name would leave the labels as they were.
fn check_episodes<'a>(
    corrections: &Corrections,
    files: impl Iterator<Item = &'a PathBuf>,
) -> anyhow::Result<()> {
    let (mut labels, mut folders) = (BTreeSet::new(), BTreeSet::new());
    for file in files {
        // A file that cannot be read is reported by the work itself.
        let label = Episode::open(file).and_then(|episode| episode.label()).ok();
        labels.extend(label);
        let stem = file.file_stem().unwrap_or_default();
        labels.insert(stem.to_string_lossy().into_owned());
        folders.insert(file.parent().unwrap_or(Path::new("")).to_owned());
    }
    let is_beside = |label: &str| {
        let name = format!("{label}.h5");
        folders.iter().any(|folder| folder.join(&name).is_file())
    };
    corrections.check_episodes(|label| labels.contains(label) || is_beside(label))
}

/// `LABEL.ending` beside the recording or in a folder.
pub fn beside(file: &Path, out: Option<&Path>, ending: &str) -> PathBuf {
    let name = file.with_extension(ending);
    match (out, name.file_name()) {
        (Some(folder), Some(name)) => folder.join(name),
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(folder: &Path) -> anyhow::Result<Vec<String>> {
        let files = Files {
            files: vec![folder.to_owned()],
            jobs: None,
            left_out: Vec::new(),
        };
        let names = recordings(&files)?.into_iter().map(|file| {
            let name = file.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        });
        Ok(names.collect())
    }

    #[test]
    fn a_labelled_copy_beside_its_recording_is_not_a_second_episode() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.h5", "a.labels.h5", "a.aligned.h5", "b.labels.h5"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(found(folder.path()).unwrap(), ["a.h5", "b.labels.h5"]);
    }

    #[test]
    fn the_folder_of_a_campaign_names_that_of_its_episodes() {
        let folder = tempfile::tempdir().unwrap();
        let error = || found(folder.path()).unwrap_err().to_string();
        assert!(error().contains("contains no episode file"), "{}", error());
        let episodes = folder.path().join("episodes");
        std::fs::create_dir(&episodes).unwrap();
        let fix = format!("are in {}: name that folder", episodes.display());
        assert!(error().ends_with(&fix), "{}", error());
    }
}
