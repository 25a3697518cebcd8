//! Seed of all samples of an episode.

/// Seed of all samples of an episode: its scenario's seed and its index among the episodes
/// with that scene, from 0. These differ in sentence, appearance, sensors, specimen,
/// disturbances and operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EpisodeSeed {
    /// The scenario's seed.
    pub scene: u64,
    /// Number of the sentence.
    pub sentence: u32,
}

impl From<u64> for EpisodeSeed {
    fn from(scene: u64) -> Self {
        Self { scene, sentence: 0 }
    }
}

impl EpisodeSeed {
    /// Seed of the samples that episodes of one scene do not share; the scenario's seed for
    /// the first of them.
    #[must_use]
    pub fn own(self) -> u64 {
        match self.sentence {
            0 => self.scene,
            sentence => mixed(self.scene ^ mixed(u64::from(sentence))),
        }
    }
}

pub use wheelarm_proto::random::splitmix64 as mixed;
