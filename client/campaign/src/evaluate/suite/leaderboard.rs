//! The leaderboard: a document whose tables follow from checked results.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, ensure};

use super::file::{BASE, Suite};
use super::report::SuiteReport;

/// Lines around the tables in the document.
const BEGIN: &str = "<!-- tables: scripts/leaderboard.sh -->";
const END: &str = "<!-- end of tables -->";

/// A name, the suite, and its results.
pub type Entry = (String, Suite, SuiteReport);

/// Writes the tables between the two lines of the document.
///
/// # Errors
/// When the document cannot be read or written, or lacks the lines.
pub fn write(document: &Path, entries: &[Entry]) -> anyhow::Result<()> {
    let about = || format!("writing {}", document.display());
    let text = std::fs::read_to_string(document).with_context(about)?;
    let text = with_tables(&text, entries).with_context(about)?;
    std::fs::write(document, text).with_context(about)
}

/// The document with the tables of `entries`.
///
/// # Errors
/// When it lacks the lines.
pub fn with_tables(text: &str, entries: &[Entry]) -> anyhow::Result<String> {
    let parts = text.split_once(BEGIN).and_then(|(before, rest)| {
        let (_, after) = rest.split_once(END)?;
        Some((before, after))
    });
    let (before, after) = parts.with_context(|| format!("it lacks the lines {BEGIN} and {END}"))?;
    let tables = tables(entries)?;
    Ok(format!("{before}{BEGIN}\n{tables}{END}{after}"))
}

/// A table for each suite, best base first.
fn tables(entries: &[Entry]) -> anyhow::Result<String> {
    let mut suites: Vec<&Suite> = entries.iter().map(|(_, suite, _)| suite).collect();
    suites.sort_by(|a, b| a.name.cmp(&b.name));
    suites.dedup_by(|a, b| a.name == b.name);
    if suites.is_empty() {
        return Ok("\nNo results are checked in yet.\n\n".to_owned());
    }
    let mut out = String::new();
    for suite in suites {
        let mut own: Vec<&Entry> = entries
            .iter()
            .filter(|entry| entry.1.name == suite.name)
            .collect();
        ensure!(
            own.iter().all(|entry| entry.1 == *suite),
            "the results are of two suites with the name {}",
            suite.name
        );
        own.sort_by(|a, b| rate(b).total_cmp(&rate(a)).then_with(|| a.0.cmp(&b.0)));
        out += &table(suite, &own);
    }
    Ok(out)
}

/// Rate of the base; below 0 without it.
fn rate(entry: &Entry) -> f64 {
    entry.2.cell(BASE).map_or(-1.0, |cell| cell.rate)
}

fn table(suite: &Suite, entries: &[&Entry]) -> String {
    let claimed: Vec<_> = suite
        .cells
        .iter()
        .filter(|cell| cell.strength < 3)
        .collect();
    let mut out = format!("\n## {}\n\n| entry | policy |", suite.name);
    // Writing into a string cannot fail.
    for cell in &claimed {
        let _ = write!(out, " {} |", cell.name);
    }
    out += " ledger | physics |\n|---|---|";
    out += &"---|".repeat(claimed.len() + 2);
    out.push('\n');
    for (name, _, report) in entries {
        let policy = &report.identity.policy;
        let ledger = match (&policy.ledger, policy.undeclared.is_empty()) {
            (None, _) => "undeclared".to_owned(),
            (Some(_), true) => "declared".to_owned(),
            (Some(_), false) => {
                let kinds = policy.undeclared.iter().map(|kind| kind.name());
                format!("undeclared: {}", kinds.collect::<Vec<_>>().join(", "))
            }
        };
        let _ = write!(out, "| {name} | `{}` |", policy.name.replace('|', "/"));
        for cell in &claimed {
            let _ = match report.cell(&cell.name) {
                None => write!(out, " – |"),
                Some(figures) => {
                    let share = figures.kept.as_ref().map(|kept| {
                        let [low, high] = kept.interval;
                        format!("; kept {:.2} ({low:.2} to {high:.2})", kept.share)
                    });
                    write!(
                        out,
                        " {} of {}{} |",
                        figures.successes,
                        figures.episodes,
                        share.unwrap_or_default()
                    )
                }
            };
        }
        let _ = writeln!(out, " {ledger} | {} |", report.identity.physics_version);
    }
    out.push('\n');
    out
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::{identity, rows, suite};
    use super::super::verify::read;
    use super::*;

    fn entry(name: &str, successes: bool) -> Entry {
        let suite = suite();
        let mut rows = rows(&suite);
        rows.iter_mut().for_each(|row| row.success &= successes);
        let report = SuiteReport::new(&suite, identity(&suite), Vec::new(), rows);
        (name.to_owned(), suite, report)
    }

    #[test]
    fn better_base_is_first_and_missing_cells_are_marked() {
        let document = format!("# Board\n{BEGIN}\nformer\n{END}\n## Rules\n");
        let text = with_tables(&document, &[entry("a", false), entry("b", true)]).unwrap();
        let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("| ")).collect();
        assert_eq!(
            lines[0],
            "| entry | policy | base | start-2 | home-1 | ledger | physics |"
        );
        assert!(
            lines[1].starts_with("| b | `hold` | 3 of 4 | 2 of 4; kept 0.67 ("),
            "{text}"
        );
        assert!(
            lines[2].starts_with("| a | `hold` | 0 of 4 | 0 of 4 | – | declared |"),
            "{text}"
        );
        assert!(text.ends_with(&format!("{END}\n## Rules\n")) && !text.contains("former"));
        // The same tables again.
        assert_eq!(
            with_tables(&text, &[entry("b", true), entry("a", false)]).unwrap(),
            text
        );
        assert!(
            with_tables("# Board\n", &[])
                .unwrap_err()
                .to_string()
                .contains("lacks")
        );
    }

    #[test]
    fn leaderboard_follows_from_the_checked_in_results() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/results");
        let suites = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/suites");
        let mut files: Vec<_> = std::fs::read_dir(docs.join("leaderboard"))
            .map(|entries| entries.flatten().map(|entry| entry.path()).collect())
            .unwrap_or_default();
        files.retain(|path: &std::path::PathBuf| path.extension().is_some_and(|e| e == "json"));
        files.sort();
        let entries: Vec<Entry> = files
            .iter()
            .map(|file| {
                let text = std::fs::read_to_string(file).unwrap();
                let name = SuiteReport::read(&text).unwrap().identity.suite.name;
                let path = suites.join(format!("{name}.toml"));
                let (suite, report) = read(file, Some(&path))
                    .unwrap_or_else(|problem| panic!("{}: {problem:#}", file.display()));
                let name = file.file_stem().unwrap().to_string_lossy().into_owned();
                (name, suite, report)
            })
            .collect();
        let document = std::fs::read_to_string(docs.join("leaderboard.md")).unwrap();
        assert_eq!(
            document,
            with_tables(&document, &entries).unwrap(),
            "run scripts/leaderboard.sh"
        );
    }
}
