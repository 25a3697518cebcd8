//! The file of a suite's results: its rows, their figures, and what identifies the run.
//!
//! The last line has the digest of all text before it, so that a cut or edited file is
//! recognized. The digest proves no origin: `wheelarm evaluate verify --rerun` repeats
//! episodes.

use std::fmt::Write as _;

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use wheelarm_policy::ledger::Kind;
use wheelarm_proto::PHYSICS_VERSION;

use super::figures::{CellFigures, Row, figures};
use super::file::Suite;
use super::hardware::Hardware;

/// Version of the layout.
pub const FORMAT: &str = "wheelarm-suite-results/1";
/// Begin of the last line.
const DIGEST: &str = "\"digest\": \"";
/// Largest difference of a stored figure from the computed one: it has six digits.
const EQUAL: f64 = 1e-9;

/// The suite of a report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteId {
    /// Name.
    pub name: String,
    /// Hash of its content.
    pub hash: String,
}

/// The policy of a report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyId {
    /// Kind: the first word of `--policy`.
    pub kind: String,
    /// Name with the hash of its weights; `operator` for the scripted operator.
    pub name: String,
    /// SHA-256 of its weights; empty without any.
    pub weights: String,
    /// Digest of its files; empty without any.
    pub files: String,
    /// Hash of its training ledger; absent for an undeclared policy.
    pub ledger: Option<String>,
    /// Content that the suite requires to be unseen and the ledger does not declare.
    pub undeclared: Vec<Kind>,
    /// Its answers are the same in every run on the same hardware.
    pub deterministic: bool,
}

impl PolicyId {
    /// What another policy has that changes its episodes, with the fix; `None` when they act
    /// alike. A ledger changes no episode.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<String> {
        let or_none = |text: &str| if text.is_empty() { "none" } else { text }.to_owned();
        let (own_mode, mode) = (self.deterministic, other.deterministic);
        let all = [
            (
                "its weights are",
                &self.weights,
                &other.weights,
                "use the same file",
            ),
            (
                "its name is",
                &self.name,
                &other.name,
                "use the same policy",
            ),
            (
                "the digest of its files is",
                &self.files,
                &other.files,
                "use the same files",
            ),
        ];
        let mut all = all.into_iter().filter(|(_, own, other, _)| own != other);
        let of_files = all.next().map(|(what, own, other, fix)| {
            format!(
                "{what} {}, and those of --policy {}; {fix}",
                or_none(own),
                or_none(other)
            )
        });
        of_files.or_else(|| match (own_mode, mode) {
            (true, false) => Some("they were made with --deterministic; add it".to_owned()),
            (false, true) => Some("they were made without --deterministic; remove it".to_owned()),
            _ => None,
        })
    }
}

/// Episodes that ran with one program on one machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Version line of the program, with its commit.
    pub program: String,
    /// The machine.
    pub hardware: Hardware,
    /// Episodes that were done before.
    pub episodes_before: usize,
}

/// Everything that one run keeps the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// [`FORMAT`].
    pub format: String,
    /// The suite.
    pub suite: SuiteId,
    /// The policy.
    pub policy: PolicyId,
    /// Version of the physics.
    pub physics_version: u32,
}

/// Results of a suite.
#[derive(Clone, Debug, PartialEq)]
pub struct SuiteReport {
    /// What identifies the run.
    pub identity: Identity,
    /// Its sessions.
    pub sessions: Vec<Session>,
    /// Figures of the complete cells.
    pub cells: Vec<CellFigures>,
    /// Episodes of the complete cells.
    pub rows: Vec<Row>,
}

/// The file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    identity: Identity,
    sessions: Vec<Session>,
    cells: Vec<CellFigures>,
    rows: Vec<Row>,
    #[serde(rename = "digest")]
    _digest: String,
}

impl SuiteReport {
    /// The report of a run with its rows.
    #[must_use]
    pub fn new(suite: &Suite, identity: Identity, sessions: Vec<Session>, rows: Vec<Row>) -> Self {
        Self {
            identity,
            sessions,
            cells: figures(suite, &rows),
            rows,
        }
    }

