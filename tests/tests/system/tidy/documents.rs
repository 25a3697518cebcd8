//! Documents: links, indexes, sizes, and sentences of at most 25 words.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::root;

/// Folders without sources, at any depth.
const BUILT: [&str; 3] = ["target", "node_modules", "__pycache__"];

/// Folders at the root without sources: recordings and packages.
const OUTPUT: [&str; 2] = ["data", "dist"];

/// Files below a folder, without hidden and built ones, in order.
pub(super) fn tree(folder: &Path, keep: &dyn Fn(&Path) -> bool, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let output = OUTPUT.iter().any(|output| path == root().join(output));
        let skipped = BUILT.contains(&&*name) || output || path.ends_with(super::FORK);
        if name.starts_with('.') || skipped || path.is_symlink() {
            continue;
        }
        if path.is_dir() {
            tree(&path, keep, found);
        } else if keep(&path) {
            found.push(path);
        }
    }
}

/// Every Markdown file of the repository.
pub(super) fn documents() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let is_document = |path: &Path| path.extension().is_some_and(|e| e == "md");
    tree(&root(), &is_document, &mut found);
    assert!(found.len() > 40, "{} documents", found.len());
    found
}

/// A path relative to the repository, for messages.
pub(super) fn place(path: &Path) -> String {
    let path = path.strip_prefix(root()).unwrap_or(path);
    path.to_string_lossy().into_owned()
}

