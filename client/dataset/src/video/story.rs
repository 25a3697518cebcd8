//! The text below the images: the instruction and the current phase.

use wheelarm_proto::TopicId;

use super::times::Span;
use crate::label;
use crate::read::{Episode, ReadError, Summary};

/// Something that is done from a moment on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    /// Nanoseconds of simulation time.
    pub from: u64,
    /// The phase: 0 for none, 1 navigating, 2 reaching, 3 grasping, 4 retracting.
    pub phase: u64,
    /// Text of the phase, with details where the operator published them.
    pub words: String,
}

/// Text about an episode.
#[derive(Clone, Debug)]
pub(super) struct Story {
    /// The instruction; the label of the episode without one.
    pub title: String,
    /// The shown interval.
    pub span: Span,
    parts: Vec<Part>,
}

impl Story {
    /// The phases as the operator published them, or, of a recording without them,
    /// as they follow from the movement.
    ///
    /// # Errors
    /// When a column cannot be read.
    pub fn read(episode: &Episode, summary: &Summary, span: Span) -> Result<Self, ReadError> {
        let published = published(episode)?;
        let parts = if published.iter().any(|part| part.phase > 0) {
            published
        } else {
            let segments = label::segments(episode)?.into_iter();
            let part = |s: label::Segment| Part {
                from: s.from,
                phase: u64::from(s.label) + 1,
                words: label::NAMES[usize::from(s.label).min(3)].to_owned(),
            };
            segments.map(part).collect()
        };
        let title = match summary.instruction.is_empty() {
            true => summary.label.clone(),
            false => summary.instruction.clone(),
        };
        Ok(Self { title, span, parts })
    }

    /// The phase at a moment.
    pub fn part_at(&self, moment: u64) -> Option<&Part> {
        let after = self.parts.partition_point(|part| part.from <= moment);
        self.parts[..after].last()
    }

    /// The stretches of one phase that are shown: phase, first and last moment.
    pub fn stretches(&self) -> Vec<(u64, u64, u64)> {
        let mut out: Vec<(u64, u64, u64)> = Vec::new();
        for (k, part) in self.parts.iter().enumerate() {
            let end = self.parts.get(k + 1).map_or(self.span.to, |next| next.from);
            let (from, to) = (part.from.max(self.span.from), end.min(self.span.to));
            match out.last_mut() {
                _ if from >= to => {}
                Some(last) if last.0 == part.phase => last.2 = to,
                _ => out.push((part.phase, from, to)),
            }
        }
        out
    }
}

fn published(episode: &Episode) -> Result<Vec<Part>, ReadError> {
    let stream = TopicId::Phase.name();
    let mut out: Vec<Part> = Vec::new();
    if !episode.has(stream) {
        return Ok(out);
    }
    let stamps = episode.stamps(stream)?;
    let labels = episode.u64s(stream, "label")?;
    let (phases, names) = (
        episode.texts(stream, "phase")?,
        episode.texts(stream, "name")?,
    );
    for (((from, phase), word), name) in stamps.into_iter().zip(labels).zip(phases).zip(names) {
        let words = match (word.is_empty(), name.is_empty() || name == word) {
            (_, true) => word,
            (true, false) => name,
            (false, false) => format!("{word}: {name}"),
        };
        if out
            .last()
            .is_none_or(|l| l.phase != phase || l.words != words)
        {
            out.push(Part { from, phase, words });
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_has_the_words_of_the_last_part_and_phases_are_joined() {
        let part = |from, phase, words: &str| Part {
            from,
            phase,
            words: words.to_owned(),
        };
        let story = Story {
            title: String::new(),
            span: Span {
                start: 0,
                from: 5,
                to: 40,
            },
            parts: vec![
                part(0, 0, ""),
                part(2, 1, "planning"),
                part(10, 1, "driving"),
                part(30, 2, "reaching"),
            ],
        };
        let words = |t| story.part_at(t).map(|part| part.words.as_str());
        assert_eq!(words(1), Some(""));
        assert_eq!([words(9), words(10)], [Some("planning"), Some("driving")]);
        assert_eq!(words(99), Some("reaching"));
        assert_eq!(story.stretches(), [(1, 5, 30), (2, 30, 40)]);
    }
}
