//! Labels as CSV tables for people.

use std::io::Write;

use super::labels::Annotations;
use super::questions::KINDS;

/// Writes the phases of several episodes: (label, start in nanoseconds, labels).
///
/// # Errors
/// Those of the writer.
pub fn write_subtasks(to: impl Write, all: &[(String, u64, Annotations)]) -> anyhow::Result<()> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record([
        "episode",
        "from_seconds",
        "to_seconds",
        "label",
        "subtask",
        "object",
        "place",
        "held",
    ])?;
    for (episode, start, annotations) in all {
        for s in &annotations.subtasks {
            let seconds = |t: u64| format!("{:.6}", t.saturating_sub(*start) as f64 * 1e-9);
            let (from, to, label) = (seconds(s.from), seconds(s.to), s.label.to_string());
            table.write_record([
                episode, &from, &to, &label, &s.text, &s.object, &s.place, &s.held,
            ])?;
        }
    }
    table.flush()?;
    Ok(())
}

/// Writes questions and answers of several episodes.
///
/// # Errors
/// Those of the writer.
pub fn write_questions(to: impl Write, all: &[(String, u64, Annotations)]) -> anyhow::Result<()> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record([
        "episode",
        "tick",
        "kind",
        "question",
        "answer",
        "arguments",
        "value",
        "cameras",
    ])?;
    for (episode, _, annotations) in all {
        for q in &annotations.questions {
            let (tick, arguments, value) = (
                q.tick.to_string(),
                q.arguments.to_string(),
                q.value.to_string(),
            );
            table.write_record([
                episode,
                &tick,
                KINDS[q.kind],
                &q.question,
                &q.answer,
                &arguments,
                &value,
                &q.cameras.join(" "),
            ])?;
        }
    }
    table.flush()?;
    Ok(())
}