/// The text of a document without code blocks, line by line.
pub(super) fn without_blocks(text: &str) -> String {
    let mut inside = false;
    let lines = text.lines().map(|line| {
        let fence = line.trim_start().starts_with("```");
        inside ^= fence;
        if inside || fence { "" } else { line }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Prose of a document: no code blocks, no inline code, no targets of links.
pub(super) fn prose(text: &str) -> String {
    let text = without_blocks(text);
    let lines = text.lines().map(|line| {
        let parts = line.split('`').enumerate();
        let kept = parts.map(|(i, part)| if i % 2 == 0 { part } else { "CODE" });
        let line = kept.collect::<String>();
        let mut out = String::new();
        let mut rest = line.as_str();
        while let Some((before, after)) = rest.split_once("](") {
            out.push_str(before);
            rest = after.split_once(')').map_or("", |(_, rest)| rest);
        }
        out + rest
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Targets of the links of a document.
fn targets(text: &str) -> Vec<String> {
    let text = without_blocks(text);
    let parts = text.split("](").skip(1);
    parts
        .filter_map(|part| part.split(')').next())
        .map(str::to_owned)
        .collect()
}

/// The anchor of a heading, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let kept = heading
        .chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

fn anchors(path: &Path) -> BTreeSet<String> {
    let text = without_blocks(&fs::read_to_string(path).unwrap_or_default());
    let headings = text.lines().filter(|line| line.starts_with('#'));
    headings
        .map(|line| anchor(line.trim_start_matches('#').trim()))
        .collect()
}

#[test]
fn links_of_documents_name_existing_files_and_headings() {
    let mut broken = Vec::new();
    for path in documents() {
        let text = fs::read_to_string(&path).expect("a document");
        for target in targets(&text) {
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let (file, heading) = target.split_once('#').unwrap_or((&target, ""));
            let file = match file {
                "" => path.clone(),
                file => path.parent().expect("a folder").join(file),
            };
            let has_heading = heading.is_empty() || anchors(&file).contains(heading);
            if !file.exists() || !has_heading {
                broken.push(format!("{}: {target}", place(&path)));
            }
        }
    }
    assert!(broken.is_empty(), "broken links:\n{}", broken.join("\n"));
}

/// Largest size of the documents at the root, bytes.
const SIZES: [(&str, u64); 4] = [
    ("README.md", 8 << 10),
    ("ARCHITECTURE.md", 15 << 10),
    ("CHANGELOG.md", 16 << 10),
    ("CONTRIBUTING.md", 9 << 10),
];

/// Largest size of a decision, bytes: one page.
const DECISION: u64 = 3 << 10;

/// Largest size of all images of the documents, bytes.
const IMAGES: u64 = 9_000_000;

fn size(path: &Path) -> u64 {
    fs::metadata(path).expect("a file").len()
}

#[test]
fn documents_keep_their_sizes() {
    for (name, most) in SIZES {
        let size = size(&root().join(name));
        assert!(size <= most, "{name} has {size} bytes, at most {most}");
    }
    let mut decisions = Vec::new();
    let is_decision = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(|c: char| c.is_ascii_digit())
    };
    tree(&root().join("docs/decisions"), &is_decision, &mut decisions);
    assert!(!decisions.is_empty());
    for path in decisions {
        let size = size(&path);
        let place = place(&path);
        assert!(
            size <= DECISION,
            "{place} has {size} bytes, at most {DECISION}"
        );
    }
    let mut images = Vec::new();
    tree(&root().join("docs/images"), &|_| true, &mut images);
    let all: u64 = images.iter().map(|path| size(path)).sum();
    assert!(
        all <= IMAGES,
        "docs/images has {all} bytes, at most {IMAGES}"
    );
}

/// Indexes from which `scripts/docs/summary.py` makes the contents of the site.
const INDEXES: [&str; 3] = [
    "docs/README.md",
    "docs/results/README.md",
    "docs/decisions/README.md",
];

#[test]
fn every_document_is_in_its_index_and_every_image_in_a_document() {
    let docs = root().join("docs");
    let indexes = INDEXES.map(|index| root().join(index));
    let mut linked = BTreeSet::new();
    for path in documents() {
        let text = fs::read_to_string(&path).expect("a document");
        let folder = path.parent().expect("a folder").to_owned();
        for target in targets(&text) {
            let file = target.split('#').next().unwrap_or_default();
            if let Ok(file) = folder.join(file).canonicalize() {
                let is_index = indexes.contains(&path);
                if is_index || file.starts_with(docs.join("images")) {
                    linked.insert(file);
                }
            }
        }
    }
    let mut files = Vec::new();
    tree(&docs, &|path| !path.ends_with("README.md"), &mut files);
    let left = files.iter().filter(|path| {
        let path = path.canonicalize().expect("a file");
        !linked.contains(&path)
    });
    let left: Vec<_> = left.map(|path| place(path)).collect();
    let left = left.join("\n");
    assert!(left.is_empty(), "none of {INDEXES:?} links to:\n{left}");
}

/// Numbers of a text, with their points and commas.
fn numbers(text: &str) -> BTreeSet<String> {
    let parts = text.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | ',')));
    let parts = parts.map(|part| part.trim_matches(['.', ',']).to_owned());
    parts.filter(|part| !part.is_empty()).collect()
}

/// A link to a page of results is a quotation: its text has only numbers of that page.
#[test]
fn figures_that_link_to_results_are_figures_of_these_results() {
    let results = root().join("docs/results").canonicalize();
    let results = results.expect("the results");
    let (mut wrong, mut quoted) = (Vec::new(), 0);
    for path in documents() {
        let text = without_blocks(&fs::read_to_string(&path).expect("a document"));
        for link in text.split('[').skip(1) {
            let Some((words, target)) = link.split_once("](") else {
                continue;
            };
            let target = target.split([')', '#']).next().unwrap_or_default();
            let page = path.parent().expect("a folder").join(target);
            let is_quotation = !words.contains(']')
                && page.is_file()
                && page
                    .canonicalize()
                    .is_ok_and(|page| page.starts_with(&results))
                && words.contains(|c: char| c.is_ascii_digit());
            if !is_quotation {
                continue;
            }
            quoted += 1;
            let known = numbers(&fs::read_to_string(&page).expect("a page of results"));
            let unknown: Vec<_> = numbers(words).difference(&known).cloned().collect();
            if !unknown.is_empty() {
                let place = place(&path);
                wrong.push(format!(
                    "{place}: [{words}] is not in {target}: {unknown:?}"
                ));
            }
        }
    }
    assert!(quoted > 15, "{quoted} quotations");
    let wrong = wrong.join("\n");
    assert!(wrong.is_empty(), "quote the page, or correct it:\n{wrong}");
}

/// Folders at the root, with which a path in a document begins.
const TOP: [&str; 7] = [
    "assets/", "client/", "docs/", "proto/", "scripts/", "server/", "tests/",
];

#[test]
fn paths_that_the_architecture_names_exist() {
    let mut missing = Vec::new();
    for name in ["ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let text = fs::read_to_string(root().join(name)).expect("a document");
        let text = without_blocks(&text);
        for path in text.split('`').skip(1).step_by(2) {
            let is_path = TOP.iter().any(|top| path.starts_with(top));
            let is_pattern =
                path.contains(['*', '{', ' ']) || path.contains("NAME") || path.contains("AREA");
            if is_path && !is_pattern && !root().join(path).exists() {
                missing.push(format!("{name}: {path}"));
            }
        }
    }
    assert!(missing.is_empty(), "missing:\n{}", missing.join("\n"));
}

/// Most words of a sentence.
const WORDS: usize = 25;

/// The sentences of a line. A point within a number or a name does not end one.
fn sentences(line: &str) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for part in line.split_inclusive(['.', ':', ';', '?', '!']) {
        match all.last_mut() {
            Some(last) if !part.starts_with(char::is_whitespace) => last.push_str(part),
            _ => all.push(part.to_owned()),
        }
    }
    all
}

#[test]
fn sentences_of_documents_have_at_most_25_words() {
    let mut long = Vec::new();
    for path in documents() {
        let text = fs::read_to_string(&path).expect("a document");
        for (i, line) in prose(&text).lines().enumerate() {
            if line.starts_with('|') || line.starts_with('#') {
                continue;
            }
            for sentence in sentences(line) {
                let words = sentence.split_whitespace();
                let count = words.filter(|w| w.contains(char::is_alphanumeric)).count();
                if count > WORDS {
                    long.push(format!("{}:{} {count}: {sentence}", place(&path), i + 1));
                }
            }
        }
    }
    assert!(long.is_empty(), "long sentences:\n{}", long.join("\n"));
}
