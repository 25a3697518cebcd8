//! From what everything in an episode is drawn, and numbers from it.

/// From what everything in an episode is drawn: its scenario's seed, and which of the
/// episodes with that scene it is, from 0. They have another sentence each, and look,
/// sensors, specimen, disturbances and operator of their own: a scene that is said
/// three times is done in three ways.
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
    /// Seed of what the episodes with one scene do not share: the scenario's for the
    /// first of them.
    #[must_use]
    pub fn own(self) -> u64 {
        match self.sentence {
            0 => self.scene,
            sentence => mixed(self.scene ^ mixed(u64::from(sentence))),
        }
    }
}

pub use wheelarm_proto::random::splitmix64 as mixed;
