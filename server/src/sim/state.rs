//! Saving and restoring a simulation, bit by bit.

use serde::{Deserialize, Serialize};

use super::Simulation;
use crate::robot::control::ControlState;
use crate::sensors::imu::Imu;
use crate::sensors::odometry::Odometry;
use crate::snapshot::Snapshot;
use crate::tasks::EvaluatorState;

/// Why a stored state cannot be continued.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// Another layout or damaged bytes.
    #[error(
        "the stored state cannot be read ({0}); it comes from another version or is damaged: \
         replay with the server version that the recording names"
    )]
    Format(String),
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
    version: u32,
    scene: String,
    task: String,
    robot: String,
    world: Vec<u8>,
    control: ControlState,
    imu: Imu,
    odometry: Odometry,
    evaluator: Option<EvaluatorState>,
}

const VERSION: u32 = 1;

impl Simulation {
    /// Everything that the next step depends on, as bytes.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        let stored = Stored {
            version: VERSION,
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
        let stored: Stored =
            postcard::from_bytes(bytes).map_err(|e| StateError::Format(e.to_string()))?;
        if stored.version != VERSION {
            let found = format!("layout version {}, expected {VERSION}", stored.version);
            return Err(StateError::Format(found));
        }
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
