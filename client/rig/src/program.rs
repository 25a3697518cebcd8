//! Where the programs of WheelArm lie.

use std::path::{Path, PathBuf};

use anyhow::Context;

/// Finds a program beside this one, else on PATH.
#[must_use]
pub fn find_program(name: &str) -> Option<PathBuf> {
    let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    let beside = std::env::current_exe()
        .ok()
        .and_then(|path| path.parent().map(Path::to_path_buf));
    let path = std::env::var_os("PATH").unwrap_or_default();
    beside
        .into_iter()
        .chain(std::env::split_paths(&path))
        .map(|folder| folder.join(&file))
        .find(|program| program.is_file())
}

/// As [`find_program`] for one that must be there.
///
/// # Errors
/// With the cure when it is not.
pub fn required_program(name: &str) -> anyhow::Result<PathBuf> {
    find_program(name).with_context(|| {
        format!(
            "`{name}` lies neither beside this program nor on PATH; build the workspace first: cargo build --release --workspace"
        )
    })
}
