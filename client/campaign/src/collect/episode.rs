//! The episodes of a plan: names, seeds, settings and shards, equal on every host and in
//! every run.

use std::fmt;
use std::str::FromStr;

use wheelarm_proto::seeds::ATTEMPT_STRIDE;
use wheelarm_proto::settings::Named;

use super::plan::Plan;

/// One episode of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Episode {
    /// Name of the episode and stem of its file.
    pub id: String,
    /// Task.
    pub task: String,
    /// Place in the plan, over all tasks, from 0.
    pub place: usize,
    /// Seed of the first attempt.
    pub seed: u64,
    /// Index of the sentence of its scene, if the plan uses the grammar.
    pub sentence: u32,
    /// Everything that the plan fixes about it, as one line.
    pub settings: String,
}

impl Episode {
    /// Seed of an attempt, from 0.
    #[must_use]
    pub fn seed_of(&self, attempt: u32) -> u64 {
        let stride = ATTEMPT_STRIDE.wrapping_mul(u64::from(attempt));
        self.seed.wrapping_add(stride)
    }
}

/// The episodes of a plan, in its order.
#[must_use]
pub fn episodes(plan: &Plan) -> Vec<Episode> {
    let [scene, robot, cameras, state, imu, noise, quality] = plan.variation.images_and_rates();
    let same = format!(
        "scene={scene} robot={robot} cameras={cameras} state_rate={state} imu_rate={imu} imu_noise={noise} depth={} quality={quality} operator={}",
        plan.depth.name(),
        if plan.varied_operator {
            "varied"
        } else {
            "fixed"
        },
    );
    let mut all = Vec::with_capacity(plan.episode_count());
    for task in &plan.tasks {
        for index in 0..task.episodes {
            let (scene, sentence) = match &plan.variation.language {
                Some(language) => language.place(index),
                None => (index, 0),
            };
            let seed = task.first_seed.wrapping_add(u64::from(scene));
            let varied = plan.variation.words(sentence);
            all.push(Episode {
                id: format!("{}-{index:04}", task.name),
                task: task.name.clone(),
                place: all.len(),
                seed,
                sentence,
                settings: format!("task={} seed={seed} {same}{varied}", task.name),
            });
        }
    }
    all
}

/// The part of a plan that a process makes: `I/N`, from `0/N` to `N-1/N`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of this shard, from 0.
    pub index: usize,
    /// Number of shards.
    pub count: usize,
}

impl Shard {
    /// The whole plan.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Whether this shard makes the episode. Neighbours go to different
    /// shards, so that each has a share of every task.
    #[must_use]
    pub fn has(&self, episode: &Episode) -> bool {
        episode.place % self.count == self.index
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split_once('/')
            .and_then(|(index, count)| {
                Some(Self {
                    index: index.parse().ok()?,
                    count: count.parse().ok()?,
                })
            })
            .filter(|shard| shard.index < shard.count)
            .ok_or_else(|| format!("{text:?} is not I/N from 0/N to N-1/N, for example 0/4"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_cover_every_episode_once() {
        let text = "name = \"x\"\n[[task]]\nname = \"a\"\nepisodes = 7\n[[task]]\nname = \"b\"\nepisodes = 4\n";
        let plan = Plan::parse("p.toml".as_ref(), text.to_owned()).unwrap();
        let all = episodes(&plan);
        assert_eq!((all.len(), all[8].id.as_str()), (11, "b-0001"));
        for count in [1, 2, 3, 20] {
            for episode in &all {
                let owners = (0..count).filter(|i| Shard { index: *i, count }.has(episode));
                assert_eq!(owners.count(), 1, "{} of {count}", episode.id);
            }
        }
        assert_eq!(all[8].seed_of(2), 2_000_001);
    }

    #[test]
    fn malformed_shards_are_rejected() {
        assert_eq!("1/3".parse(), Ok(Shard { index: 1, count: 3 }));
        for bad in ["", "3", "3/3", "0/0", "-1/2", "a/b"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad:?} was accepted");
        }
    }
}
