//! Segments as a table that people can correct and hand back:
//! `episode,from_seconds,label,name`, one line per segment, seconds from the
//! start of the episode. Only episode, from_seconds and label are read.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, bail};

use super::{NAMES, Segment};

/// Corrected segments by the label of the episode, times from its start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Corrections(BTreeMap<String, Vec<Segment>>);

impl Corrections {
    /// Reads a table.
    ///
    /// # Errors
    /// When a line is none, names no label, or times do not rise.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("{} cannot be read", path.display()))?;
        // The lines that say something, with their numbers: the parser counts no others.
        let (numbers, lines): (Vec<usize>, Vec<&str>) = (1..)
            .zip(text.lines())
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
            .unzip();
        let lines = lines.join("\n");
        let mut table = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(lines.as_bytes());
        let mut all: BTreeMap<String, Vec<Segment>> = BTreeMap::new();
        for (record, line) in table.records().enumerate() {
            let begins = match &line {
                Ok(line) => line.position().map(csv::Position::line),
                Err(problem) => problem.position().map(csv::Position::line),
            };
            let begins = begins.map_or(record + 1, |line| (line as usize).saturating_sub(1));
            let number = numbers.get(begins).copied().unwrap_or_default();
            let place = || format!("{}, line {number}", path.display());
            let line = line.with_context(place)?;
            let cell = |i: usize| line.get(i).unwrap_or_default();
            let seconds: f64 = cell(1)
                .parse()
                .with_context(|| format!("{}: {:?} is no time in seconds", place(), cell(1)))?;
            let label: u8 = cell(2)
                .parse()
                .ok()
                .filter(|&l| usize::from(l) < NAMES.len())
                .with_context(|| format!("{}: {:?} is no label from 0 to 3", place(), cell(2)))?;
            if !(0.0..1e7).contains(&seconds) {
                bail!("{}: {seconds} s lies outside of any episode", place());
            }
            let segments = all.entry(cell(0).to_owned()).or_default();
            let from = (seconds * 1e9).round() as u64;
            if segments.last().is_some_and(|last| last.from >= from) {
                bail!(
                    "{}: {seconds} s is not later than the segment before",
                    place()
                );
            }
            segments.push(Segment { from, label });
        }
        Ok(Self(all))
    }

    /// The corrected segments of an episode that starts at `start`, else those
    /// that the rule found.
    #[must_use]
    pub fn apply(&self, episode: &str, start: u64, found: Vec<Segment>) -> Vec<Segment> {
        match self.0.get(episode) {
            Some(own) => own
                .iter()
                .map(|s| Segment {
                    from: s.from + start,
                    label: s.label,
                })
                .collect(),
            None => found,
        }
    }

    /// Episodes that it names.
    pub fn episodes(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }
}

/// Writes segments of several episodes: (label, start in nanoseconds, segments).
///
/// # Errors
/// Those of the writer.
pub fn write(to: impl Write, episodes: &[(String, u64, Vec<Segment>)]) -> anyhow::Result<()> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record(["episode", "from_seconds", "label", "name"])?;
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
            ("episode,from_seconds,label\na,soon,0\n", "no time"),
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
}
