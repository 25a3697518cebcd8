//! Writes a pack beside others; a pack of the same name is replaced as a whole.

use std::path::{Path, PathBuf};

use wheelarm_pack::Pack;

use crate::error::ImportError;

/// Writes the pack as `folder/NAME` and returns that path. A pack that is already there is
/// replaced: the new one is complete before the former is removed.
///
/// # Errors
/// When a file or a folder that is not a pack has the name, or when a file cannot be written.
pub fn write(pack: &Pack, folder: &Path) -> Result<PathBuf, ImportError> {
    let name = &pack.id().name;
    let target = folder.join(name);
    let unwritable = |path: &Path, reason: String| ImportError::Unwritable {
        path: path.display().to_string(),
        reason,
    };
    let is_there = target.symlink_metadata().is_ok();
    if is_there && !target.join("pack.toml").is_file() {
        return Err(unwritable(
            &target,
            "it exists and is not a pack; remove it, or choose another --name or --out".into(),
        ));
    }
    let beside = |word: &str| folder.join(format!(".{name}-{word}-{}", std::process::id()));
    let (new, old) = (beside("new"), beside("old"));
    let io = |path: &Path| {
        let path = path.to_owned();
        move |error: std::io::Error| unwritable(&path, error.to_string())
    };
    let result = pack
        .write_folder(&new)
        .map_err(|error| unwritable(&new, error.to_string()))
        .and_then(|()| {
            if is_there {
                std::fs::rename(&target, &old).map_err(io(&target))?;
            }
            std::fs::rename(&new, &target).map_err(io(&target))
        });
    if result.is_err() {
        // What is left of an unfinished pack; the first error is reported.
        let _ = std::fs::remove_dir_all(&new);
    }
    result?;
    if is_there {
        std::fs::remove_dir_all(&old).map_err(io(&old))?;
    }
    Ok(target)
}
