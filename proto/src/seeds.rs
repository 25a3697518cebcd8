//! Purposes of seeds, which keep training and test data apart.
//!
//! One table for every program: `collect` and `evaluate` reject plans and splits that
//! mix purposes, and data cards list them. Looks, sensors, sentences and robot
//! specimens use seeds derived from the scenario's, so they are disjoint where those
//! are.

use std::fmt;
use std::ops::Range;

use crate::settings::Named;

/// The next attempt at an episode has its seed plus this.
pub const ATTEMPT_STRIDE: u64 = 1_000_000;

/// Purpose of a range of seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Purpose {
    /// Development and debugging.
    Develop,
    /// Selection among checkpoints of one training.
    Checkpoint,
    /// Published results of a policy.
    PolicyClaim,
    /// Adversarial runs, and the campaign modelled on the paper.
    Adversarial,
    /// Published results of the scripted operator.
    OperatorClaim,
    /// Training.
    Train,
    /// No other purpose.
    #[default]
    Free,
}

/// The table: first seed, the one after the last, purpose.
const TABLE: &[(Range<u64>, Purpose)] = &[
    (0..200, Purpose::Develop),
    (200..220, Purpose::Checkpoint),
    (500..700, Purpose::PolicyClaim),
    (1000..1200, Purpose::Adversarial),
    (5000..9000, Purpose::Adversarial),
    (9000..9200, Purpose::OperatorClaim),
    (10_000..ATTEMPT_STRIDE, Purpose::Train),
];

impl Named for Purpose {
    const WHAT: &'static str = "purpose";
    const ALL: &'static [Self] = &[
        Self::Develop,
        Self::Checkpoint,
        Self::PolicyClaim,
        Self::Adversarial,
        Self::OperatorClaim,
        Self::Train,
        Self::Free,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Develop => "develop",
            Self::Checkpoint => "checkpoint",
            Self::PolicyClaim => "policy-claim",
            Self::Adversarial => "adversarial",
            Self::OperatorClaim => "operator-claim",
            Self::Train => "train",
            Self::Free => "free",
        }
    }
}

impl Purpose {
    /// Purpose of `seed`. Later attempts have the purpose of the first.
    #[must_use]
    pub fn of_seed(seed: u64) -> Self {
        let first = seed % ATTEMPT_STRIDE;
        let row = TABLE.iter().find(|(range, _)| range.contains(&first));
        row.map_or(Self::Free, |(_, purpose)| *purpose)
    }

    /// The single purpose of `seeds`; `Free` for an empty range.
    ///
    /// # Errors
    /// [`MixedPurposes`] when there are several.
    pub fn of_range(seeds: Range<u64>) -> Result<Self, MixedPurposes> {
        let Some(last) = seeds.end.checked_sub(1).filter(|last| *last >= seeds.start) else {
            return Ok(Self::Free);
        };
        let purpose = Self::of_seed(seeds.start);
        let edge = seeds.start + purpose.seeds_left(seeds.start);
        if last < edge {
            return Ok(purpose);
        }
        Err(MixedPurposes {
            seeds,
            edge,
            purposes: [purpose, Self::of_seed(edge)],
        })
    }

    /// Seeds from `seed` to the end of its row of the table.
    fn seeds_left(self, seed: u64) -> u64 {
        let first = seed % ATTEMPT_STRIDE;
        let mut edges = TABLE.iter().flat_map(|(range, _)| [range.start, range.end]);
        edges.find(|edge| *edge > first).unwrap_or(ATTEMPT_STRIDE) - first
    }

    /// The seeds of this purpose, first attempts, as text: `1000..1200, 5000..9000`.
    #[must_use]
    pub fn seeds(self) -> String {
        let rows = TABLE.iter().filter(|(_, purpose)| *purpose == self);
        let words: Vec<String> = rows
            .map(|(range, _)| format!("{}..{}", range.start, range.end))
            .collect();
        if words.is_empty() {
            "all others".to_owned()
        } else {
            words.join(", ")
        }
    }
}

/// Seeds of several purposes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MixedPurposes {
    seeds: Range<u64>,
    edge: u64,
    purposes: [Purpose; 2],
}

impl fmt::Display for MixedPurposes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [before, after] = self.purposes;
        write!(
            f,
            "seeds {}..{} are for two purposes: below {} for {}, from there for {}; keep to one \
             of them (train: {})",
            self.seeds.start,
            self.seeds.end,
            self.edge,
            before.name(),
            after.name(),
            Purpose::Train.seeds()
        )
    }
}

impl std::error::Error for MixedPurposes {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_in_order_and_disjoint() {
        for pair in TABLE.windows(2) {
            assert!(pair[0].0.end <= pair[1].0.start, "{pair:?}");
        }
    }

    #[test]
    fn later_attempts_have_the_purpose_of_the_first() {
        for (seed, purpose) in [
            (0, Purpose::Develop),
            (199, Purpose::Develop),
            (200, Purpose::Checkpoint),
            (220, Purpose::Free),
            (699, Purpose::PolicyClaim),
            (1199, Purpose::Adversarial),
            (9199, Purpose::OperatorClaim),
            (9999, Purpose::Free),
            (10_000, Purpose::Train),
            (999_999, Purpose::Train),
        ] {
            for attempt in 0..3 {
                let seed = seed + attempt * ATTEMPT_STRIDE;
                assert_eq!(Purpose::of_seed(seed), purpose, "{seed}");
            }
        }
    }

    #[test]
    fn a_range_has_one_purpose_or_an_error_names_the_boundary() {
        assert_eq!(Purpose::of_range(500..700), Ok(Purpose::PolicyClaim));
        assert_eq!(Purpose::of_range(220..500), Ok(Purpose::Free));
        assert_eq!(Purpose::of_range(3..3), Ok(Purpose::Free));
        let end = ATTEMPT_STRIDE;
        assert_eq!(Purpose::of_range(10_000..end), Ok(Purpose::Train));
        for (seeds, edge) in [(0..201, 200), (400..501, 500), (10_000..end + 1, end)] {
            let problem = Purpose::of_range(seeds).unwrap_err();
            assert_eq!(problem.edge, edge);
            assert!(problem.to_string().contains("10000..1000000"), "{problem}");
        }
        // Two rows of one purpose with others between.
        assert!(Purpose::of_range(1000..5001).is_err());
    }
}
