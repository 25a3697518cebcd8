//! Words that WheelArm does not use, by scope: `tests/data/banned.toml`. Documents hold
//! none of them; in code their number only falls.
//!
//! With the variable `WHEELARM_WRITE_BANNED=1` the test writes lower counts into the file.

use std::fs;
use std::path::Path;

use regex::{Regex, RegexBuilder};

use super::documents::{documents, place, prose, tree};
use super::{root, source};

/// Most exceptions of the file.
const EXCEPTIONS: usize = 50;

const FILE: &str = "tests/data/banned.toml";

/// A banned word.
struct Rule {
    scope: String,
    pattern: Regex,
    /// The word to use.
    instead: String,
    /// Most matches.
    most: usize,
}

/// A line of a file that may hold a banned word.
struct Exception {
    file: String,
    /// Part of the line.
    text: String,
}

fn text(table: &toml::Table, key: &str) -> String {
    let value = table.get(key).and_then(toml::Value::as_str);
    let value = value.unwrap_or_else(|| panic!("{FILE}: {key} is missing in {table}"));
    assert!(!value.is_empty(), "{FILE}: {key} is empty in {table}");
    value.to_owned()
}

fn tables<'a>(file: &'a toml::Table, key: &str) -> Vec<&'a toml::Table> {
    let list = file.get(key).and_then(toml::Value::as_array);
    let tables = list.into_iter().flatten().filter_map(toml::Value::as_table);
    tables.collect()
}

fn read() -> (Vec<Rule>, Vec<Exception>) {
    let file = fs::read_to_string(root().join(FILE)).expect(FILE);
    let file: toml::Table = file.parse().expect(FILE);
    let rules = tables(&file, "rule").into_iter().map(|rule| Rule {
        scope: text(rule, "scope"),
        // ASCII word boundaries: those of Unicode are many times slower.
        pattern: RegexBuilder::new(&text(rule, "pattern"))
            .unicode(false)
            .multi_line(true)
            .build()
            .expect("a regular expression"),
        instead: text(rule, "use"),
        most: rule
            .get("most")
            .and_then(toml::Value::as_integer)
            .and_then(|most| usize::try_from(most).ok())
            .expect("most is a count"),
    });
    let exceptions = tables(&file, "exception").into_iter().map(|exception| {
        text(exception, "reason");
        Exception {
            file: text(exception, "file"),
            text: text(exception, "text"),
        }
    });
    (rules.collect(), exceptions.collect())
}

/// The comments of a source that is not Rust: what follows its mark.
fn comments_after(text: &str, mark: &str) -> String {
    let lines = text.lines().map(|line| {
        let found = line.match_indices(mark).find(|(at, _)| {
            let before = line[..*at].chars().next_back();
            before.is_none_or(char::is_whitespace)
        });
        found.map_or("", |(at, _)| &line[at..])
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// A text of one scope: the file with its place in the repository.
struct Source {
    scope: &'static str,
    place: String,
    text: String,
}

fn sources() -> Vec<Source> {
    let mut found = Vec::new();
    for path in documents() {
        let text = fs::read_to_string(&path).expect("a document");
        found.push(Source {
            scope: "documents",
            place: place(&path),
            text: prose(&text),
        });
    }
    let mut files = Vec::new();
    let is_source = |path: &Path| {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        ["rs", "proto", "js", "py", "sh", "toml"].contains(&&*ending)
    };
    // Not `vendor`: sources of other projects, which keep the language of their authors.
    for folder in [
        "assets", "client", "fuzz", "proto", "scripts", "server", "tests",
    ] {
        tree(&root().join(folder), &is_source, &mut files);
    }
    for path in files {
        let place = place(&path);
        if place == FILE || place.ends_with("tidy/banned.rs") {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap_or_default();
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let mut add = |scope, text| {
            found.push(Source {
                scope,
                place: place.clone(),
                text,
            });
        };
        match &*ending {
            "rs" => {
                let parts = source::parts(&text);
                add("comments", parts.comments);
                add("identifiers", parts.code);
                add("strings", parts.strings);
            }
            "proto" | "js" => add("comments", comments_after(&text, "//")),
            _ => add("comments", comments_after(&text, "#")),
        }
    }
    found
}

#[test]
fn banned_words_only_become_fewer() {
    let (rules, exceptions) = read();
    assert!(
        exceptions.len() <= EXCEPTIONS,
        "{} exceptions, at most {EXCEPTIONS}",
        exceptions.len()
    );
    let sources = sources();
    let mut used = vec![false; exceptions.len()];
    let mut counts = Vec::new();
    let mut complaints = Vec::new();
    for rule in &rules {
        let mut hits = Vec::new();
        let of_scope: Vec<_> = sources.iter().filter(|s| s.scope == rule.scope).collect();
        assert!(!of_scope.is_empty(), "{FILE}: unknown scope {}", rule.scope);
        for source in of_scope {
            if !rule.pattern.is_match(&source.text) {
                continue;
            }
            for (i, line) in source.text.lines().enumerate() {
                let count = rule.pattern.find_iter(line).count();
                if count == 0 {
                    continue;
                }
                let exception = exceptions
                    .iter()
                    .position(|e| e.file == source.place && line.contains(&e.text));
                match exception {
                    Some(at) => used[at] = true,
                    None => hits.extend(std::iter::repeat_n(
                        format!("{}:{}", source.place, i + 1),
                        count,
                    )),
                }
            }
        }
        if hits.len() > rule.most {
            hits.dedup();
            let shown = hits.len().min(20);
            complaints.push(format!(
                "{}: {} allows {} in {}, use {}:\n  {}",
                FILE,
                rule.pattern,
                rule.most,
                rule.scope,
                rule.instead,
                hits[..shown].join("\n  ")
            ));
        }
        counts.push(hits.len());
    }
    if std::env::var_os("WHEELARM_WRITE_BANNED").is_some() {
        write(&rules, &counts);
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
    let unused = exceptions.iter().zip(used).filter(|(_, used)| !used);
    let unused: Vec<_> = unused
        .map(|(e, _)| format!("{}: {}", e.file, e.text))
        .collect();
    assert!(
        unused.is_empty(),
        "exceptions without use:\n{}",
        unused.join("\n")
    );
}

/// Writes the counts that have fallen into the file.
fn write(rules: &[Rule], counts: &[usize]) {
    let path = root().join(FILE);
    let text = fs::read_to_string(&path).expect(FILE);
    let mut lower = rules
        .iter()
        .zip(counts)
        .map(|(rule, count)| rule.most.min(*count));
    let lines = text.lines().map(|line| match line.starts_with("most = ") {
        true => format!("most = {}", lower.next().expect("a rule")),
        false => line.to_owned(),
    });
    let text = lines.collect::<Vec<_>>().join("\n") + "\n";
    fs::write(path, text).expect(FILE);
}
