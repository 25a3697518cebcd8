//! Segments as a table that people can correct and hand back:
//! `episode,from_seconds,label,name`, one line per segment, seconds from the
//! start of the episode. Columns go by the names of the header; episode, from_seconds
//! and label are required, others are not read.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, bail, ensure};

use super::{NAMES, Segment};

/// Columns of a table, in the order in which they are written; the last is for people.
const COLUMNS: [&str; 4] = ["episode", "from_seconds", "label", "name"];
/// Columns that are read.
const REQUIRED: [&str; 3] = [COLUMNS[0], COLUMNS[1], COLUMNS[2]];
/// Ending of a recording's name, which an episode may be given with.
const ENDING: &str = ".h5";

/// Corrected segments by the label of the episode, times from its start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Corrections(BTreeMap<String, Own>);

/// Segments of one episode.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Own {
    segments: Vec<Segment>,
    /// First occurrence of the episode: table and line.
    place: String,
}

impl Corrections {
    /// Reads a table: UTF-8, separated by commas, with a header.
    ///
    /// # Errors
    /// With the line: when a column is missing, a cell is not what its column holds,
    /// times do not rise, or the table is separated or encoded otherwise.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let table = path.display();
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {table}"))?;
        let text = decode(&bytes).with_context(|| format!("cannot read {table}"))?;
        // Lines with content and their numbers: the parser counts no others.
        let (numbers, lines): (Vec<usize>, Vec<&str>) = (1..)
            .zip(text.lines())
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
            .unzip();
        let first = numbers.first().copied().unwrap_or(1);
        let columns = header(lines.first().copied().unwrap_or_default())
            .with_context(|| format!("cannot read {table}, line {first}"))?;
        let lines = lines.join("\n");
        let mut records = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(lines.as_bytes());
        let mut all: BTreeMap<String, Own> = BTreeMap::new();
        for (record, line) in records.records().enumerate() {
            let begins = match &line {
                Ok(line) => line.position().map(csv::Position::line),
                Err(problem) => problem.position().map(csv::Position::line),
            };
            let begins = begins.map_or(record + 1, |line| (line as usize).saturating_sub(1));
            let number = numbers.get(begins).copied().unwrap_or_default();
            let place = format!("{table}, line {number}");
            let line = line.with_context(|| place.clone())?;
            let mut cells = [""; REQUIRED.len()];
            for ((cell, column), name) in cells.iter_mut().zip(columns).zip(REQUIRED) {
                *cell = line.get(column).unwrap_or_default();
                ensure!(!cell.is_empty(), "{place}: the column {name} is empty");
            }
            let [episode, seconds, label] = cells;
            let from: f64 = seconds
                .parse()
                .with_context(|| format!("{place}: invalid time {seconds:?}: write seconds"))?;
            let label: u8 = label
                .parse()
                .ok()
                .filter(|&l| usize::from(l) < NAMES.len())
                .with_context(|| format!("{place}: invalid label {label:?}: use 0 to 3"))?;
            if !(0.0..1e7).contains(&from) {
                bail!("{place}: {from} s is outside of every episode");
            }
            let own = all.entry(episode.to_owned()).or_insert_with(|| Own {
                segments: Vec::new(),
                place: place.clone(),
            });
            let nanos = (from * 1e9).round() as u64;
            if own.segments.last().is_some_and(|last| last.from >= nanos) {
                bail!("{place}: {from} s is not later than the segment before");
            }
            own.segments.push(Segment { from: nanos, label });
        }
        for (name, own) in &all {
            let short = name.strip_suffix(ENDING);
            if let Some(short) = short.filter(|&short| all.contains_key(short)) {
                bail!(
                    "{}: the episode is named {name:?} here and {short:?} elsewhere: use one name",
                    own.place
                );
            }
        }
        Ok(Self(all))
    }

    /// Checks that every episode of the table is a recording that `is_known`.
    ///
    /// # Errors
    /// The first unknown name, with its line.
    pub fn check_episodes(&self, is_known: impl Fn(&str) -> bool) -> anyhow::Result<()> {
        for (name, own) in &self.0 {
            let short = name.strip_suffix(ENDING);
            ensure!(
                is_known(name) || short.is_some_and(&is_known),
                "{}: no recording named {name:?} among the files or beside them: correct the \
                 name, or remove its lines",
                own.place
            );
        }
        Ok(())
    }

    /// Whether the camera has no frames.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The corrected segments of an episode that starts at `start`, else those
    /// that the rule found.
    #[must_use]
    pub fn apply(&self, episode: &str, start: u64, found: Vec<Segment>) -> Vec<Segment> {
        let own = self.0.get(episode);
        match own.or_else(|| self.0.get(&format!("{episode}{ENDING}"))) {
            Some(own) => { own.segments.iter() }
                .map(|s| Segment {
                    from: s.from + start,
                    label: s.label,
                })
                .collect(),
            None => found,
        }
    }
}

/// The text of a table, without the byte order mark of spreadsheets.
fn decode(bytes: &[u8]) -> anyhow::Result<&str> {
    let is_wide = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff");
    ensure!(
        !is_wide && !bytes.contains(&0),
        "line 1: the text is UTF-16 or binary: save the table as CSV in UTF-8"
    );
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.strip_prefix('\u{feff}').unwrap_or(text)),
        Err(problem) => {
            let before = &bytes[..problem.valid_up_to()];
            let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
            bail!("line {line}: the text is not UTF-8: save the table as CSV in UTF-8")
        }
    }
}

