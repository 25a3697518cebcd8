//! Errors while setting up a simulation or restoring a stored state.

use super::scenario::ScenarioError;
use crate::robot::RobotError;
use crate::scene::SceneError;
use crate::sensors::models::SensorError;
use crate::world::WorldError;

/// Why a simulation cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// Invalid scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// Invalid robot description.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// Invalid scene or task.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Error of the physics.
    #[error(transparent)]
    World(#[from] WorldError),
    /// Invalid stored state.
    #[error(transparent)]
    State(#[from] StateError),
    /// Invalid sensor models.
    #[error(transparent)]
    Sensors(#[from] SensorError),
    /// A scenario that is broken at its start.
    #[error("the scenario cannot be simulated: {0}; correct the poses of `start` and `objects`")]
    Broken(String),
    /// A scenario in which the simulation panics.
    #[error(
        "the scenario cannot be simulated, setting it up panicked: {0}; please report it with the scenario"
    )]
    Panicked(String),
    /// A robot without a seat.
    #[error(
        "the robot {0:?} has no seat for a person; give its robot.toml a table [seat], or person.body = \"none\""
    )]
    NoSeat(String),
    /// A placement of an unknown object.
    #[error("the scenario places {name:?}, but scene {scene:?} has the objects {known}")]
    Object {
        /// The object.
        name: String,
        /// The scene.
        scene: String,
        /// Available objects.
        known: String,
    },
    /// Overlapping placements.
    #[error(
        "the scenario places {one:?} and {other:?} overlapping by {:.0} mm; move one of them, or leave them out to sample them",
        .depth * 1e3
    )]
    Overlap {
        /// An object.
        one: String,
        /// Another object.
        other: String,
        /// Overlap, metres.
        depth: f64,
    },
    /// A start pose of the robot inside another body.
    #[error(
        "the scenario starts with the robot's {link:?} {:.0} mm inside {other:?}: change `start` or \
         `arm_positions`, or leave them out and the server draws free ones",
        .depth * 1e3
    )]
    RobotOverlap {
        /// Link of the robot.
        link: String,
        /// The other body.
        other: String,
        /// Overlap, metres.
        depth: f64,
    },
    /// An unknown variant of the area.
    #[error(
        "the scenario requests the variant {name:?}, but the task {task:?} is possible in {known}"
    )]
    Variant {
        /// The variant.
        name: String,
        /// The task.
        task: String,
        /// Variants in which it is possible.
        known: String,
    },
    /// No reachable start exists.
    #[error(
        "no start anywhere with a path to the area {area:?} exists for the seed {seed}; \
         use another seed, or `starts = \"near\"`"
    )]
    NoStart {
        /// The area.
        area: String,
        /// The scenario's seed.
        seed: u64,
    },
    /// No scene in which every target can be grasped.
    #[error(
        "no scene of the area {area:?} in which every target can be grasped was found for the seed {seed}; \
         use another seed, or set `objects`"
    )]
    NoRoom {
        /// The area.
        area: String,
        /// The scenario's seed.
        seed: u64,
    },
    /// No place of a target within the arm's reach.
    #[error(
        "no place in the area {area:?} for the seed {seed} is in the arm's reach from floor that the chair gets to; \
         clear the floor before it, name another task, or set `draws = 1`"
    )]
    NoReach {
        /// The area.
        area: String,
        /// The scenario's seed.
        seed: u64,
    },
    /// No sentence in a language split.
    #[error(
        "the grammar has no sentence of the split {split:?} for the task {task:?} in this scene; \
         take another seed, or the split \"any\""
    )]
    NoSentence {
        /// The task.
        task: String,
        /// The split.
        split: &'static str,
    },
    /// An unknown furniture joint.
    #[error("the scenario sets the slide {name:?}, but scene {scene:?} has the joints {known}")]
    Slide {
        /// The joint.
        name: String,
        /// The scene.
        scene: String,
        /// Available joints.
        known: String,
    },
}

impl SimError {
    /// Whether another seed may succeed: the error is in a sample of the scenario, not
    /// in the request. In campaigns over homes the seed selects the home, and a home need not
    /// offer every task.
    #[must_use]
    pub fn is_of_one_draw(&self) -> bool {
        matches!(
            self,
            Self::Broken(_)
                | Self::Panicked(_)
                | Self::NoStart { .. }
                | Self::NoReach { .. }
                | Self::NoRoom { .. }
                | Self::NoSentence { .. }
                | Self::Overlap { .. }
                | Self::RobotOverlap { .. }
                | Self::Scene(SceneError::NotOffered { .. })
        )
    }
}

/// Why a stored state cannot be restored.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// Damaged bytes.
    #[error(
        "the stored state cannot be read ({0}); it is damaged, or no stored state: \
         take it from the recording or from the query `snapshot` again"
    )]
    Format(String),
    /// Another version of the physics.
    #[error(
        "the stored state is of physics version {found}, this server has version {}: it would \
         compute other bits; restore it with a server of version {found}, or record anew",
        wheelarm_proto::PHYSICS_VERSION
    )]
    Version {
        /// Version of the state.
        found: u32,
    },
    /// Rejected by the physics.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The physics panics in it.
    #[error("the stored state is damaged: the physics panics in it ({0}); take another copy of it")]
    Panics(String),
    /// It contains an impossible value.
    #[error("the stored state is damaged: {0}; take another copy of it")]
    Damaged(String),
    /// A broken state cannot be stored.
    #[error("the state is broken and is not stored: {0}; request `reset`")]
    Broken(String),
    /// Recorded states are played back, so a simulated state does not exist.
    #[error("recorded states are played back; none of them can be continued")]
    Shown,
    /// It belongs to another scenario.
    #[error(
        "the stored state is of {stored}, but the scenario has {expected}; restore it with its own scenario"
    )]
    Scenario {
        /// Value in the state.
        stored: String,
        /// Value in the scenario.
        expected: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_home_without_the_task_is_one_draw_and_a_wrong_file_is_not() {
        let not_offered = SceneError::NotOffered {
            task: "take_mug_in_kitchen".into(),
            missing: "no place in a kitchen".into(),
            scene: "studio-nordic-3".into(),
            available: "kitchens: none".into(),
        };
        assert!(SimError::from(not_offered).is_of_one_draw());
        let malformed = SceneError::Value {
            file: "scenes/home.toml".into(),
            key: "start".into(),
            found: "x".into(),
            expected: "a pose".into(),
            cure: "correct it".into(),
        };
        assert!(!SimError::from(malformed).is_of_one_draw());
    }
}
