//! Saving and restoring a simulation, bit by bit.

use serde::{Deserialize, Serialize};
use wheelarm_proto::PHYSICS_VERSION;

use super::Simulation;
use crate::robot::control::ControlState;
use crate::sensors::imu::Imu;
use crate::sensors::odometry::Odometry;
use crate::snapshot::Snapshot;
use crate::tasks::EvaluatorState;

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
    World(#[from] crate::world::WorldError),
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

#[derive(Serialize, Deserialize)]
struct Stored {
    /// First, so that it can be read whatever follows.
    physics_version: u32,
    scene: String,
    task: String,
    robot: String,
    world: Vec<u8>,
    control: ControlState,
    imu: Imu,
    odometry: Odometry,
    evaluator: Option<EvaluatorState>,
}

impl Simulation {
    /// Everything that the next step depends on, as bytes.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        let stored = Stored {
            physics_version: PHYSICS_VERSION,
            scene: self.scenario.scene.clone(),
            task: self.scenario.task.clone(),
            robot: self.scenario.robot.clone(),
            world: self.world.save(),
            control: self.control.state().clone(),
            imu: self.imu.clone(),
            odometry: self.odometry.clone(),
            evaluator: self.evaluator.as_ref().map(|e| e.state().clone()),
        };
        // Serialising plain data into memory cannot fail.
        postcard::to_stdvec(&stored).unwrap_or_default()
    }

    /// Continues from bytes of [`Simulation::save`] of the same scenario.
    ///
    /// # Errors
    /// [`StateError`] when the bytes are damaged or of another scenario.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        let damaged = |e: postcard::Error| StateError::Format(e.to_string());
        let (found, _) = postcard::take_from_bytes::<u32>(bytes).map_err(damaged)?;
        if found != PHYSICS_VERSION {
            return Err(StateError::Version { found });
        }
        let stored: Stored = postcard::from_bytes(bytes).map_err(damaged)?;
        let name = |a: &str, b: &str, c: &str| format!("scene {a:?}, task {b:?}, robot {c:?}");
        let found = name(&stored.scene, &stored.task, &stored.robot);
        let scenario = &self.scenario;
        let expected = name(&scenario.scene, &scenario.task, &scenario.robot);
        if found != expected {
            return Err(StateError::Scenario {
                stored: found,
                expected,
            });
        }
        self.world.restore(&stored.world)?;
        self.control.restore(stored.control);
        self.imu = stored.imu;
        self.odometry = stored.odometry;
        self.snapshot = std::sync::Arc::<Snapshot>::new(self.world.snapshot());
        if let (Some(evaluator), Some(state)) = (&mut self.evaluator, stored.evaluator) {
            evaluator.restore(state);
            // A copy looks once more at the same state; the judge itself must not.
            self.evaluation = evaluator.clone().update(&self.snapshot);
        }
        Ok(())
    }
}
