//! A file's summary for people.

use std::fmt::Write;

use crate::read::{Episode, ReadError};

/// The content of a file, as lines of text.
///
/// # Errors
/// When the file lacks a required attribute.
pub fn info(episode: &Episode) -> Result<String, ReadError> {
    let s = episode.summary()?;
    let mut out = String::new();
    let mut line = |name: &str, value: &str| {
        if !value.is_empty() {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "{name:<13} {value}");
        }
    };
    let (first, last) = s.span_nanos;
    let bytes = std::fs::metadata(episode.path()).map_or(0, |m| m.len());
    let [task, activity, area] = &s.task;
    let [server, adapter, recorder, recorder_version, quality, pacing] = &s.origin;
    line("file", &episode.path().display().to_string());
    line("size", &format!("{:.1} MB", bytes as f64 / 1e6));
    line("label", &s.label);
    line("instruction", &s.instruction);
    line(
        "task",
        &format!("{task} ({activity}, {area}), seed {}", s.seed),
    );
    line("success", if s.success { "yes" } else { "no" });
    line("failure", &s.failure_reason);
    for anomaly in &s.anomalies {
        line("anomaly", anomaly);
    }
    for (name, holds, value) in &s.conditions {
        let state = if *holds { "holds" } else { "does not hold" };
        line("", &format!("{name}: {state} ({value:.4})"));
    }
    let mut time = format!("{:.3} s simulated", (last - first) as f64 * 1e-9);
    if let Some(wall) = s.wall_seconds {
        let _ = write!(time, " in {wall:.1} s");
    }
    line("time", &time);
    line("state", if s.complete { "complete" } else { "PARTIAL" });
    if s.as_recorded {
        line(
            "as recorded",
            "its states are those of another recording, rendered again and not computed",
        );
    }
    for problem in &s.problems {
        line("", problem);
    }
    line(
        "server",
        &format!("{server}, {adapter}, quality {quality}, pacing {pacing}"),
    );
    line(
        "recorder",
        &format!("{recorder}, version {recorder_version}"),
    );
    line("depth", &s.depth_unit);
    let _ = writeln!(
        out,
        "\n{:<22} {:>9} {:>9} {:>7} {:>10}",
        "stream", "expected", "received", "missed", "recovered"
    );
    // Counts of the server are unknown without its manifest.
    let known = |counted, count: u64| match counted {
        true => count.to_string(),
        false => "?".to_owned(),
    };
    for a in &s.streams {
        let (expected, missed) = (known(a.counted, a.expected), known(a.counted, a.missed));
        let _ = writeln!(
            out,
            "{:<22} {expected:>9} {:>9} {missed:>7} {:>10}",
            a.stream, a.received, a.recovered
        );
    }
    Ok(out)
}
