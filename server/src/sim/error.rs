//! Why a simulation cannot be set up, or a stored state not be continued.

use super::scenario::ScenarioError;
use crate::robot::RobotError;
use crate::scene::SceneError;
use crate::sensors::models::SensorError;
use crate::world::WorldError;

/// What can be wrong when a simulation is set up.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The robot description.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The scene or the task.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The physics.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A stored state.
    #[error(transparent)]
    State(#[from] StateError),
    /// The sensor models.
    #[error(transparent)]
    Sensors(#[from] SensorError),
    /// A scenario that is broken from the start.
    #[error("the scenario cannot be simulated: {0}; correct the poses of `start` and `objects`")]
    Broken(String),
    /// A scenario in which the simulation panics.
    #[error(
        "the scenario cannot be simulated, setting it up panicked: {0}; please report it with the scenario"
    )]
    Panicked(String),
    /// A robot on which nobody sits.
    #[error(
        "the robot {0:?} has no seat for a person; give its robot.toml a table [seat], or person.body = \"none\""
    )]
    NoSeat(String),
    /// A placement of the scenario.
    #[error("the scenario places {name:?}, but scene {scene:?} has the objects {known}")]
    Object {
        /// The object.
        name: String,
        /// The scene.
        scene: String,
        /// The objects that there are.
        known: String,
    },
    /// Placements of the scenario that cannot be side by side.
    #[error(
        "the scenario places {one:?} and {other:?} into each other by {:.0} mm; move one of them, or leave them out and they are drawn",
        .depth * 1e3
    )]
    Overlap {
        /// An object.
        one: String,
        /// Another object.
        other: String,
        /// How far, metres.
        depth: f64,
    },
    /// A start pose of the robot inside of something.
    #[error(
        "the scenario starts with the robot's {link:?} {:.0} mm inside {other:?}: change `start` or \
         `arm_positions`, or leave them out and the server draws free ones",
        .depth * 1e3
    )]
    RobotOverlap {
        /// Link of the robot.
        link: String,
        /// What it is in.
        other: String,
        /// How far, metres.
        depth: f64,
    },
    /// A variant of the area.
    #[error("the scenario asks for the variant {name:?}, but the task {task:?} is done in {known}")]
    Variant {
        /// The variant.
        name: String,
        /// The task.
        task: String,
        /// The variants in which it can be done.
        known: String,
    },
    /// No start anywhere.
    #[error(
        "with the seed {seed} there is no start anywhere from which a way leads to the area {area:?}; \
         take another seed, or `starts = \"near\"`"
    )]
    NoStart {
        /// The area.
        area: String,
        /// The scenario's seed.
        seed: u64,
    },
    /// No scene in which everything can be taken.
    #[error(
        "with the seed {seed} no scene of the area {area:?} was found in which everything can be taken; \
         take another seed, or tell `objects`"
    )]
    NoRoom {
        /// The area.
        area: String,
        /// The scenario's seed.
        seed: u64,
    },
    /// A sentence of a split.
    #[error(
        "the grammar has no sentence of the split {split:?} for the task {task:?} in this scene; \
         take another seed, or the split \"any\""
    )]
    Unsaid {
        /// The task.
        task: String,
        /// The split.
        split: &'static str,
    },
    /// A furniture joint of the scenario.
    #[error("the scenario sets the slide {name:?}, but scene {scene:?} has the joints {known}")]
    Slide {
        /// The joint.
        name: String,
        /// The scene.
        scene: String,
        /// The joints that there are.
        known: String,
    },
}

impl SimError {
    /// Whether another seed may do: what is wrong lies in one draw of the scenario, not
    /// in what was asked for.
    #[must_use]
    pub fn is_of_one_draw(&self) -> bool {
        matches!(
            self,
            Self::Broken(_)
                | Self::Panicked(_)
                | Self::NoStart { .. }
                | Self::NoRoom { .. }
                | Self::Unsaid { .. }
                | Self::Overlap { .. }
                | Self::RobotOverlap { .. }
        )
    }
}

/// Why a stored state cannot be continued.
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
        /// What the state names.
        found: u32,
    },
    /// The physics refuses it.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The physics panics in it.
    #[error("the stored state is damaged: the physics panics in it ({0}); take another copy of it")]
    Panics(String),
    /// Something in it cannot be.
    #[error("the stored state is damaged: {0}; take another copy of it")]
    Damaged(String),
    /// Nothing goes on from a broken state.
    #[error("the state is broken and is not stored: {0}; ask for `reset`")]
    Broken(String),
    /// Recorded states are shown, so there is none that goes on.
    #[error("recorded states are shown; none of them can be gone on from")]
    Shown,
    /// It belongs to another scenario.
    #[error(
        "the stored state is of {stored}, but the scenario has {expected}; restore it with its own scenario"
    )]
    Scenario {
        /// What the state names.
        stored: String,
        /// What the scenario names.
        expected: String,
    },
}
