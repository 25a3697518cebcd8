//! Finds the programs of WheelArm.

use std::path::{Path, PathBuf};

use anyhow::Context;

/// Program that serves networks; packages do not contain it.
const LEARN: &str = "wheelarm-learn";

/// Finds a program beside this one, else on PATH.
#[must_use]
pub fn find_program(name: &str) -> Option<PathBuf> {
    let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    let mut programs = folders().into_iter().map(|folder| folder.join(&file));
    programs.find(|program| program.is_file())
}

/// Folders in which programs are looked for: that of this one, and those of PATH.
fn folders() -> Vec<PathBuf> {
    let beside = std::env::current_exe()
        .ok()
        .and_then(|path| path.parent().map(Path::to_path_buf));
    let path = std::env::var_os("PATH").unwrap_or_default();
    beside
        .into_iter()
        .chain(std::env::split_paths(&path))
        .collect()
}

/// Names that follow `prefix` in the names of the programs beside this one and on PATH.
#[must_use]
pub fn programs_named(prefix: &str) -> Vec<String> {
    let mut names = Vec::new();
    for folder in folders() {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        for name in entries.filter_map(|entry| entry.file_name().into_string().ok()) {
            let name = name.strip_suffix(std::env::consts::EXE_SUFFIX);
            let name = name.and_then(|name| name.strip_prefix(prefix));
            // Not what a compiler leaves beside its programs.
            names.extend(name.filter(|name| !name.contains('.')).map(str::to_owned));
        }
    }
    names
}

/// As [`find_program`] for one that must be there.
///
/// # Errors
/// With the fix when it does not exist.
pub fn required_program(name: &str) -> anyhow::Result<PathBuf> {
    find_program(name).with_context(|| {
        let fix = match name {
            LEARN => "packages do not contain it: build it in a checkout with cargo build --release -p wheelarm-learn",
            _ => "install all programs of one version (`wheelarm doctor` lists them), or in a checkout: cargo build --release",
        };
        format!("`{name}` is neither beside this program nor on PATH; {fix}")
    })
}
