//! The split of episodes into training and validation.

use std::collections::BTreeSet;

/// One of this number of groups of episodes is in the validation mask.
const VALIDATION: usize = 10;

/// Properties of an episode that determine its part.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Origin {
    pub seed: u64,
    pub area: String,
    pub task: String,
    pub label: String,
}

/// Common property of the episodes of one group of the split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grouping {
    /// The scene: area and seed.
    Scene,
    /// Scene and task.
    Task,
    /// Each episode is a group.
    Episode,
}

impl Grouping {
    /// The group of the episode `demo`.
    fn group(self, demo: usize, origin: &Origin) -> (Origin, usize) {
        let mut group = origin.clone();
        if self != Self::Episode {
            group.label.clear();
        }
        if self == Self::Scene {
            group.task.clear();
        }
        (group, if self == Self::Episode { demo } else { 0 })
    }

    /// Note for the user about a split by these groups.
    pub fn warning(self) -> Option<&'static str> {
        match self {
            Self::Scene => None,
            Self::Task => Some(
                "mask/valid holds tasks whose scene is in mask/train, because all episodes show one scene; export episodes of several seeds for a split by scenes",
            ),
            Self::Episode => Some(
                "mask/valid holds episodes whose scene and task are in mask/train, because all episodes show one task in one scene; export episodes of several seeds for a split by scenes",
            ),
        }
    }
}

/// Whether each episode is in the validation mask, and the grouping of the split; `None` for
/// fewer than two episodes.
///
/// Episodes of one scene stay together, because a scene of the training part cannot validate. If
/// all episodes show one scene, tasks are split, and if they have one task, episodes. A tenth of
/// the groups validates, at least one. A hash of the group selects it, so that the order of the
/// episodes does not matter.
pub(super) fn split(demos: &[Origin]) -> Option<(Vec<bool>, Grouping)> {
    for grouping in [Grouping::Scene, Grouping::Task, Grouping::Episode] {
        let group = |(demo, origin)| grouping.group(demo, origin);
        let groups: BTreeSet<_> = demos.iter().enumerate().map(group).collect();
        if groups.len() < 2 {
            continue;
        }
        let count = groups.len().div_ceil(VALIDATION);
        let mut ranked: Vec<_> = groups.into_iter().collect();
        ranked.sort_by_key(|(origin, _)| wheelarm_proto::random::splitmix64(origin.seed));
        ranked.truncate(count);
        let held: BTreeSet<_> = ranked.into_iter().collect();
        let validates = demos.iter().enumerate().map(group);
        return Some((
            validates.map(|group| held.contains(&group)).collect(),
            grouping,
        ));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin(seed: u64, area: &str, task: &str, label: &str) -> Origin {
        Origin {
            seed,
            area: area.to_owned(),
            task: task.to_owned(),
            label: label.to_owned(),
        }
    }

    #[test]
    fn episodes_with_one_scene_train_or_validate_together() {
        let demos: Vec<Origin> = (0..60)
            .map(|demo| {
                origin(
                    10_000 + demo / 3,
                    "table",
                    &format!("task {}", demo % 3),
                    "x",
                )
            })
            .collect();
        let (valid, grouping) = split(&demos).unwrap();
        assert_eq!(grouping, Grouping::Scene);
        assert_eq!(valid.iter().filter(|valid| **valid).count(), 6);
        assert!(
            valid
                .chunks(3)
                .all(|scene| scene.iter().all(|v| *v == scene[0]))
        );
        let backwards: Vec<Origin> = demos.into_iter().rev().collect();
        let (mut mirrored, _) = split(&backwards).unwrap();
        mirrored.reverse();
        assert_eq!(mirrored, valid);
    }

    #[test]
    fn neither_part_of_a_split_is_empty_for_two_episodes_or_more() {
        let tasks = ["a", "b", "c", "d", "e"];
        let several_tasks = tasks.map(|task| origin(5, "table", task, task)).to_vec();
        let several_areas = tasks.map(|area| origin(5, area, "a", "x")).to_vec();
        let several_labels = tasks.map(|label| origin(5, "table", "a", label)).to_vec();
        let all_alike = vec![origin(5, "table", "a", "x"); 2];
        let cases = [
            (several_tasks, Grouping::Task),
            (several_areas, Grouping::Scene),
            (several_labels, Grouping::Episode),
            (all_alike, Grouping::Episode),
        ];
        for (demos, expected) in cases {
            let (valid, grouping) = split(&demos).unwrap();
            assert_eq!(grouping, expected);
            assert_eq!(valid.iter().filter(|valid| **valid).count(), 1, "{demos:?}");
        }
        assert!(split(&[origin(5, "table", "a", "x")]).is_none());
    }
}