    /// The text of its file.
    ///
    /// # Errors
    /// Never for finite numbers.
    pub fn text(&self) -> serde_json::Result<String> {
        fn lines<T: Serialize>(name: &str, items: &[T]) -> serde_json::Result<String> {
            let items = items.iter().map(serde_json::to_string);
            let items: Vec<String> = items.collect::<serde_json::Result<_>>()?;
            Ok(format!("\"{name}\": [\n{}\n],\n", items.join(",\n")))
        }
        let mut text = format!(
            "{{\n\"identity\": {},\n",
            serde_json::to_string(&self.identity)?
        );
        text += &lines("sessions", &self.sessions)?;
        text += &lines("cells", &self.cells)?;
        text += &lines("rows", &self.rows)?;
        let digest = digest(&text);
        // Writing into a string cannot fail.
        let _ = write!(text, "{DIGEST}{digest}\"\n}}\n");
        Ok(text)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// When it is of another version, or was cut or edited.
    pub fn read(text: &str) -> anyhow::Result<Self> {
        let about = "it is not a complete file of `wheelarm evaluate --suite`";
        let value: Value = serde_json::from_str(text)
            .with_context(|| format!("{about}: get the whole file again"))?;
        let format = &value["identity"]["format"];
        ensure!(
            format == FORMAT,
            "its format is {format}, expected {FORMAT:?}; run the suite with this version"
        );
        let (before, after) = text.rsplit_once(DIGEST).context(about)?;
        ensure!(
            after.trim_end() == digest(before) + "\"\n}",
            "the file was edited after it was written: its digest does not match; use the file as `wheelarm evaluate --suite` wrote it"
        );
        let file: File = serde_json::from_value(value).context(about)?;
        Ok(Self {
            identity: file.identity,
            sessions: file.sessions,
            cells: file.cells,
            rows: file.rows,
        })
    }

    /// Compares the report with its suite: version, hash, rows and figures.
    ///
    /// # Errors
    /// The first difference.
    pub fn check(&self, suite: &Suite) -> anyhow::Result<()> {
        let identity = &self.identity;
        ensure!(
            identity.physics_version == PHYSICS_VERSION,
            "it was made with physics version {}, and this program has {PHYSICS_VERSION}: results of two versions are not comparable; run the suite again",
            identity.physics_version
        );
        let id = &identity.suite;
        ensure!(
            *id == suite.id(),
            "it is of the suite {} with the hash {}, and {} here has {}: run the suite of this version",
            id.name,
            id.hash,
            suite.name,
            suite.hash
        );
        let known = |row: &Row| suite.cell(&row.cell).is_some();
        if let Some(row) = self.rows.iter().find(|row| !known(row)) {
            bail!("the suite has no cell {:?}, which a row names", row.cell);
        }
        for cell in &suite.cells {
            let own: Vec<&Row> = self
                .rows
                .iter()
                .filter(|row| row.cell == cell.name)
                .collect();
            let wanted = suite.episodes(cell).count();
            if own.is_empty() {
                continue;
            }
            for (task, seed) in suite.episodes(cell) {
                let same = own
                    .iter()
                    .filter(|row| row.task == task && row.seed == seed);
                let count = same.count();
                ensure!(
                    count == 1,
                    "the cell {} has {count} rows of {task} with seed {seed}, expected one",
                    cell.name
                );
            }
            ensure!(
                own.len() == wanted,
                "the cell {} has {} rows, expected {wanted}",
                cell.name,
                own.len()
            );
        }
        let computed = serde_json::to_value(figures(suite, &self.rows))?;
        if let Some(difference) =
            difference("cells", &serde_json::to_value(&self.cells)?, &computed)
        {
            bail!("a figure does not follow from the rows: {difference}");
        }
        Ok(())
    }

    /// Figures of a cell.
    #[must_use]
    pub fn cell(&self, name: &str) -> Option<&CellFigures> {
        self.cells.iter().find(|cell| cell.cell == name)
    }

    /// The figures as a table for a terminal.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = format!(
            "{:<14} {:>9} {:>7} {:>15}  {:>5} {:>13} {:>6}\n",
            "cell", "successes", "rate", "Wilson 95 %", "kept", "95 %", "broken"
        );
        for cell in &self.cells {
            let [low, high] = cell.interval;
            let (share, interval) = match &cell.kept {
                Some(kept) => (
                    format!("{:.2}", kept.share),
                    format!("{:.2} to {:.2}", kept.interval[0], kept.interval[1]),
                ),
                None => ("–".to_owned(), "–".to_owned()),
            };
            // Writing into a string cannot fail.
            let _ = writeln!(
                text,
                "{:<14} {:>4}/{:<4} {:>5.1} % {:>15}  {share:>5} {interval:>13} {:>6}",
                cell.cell,
                cell.successes,
                cell.episodes,
                100.0 * cell.rate,
                format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high),
                cell.broken
            );
        }
        text
    }
}