/// Indices of the required columns in a table with this header.
fn header(line: &str) -> anyhow::Result<[usize; REQUIRED.len()]> {
    let names: Vec<&str> = line
        .split(',')
        .map(|n| n.trim().trim_matches('"'))
        .collect();
    let mut columns = [0; REQUIRED.len()];
    for (column, name) in columns.iter_mut().zip(REQUIRED) {
        let mut found = (0..names.len()).filter(|&at| names[at] == name);
        *column = match (found.next(), found.next()) {
            (Some(at), None) => at,
            (Some(_), Some(_)) => bail!("the column {name:?} occurs twice: rename one of them"),
            (None, _) => {
                let separator = [";", "\t", "|"].into_iter().find(|s| line.contains(s));
                if let Some(separator) = separator {
                    bail!("the columns are separated by {separator:?}: save the table with commas");
                }
                bail!(
                    "no column named {name:?}: begin the table with the line `{}`",
                    COLUMNS.join(",")
                )
            }
        };
    }
    Ok(columns)
}

/// Writes segments of several episodes: (label, start in nanoseconds, segments).
///
/// # Errors
/// Those of the writer.
pub fn write(to: impl Write, episodes: &[(String, u64, Vec<Segment>)]) -> anyhow::Result<()> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record(COLUMNS)?;
    for (episode, start, segments) in episodes {
        for s in segments {
            let seconds = s.from.saturating_sub(*start) as f64 * 1e-9;
            table.write_record([
                episode,
                &format!("{seconds:.6}"),
                &s.label.to_string(),
                NAMES[usize::from(s.label).min(3)],
            ])?;
        }
    }
    table.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_was_written_reads_back_and_replaces_the_rule() {
        let segments = vec![
            Segment {
                from: 5_000_000_000,
                label: 0,
            },
            Segment {
                from: 8_250_000_000,
                label: 1,
            },
        ];
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("labels.csv");
        let file = std::fs::File::create(&path).unwrap();
        write(file, &[("a".into(), 5_000_000_000, segments.clone())]).unwrap();
        let read = Corrections::read(&path).unwrap();
        assert_eq!(read.apply("a", 5_000_000_000, Vec::new()), segments);
        assert_eq!(read.apply("b", 0, segments.clone()), segments);
    }

    #[test]
    fn a_table_with_a_wrong_label_or_order_is_refused_with_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("labels.csv");
        for (text, words) in [
            ("episode,from_seconds,label\na,0,7\n", "line 2"),
            ("episode,from_seconds,label\na,2,0\na,1,1\n", "line 3"),
            ("episode,from_seconds,label\na,soon,0\n", "invalid time"),
            ("a,0,0\na,2,1\n", "line 1: no column named \"episode\""),
            (
                "# x\nepisode;from_seconds;label\na;0;0\n",
                "line 2: the columns are separated by \";\"",
            ),
            (
                "episode\tfrom_seconds\tlabel\na\t0\t0\n",
                "separated by \"\\t\"",
            ),
            ("episode,from_seconds\na,0\n", "no column named \"label\""),
            (
                "label,episode,from_seconds,label\n0,a,0,0\n",
                "occurs twice",
            ),
            (
                "episode,from_seconds,label\na,0\n",
                "line 2: the column label is empty",
            ),
            (
                "episode,from_seconds,label\na,0,0\na.h5,0,1\n",
                "use one name",
            ),
            (
                "# by hand\nepisode,from_seconds,label\na,0,0\n\n# the second\n\"b\",1,9\n",
                "line 6",
            ),
        ] {
            std::fs::write(&path, text).unwrap();
            let problem = format!("{:#}", Corrections::read(&path).unwrap_err());
            assert!(problem.contains(words), "{problem}");
        }
    }

    #[test]
    fn columns_of_corrections_are_found_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("labels.csv");
        let read = |text: &[u8]| {
            std::fs::write(&path, text).unwrap();
            Corrections::read(&path)
        };
        let wanted = [
            Segment { from: 0, label: 2 },
            Segment {
                from: 8_700_000_000,
                label: 1,
            },
        ];
        for text in [
            "episode,from_seconds,label\na,0,2\na,8.7,1\n",
            "name,label,episode,by,from_seconds\nx,2,a,me,0\nx,1,a,me,8.7\n",
            "\u{feff}episode , from_seconds,\"label\"\r\na.h5,0,2\r\na.h5,8.7,1\r\n",
        ] {
            let read = read(text.as_bytes()).unwrap();
            assert_eq!(read.apply("a", 0, Vec::new()), wanted, "{text}");
            read.check_episodes(|label| label == "a").unwrap();
            let error = read
                .check_episodes(|label| label == "b")
                .unwrap_err()
                .to_string();
            assert!(error.contains("line 2: no recording named \"a"), "{error}");
        }
        let wide: Vec<u8> = "\u{feff}episode,from_seconds,label\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        let error = format!("{:#}", read(&wide).unwrap_err());
        assert!(error.contains("line 1: the text is UTF-16"), "{error}");
        let error = format!(
            "{:#}",
            read(b"episode,from_seconds,label\na,0,0\n#\xe9\n").unwrap_err()
        );
        assert!(error.contains("line 3: the text is not UTF-8"), "{error}");
    }
}
