//! Rules that the compiler cannot see: dependencies (`walls`, `circles`), units and paths
//! (`words`), banned words (`banned`), links and sizes of documents (`documents`), the fork
//! of the engine (`vendored`). This file only reads sources.

mod banned;
mod circles;
mod documents;
mod lists;
mod scenario;
mod source;
mod vendored;
mod walls;
mod words;

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the workspace")
        .to_owned()
}

/// The fork of the engine: sources of other authors, which only `vendored` reads.
const FORK: &str = "server/rapier3d";

fn files(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.ends_with(FORK) {
            continue;
        }
        if path.is_dir() {
            files(&path, ending, found);
        } else if path.to_string_lossy().ends_with(ending) {
            found.push(path);
        }
    }
}

fn list(folder: &str, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    files(&root().join(folder), ending, &mut found);
    assert!(!found.is_empty(), "no {ending} below {folder}");
    found
}

/// Lines of a source file that are code, numbered from 1.
fn code(path: &Path) -> Vec<(usize, String)> {
    let text = fs::read_to_string(path).expect("a readable source file");
    let lines = text.lines().enumerate();
    lines
        .map(|(i, line)| {
            (
                i + 1,
                line.split("//").next().unwrap_or_default().to_owned(),
            )
        })
        .collect()
}

/// Folders of the robots that ship.
fn robots() -> Vec<String> {
    let entries = fs::read_dir(root().join("assets/robots")).expect("the robots");
    let folders = entries.flatten().filter(|entry| entry.path().is_dir());
    let mut names: Vec<String> = folders
        .map(|folder| folder.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert!(names.len() > 1, "{names:?}");
    names
}

fn names(line: &str, crate_name: &str) -> bool {
    line.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'))
        .any(|word| word == crate_name || word.starts_with(&format!("{crate_name}::")))
}

/// Lines of a source file that run in the simulation, not in its tests.
fn run_code(path: &Path) -> Vec<(usize, String)> {
    let name = path.to_string_lossy();
    let test = name.contains("/laws/") || name.ends_with("tests.rs") || name.ends_with("laws.rs");
    let lines = if test { Vec::new() } else { code(path) };
    let run = lines.into_iter();
    run.take_while(|(_, text)| !text.trim().ends_with("mod tests {"))
        .collect()
}
