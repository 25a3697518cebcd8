//! For tests: logs as earlier versions wrote them are read and resumed.

use std::fmt::Debug;

use serde_json::Value;
use wheelarm_dataset::publish;
use wheelarm_rollout::{EpisodeLog, LogEntry, read_log};

/// Opens the log `text`, whose last line is cut, and appends its first entry again. Checks
/// that no key of a line is lost and no complete line is rewritten; returns the entries.
pub fn resumed<E: LogEntry + PartialEq + Debug>(text: &str) -> Vec<E> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("episodes.jsonl");
    std::fs::write(&path, text).unwrap();
    let (complete, cut) = text.rsplit_once('\n').unwrap();
    assert!(serde_json::from_str::<Value>(cut).is_err(), "{cut}");
    let lines: Vec<&str> = complete.lines().collect();
    for line in &lines {
        let entry: E = serde_json::from_str(line).unwrap();
        let written = serde_json::to_value(&entry).unwrap();
        assert_eq!(written, serde_json::from_str::<Value>(line).unwrap());
    }
    let log = EpisodeLog::<E>::open(&path, publish::sync_data).unwrap();
    let entries = log.entries();
    assert_eq!(entries.len(), lines.len());
    log.append(&entries[0]).unwrap();
    drop(log);
    let resumed = std::fs::read_to_string(&path).unwrap();
    assert!(resumed.starts_with(&format!("{complete}\n")), "{resumed}");
    let (all, cut) = read_log::<E>(&path).unwrap();
    assert_eq!((all.len(), cut), (lines.len() + 1, vec![]));
    entries
}
