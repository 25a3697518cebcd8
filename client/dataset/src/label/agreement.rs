//! The rule's labels beside the phases that the operator published.

use super::Segment;
use crate::read::{Episode, ReadError};

/// Boundaries of one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// Labels in order as published.
    pub published: Vec<Segment>,
    /// Labels in order by the rule.
    pub found: Vec<Segment>,
    /// Differences of the boundaries, seconds, found minus published; `None`
    /// when the orders differ.
    pub differences: Option<Vec<f64>>,
}

impl Agreement {
    /// Whether the order is the same and every boundary is within `seconds`.
    #[must_use]
    pub fn within(&self, seconds: f64) -> bool {
        self.differences
            .as_ref()
            .is_some_and(|d| d.iter().all(|d| d.abs() <= seconds))
    }
}

/// Compares segments with the published phases; `None` without
/// published phases.
///
/// # Errors
/// When the phase stream cannot be read.
pub fn agreement(episode: &Episode, found: &[Segment]) -> Result<Option<Agreement>, ReadError> {
    if !episode.has("phase") {
        return Ok(None);
    }
    let stamps = episode.stamps("phase")?;
    let phases = episode.u64s("phase", "label")?;
    let mut published: Vec<Segment> = Vec::new();
    for (&from, &phase) in stamps.iter().zip(&phases) {
        // 0 is "none": the work before it goes on.
        let Some(label) = phase.checked_sub(1).and_then(|p| u8::try_from(p).ok()) else {
            continue;
        };
        if published.last().is_none_or(|last| last.label != label) {
            published.push(Segment { from, label });
        }
    }
    if published.is_empty() {
        return Ok(None);
    }
    let same = published.len() == found.len()
        && published.iter().zip(found).all(|(a, b)| a.label == b.label);
    let seconds = |(p, f): (&Segment, &Segment)| (f.from as f64 - p.from as f64) * 1e-9;
    Ok(Some(Agreement {
        differences: same.then(|| published.iter().zip(found).skip(1).map(seconds).collect()),
        found: found.to_vec(),
        published,
    }))
}

/// Share of episodes whose boundaries all agree within `seconds`.
#[must_use]
pub fn share_within(all: &[Agreement], seconds: f64) -> f64 {
    let within = all.iter().filter(|a| a.within(seconds)).count();
    within as f64 / all.len().max(1) as f64
}