impl Suite {
    /// What identifies it in a report.
    #[must_use]
    pub fn id(&self) -> SuiteId {
        SuiteId {
            name: self.name.clone(),
            hash: self.hash.clone(),
        }
    }
}

fn digest(text: &str) -> String {
    let digest = Sha256::digest(text);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The first difference of two values, with its place.
fn difference(place: &str, stored: &Value, computed: &Value) -> Option<String> {
    let differs = || Some(format!("{place} is {stored}, computed {computed}"));
    match (stored, computed) {
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64()?, b.as_f64()?);
            if (a - b).abs() <= EQUAL {
                None
            } else {
                differs()
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(i, (a, b))| difference(&format!("{place}/{i}"), a, b))
        }
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => a
            .iter()
            .find_map(|(key, value)| difference(&format!("{place}/{key}"), value, &b[key])),
        (a, b) if a == b => None,
        _ => differs(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::{identity, rows, suite};
    use super::*;

    fn report() -> SuiteReport {
        let suite = suite();
        SuiteReport::new(&suite, identity(&suite), Vec::new(), rows(&suite))
    }

    #[test]
    fn a_policy_differs_by_what_changes_its_episodes_and_not_by_its_ledger() {
        let own = identity(&suite()).policy;
        let with = |change: fn(&mut PolicyId)| {
            let mut other = own.clone();
            change(&mut other);
            own.difference(&other)
        };
        assert_eq!(with(|other| other.ledger = None), None);
        assert_eq!(with(|other| other.undeclared.clear()), None);
        let weights = with(|other| other.weights = "abc".to_owned()).unwrap();
        assert!(weights.contains("abc; use the same file"), "{weights}");
        let mode = with(|other| other.deterministic = !other.deterministic).unwrap();
        assert!(mode.contains("--deterministic"), "{mode}");
    }

    /// The error of a report that `change` edited and wrote with a right digest.
    fn problem(change: impl FnOnce(&mut SuiteReport)) -> String {
        let mut report = report();
        change(&mut report);
        let read = SuiteReport::read(&report.text().unwrap()).unwrap();
        format!("{:#}", read.check(&suite()).unwrap_err())
    }

    #[test]
    fn report_is_read_as_it_was_written_and_its_figures_follow_from_its_rows() {
        let report = report();
        let read = SuiteReport::read(&report.text().unwrap()).unwrap();
        assert_eq!(read, report);
        read.check(&suite()).unwrap();
        let table = read.table();
        assert!(table.contains("3/4     75.0 %"), "{table}");
    }

    #[test]
    fn cut_or_edited_file_is_rejected() {
        let text = report().text().unwrap();
        let problem = |text: &str| format!("{:#}", SuiteReport::read(text).unwrap_err());
        for cut in [text.len() / 2, text.len() - 4] {
            assert!(problem(&text[..cut]).contains("not a complete file"));
        }
        let edited = text.replacen("\"success\":false", "\"success\":true", 1);
        assert!(problem(&edited).contains("edited"));
        // A row that is removed together with its line.
        let mut lines: Vec<&str> = text.lines().collect();
        let row = lines
            .iter()
            .position(|line| line.contains("\"cell\":\"base\",\"task\""));
        lines.remove(row.unwrap());
        assert!(problem(&lines.join("\n")).contains("edited"));
        let other = text.replacen(FORMAT, "wheelarm-suite-results/0", 1);
        assert!(problem(&other).contains("run the suite with this version"));
    }

    #[test]
    fn rows_and_figures_must_be_those_of_the_suite() {
        assert!(
            problem(|r| r.rows[1].success = true)
                .contains("does not follow from the rows: cells/0/")
        );
        assert!(problem(|r| r.cells[0].rate = 0.9).contains("cells/0/rate is 0.9, computed 0.75"));
        assert!(
            problem(|r| {
                r.rows.remove(0);
            })
            .contains("base has 0 rows of pick_bowl with seed 600")
        );
        assert!(problem(|r| r.rows.push(r.rows[0].clone())).contains("has 2 rows"));
        assert!(problem(|r| r.rows[0].cell = "night".to_owned()).contains("no cell \"night\""));
        assert!(problem(|r| r.identity.physics_version += 1).contains("not comparable"));
        assert!(problem(|r| r.identity.suite.hash = "0".to_owned()).contains("with the hash 0"));
        let extra = |r: &mut SuiteReport| {
            let mut row = r.rows[0].clone();
            row.seed = 700;
            r.rows.push(row);
        };
        assert!(problem(extra).contains("5 rows, expected 4"));
    }
}
