//! The fork of the engine in `server/rapier3d`: the released crate and one patch, nothing
//! else. Its sources keep the language of their authors: the other rules skip it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::{FORK, files, root};

/// Lines of a file of the fork that are neither empty nor comments.
fn lines(name: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(FORK).join(name)).expect(name);
    let lines = text
        .lines()
        .filter(|l| !l.is_empty() && !l.starts_with('#'));
    lines.map(str::to_owned).collect()
}

/// SHA-256 of each file of the released crate, by its path.
fn released() -> BTreeMap<String, String> {
    let lines = lines("upstream.sha256").into_iter().map(|line| {
        let (hash, path) = line.split_once("  ").expect("a hash and a path");
        (path.to_owned(), hash.to_owned())
    });
    lines.collect()
}

fn hash(text: &str) -> String {
    let bytes = Sha256::digest(text.as_bytes());
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The lines of a file and of its predecessor, from one hunk of a patch.
struct Hunk {
    /// First line of the new file, from 0.
    start: usize,
    old: Vec<String>,
    new: Vec<String>,
}

/// The hunks of a unified diff, by the path of the new file.
fn patch() -> BTreeMap<String, Vec<Hunk>> {
    let text = fs::read_to_string(root().join(FORK).join("upstream.patch"));
    let text = text.expect("upstream.patch");
    let mut found: BTreeMap<String, Vec<Hunk>> = BTreeMap::new();
    let mut path = String::new();
    for line in text.split_terminator('\n') {
        if let Some(name) = line.strip_prefix("+++ b/") {
            name.clone_into(&mut path);
            found.entry(path.clone()).or_default();
            continue;
        }
        if line.starts_with("--- ") || line.starts_with("diff ") || path.is_empty() {
            continue;
        }
        let hunks = found.get_mut(&path).expect("a file before its hunks");
        if let Some(range) = line.strip_prefix("@@ ") {
            let new = range.split(' ').nth(1).expect("a range of the new file");
            let start = new.trim_start_matches('+').split(',').next();
            let start: usize = start.and_then(|s| s.parse().ok()).expect("a line");
            hunks.push(Hunk {
                start: start.saturating_sub(1),
                old: Vec::new(),
                new: Vec::new(),
            });
            continue;
        }
        let Some(hunk) = hunks.last_mut() else {
            continue;
        };
        let (mark, content) = line.split_at(line.len().min(1));
        if mark != "+" {
            hunk.old.push(content.to_owned());
        }
        if mark != "-" {
            hunk.new.push(content.to_owned());
        }
    }
    found
}

/// The file before the patch; an error names the first line that is not the patch's.
fn before(text: &str, hunks: &[Hunk]) -> Result<String, usize> {
    if hunks.is_empty() {
        return Ok(text.to_owned());
    }
    let new: Vec<&str> = text.split_terminator('\n').collect();
    let (mut old, mut at) = (Vec::new(), 0);
    for hunk in hunks {
        let end = hunk.start + hunk.new.len();
        let is_there = at <= hunk.start && new.get(hunk.start..end).is_some_and(|n| n == hunk.new);
        if !is_there {
            return Err(hunk.start + 1);
        }
        old.extend(new[at..hunk.start].iter().map(|line| (*line).to_owned()));
        old.extend(hunk.old.iter().cloned());
        at = end;
    }
    old.extend(new[at..].iter().map(|line| (*line).to_owned()));
    Ok(old.iter().map(|line| format!("{line}\n")).collect())
}

#[test]
fn a_patch_is_taken_back() {
    let hunks = [Hunk {
        start: 1,
        old: vec!["b".to_owned()],
        new: vec!["x".to_owned(), "y".to_owned()],
    }];
    assert_eq!(before("a\nx\ny\nc\n", &hunks), Ok("a\nb\nc\n".to_owned()));
    assert_eq!(before("a\nx\nz\nc\n", &hunks), Err(2));
}

#[test]
fn the_fork_of_the_engine_is_the_released_crate_and_its_patch() {
    let folder = root().join(FORK);
    let (released, patch) = (released(), patch());
    let mut found = Vec::new();
    files(&folder.join("src"), "", &mut found);
    let paths: BTreeSet<String> = found
        .iter()
        .map(|path: &PathBuf| path.strip_prefix(&folder).expect("below the fork"))
        .map(|path: &Path| path.to_string_lossy().into_owned())
        .collect();
    assert!(released.len() > 200, "{} files", released.len());
    let mut complaints = Vec::new();
    for path in released.keys().filter(|path| !paths.contains(*path)) {
        complaints.push(format!("{path} is missing"));
    }
    for path in &paths {
        let text = fs::read_to_string(folder.join(path)).expect("a source");
        let hunks = patch.get(path).map_or(&[][..], Vec::as_slice);
        match (before(&text, hunks), released.get(path)) {
            (Err(line), _) => complaints.push(format!("{path}:{line} is not as the patch has it")),
            (Ok(old), Some(expected)) if hash(&old) != *expected => {
                complaints.push(format!("{path} differs from the released file"));
            }
            (Ok(old), None) if hunks.is_empty() || !old.is_empty() => {
                complaints.push(format!("{path} is neither released nor in the patch"));
            }
            _ => {}
        }
    }
    let page = fs::read_to_string(folder.join("PATCH.md")).expect("PATCH.md");
    for path in patch.keys() {
        if !paths.contains(path) {
            complaints.push(format!(
                "upstream.patch changes {path}, which does not exist"
            ));
        }
        if !page.contains(&format!("| `{path}` |")) {
            complaints.push(format!("PATCH.md does not name {path}"));
        }
    }
    assert!(
        complaints.is_empty(),
        "{FORK}: change the released crate by upstream.patch only, see PATCH.md\n{}",
        complaints.join("\n")
    );
}

/// Cargo ignores a patch whose version does not fit, with no more than a warning.
#[test]
fn the_engine_is_the_fork() {
    let lock = fs::read_to_string(root().join("Cargo.lock")).expect("a lock");
    let packages = lock.split("[[package]]");
    let engines: Vec<&str> = packages
        .filter(|package| package.contains("name = \"rapier3d\"\n"))
        .collect();
    assert_eq!(engines.len(), 1, "{engines:?}");
    assert!(
        engines[0].contains("version = \"0.36.1\""),
        "{}",
        engines[0]
    );
    assert!(!engines[0].contains("source ="), "{}", engines[0]);
}
