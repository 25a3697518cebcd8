//! Saving and restoring a simulation, bit for bit.
//!
//! A stored state may be damaged or forged: the envelope is checked, then every body,
//! and then a copy runs for [`TRIAL`] control ticks. On any error the simulation is
//! unchanged.

use serde::{Deserialize, Serialize};
use wheelarm_proto::PHYSICS_VERSION;

use super::error::StateError;
use super::guard::{caught, fault_words};
use super::{Simulation, envelope};
use crate::robot::control::ControlInput;
use crate::robot::control::ControlState;
use crate::sensors::imu::Imu;
use crate::sensors::odometry::Odometry;
use crate::snapshot::{Fault, Snapshot};
use crate::tasks::{Evaluation, EvaluatorState};
use crate::world::{World, WorldError};

#[derive(Serialize, Deserialize)]
struct Stored {
    /// First, so that it can be decoded in any version.
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

/// How a world loads a state: validated, or unchecked.
type LoadState = fn(&mut World, &[u8]) -> Result<(), WorldError>;

/// Control ticks of the trial run of a stored state.
const TRIAL: usize = 8;

impl Simulation {
    /// Serializes everything that the next step depends on.
    ///
    /// # Errors
    /// When the state is broken.
    pub fn save(&self) -> Result<Vec<u8>, StateError> {
        if self.shown {
            return Err(StateError::Shown);
        }
        match self.broken() {
            Some(words) => Err(StateError::Broken(words.to_owned())),
            None => Ok(envelope::seal(&self.content())),
        }
    }

    fn content(&self) -> Vec<u8> {
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
    /// [`StateError`] when the bytes are damaged or of another scenario; the simulation
    /// is unchanged.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        let content = envelope::open(bytes).map_err(StateError::Format)?;
        let own = self.content();
        let displayed = (
            std::sync::Arc::clone(&self.snapshot),
            self.evaluation.clone(),
            self.broken.clone(),
        );
        let taken = caught(|| {
            self.take(content, World::restore)?;
            self.try_out()?;
            self.take(content, World::put_back)
        });
        let problem = match taken {
            Ok(Ok(())) => return Ok(()),
            Ok(Err(problem)) => problem,
            Err(words) => StateError::Panics(words),
        };
        let put_back = self.take(&own, World::put_back);
        (self.snapshot, self.evaluation, self.broken) = displayed;
        if self.broken.is_none() {
            put_back?;
        }
        Err(problem)
    }

    /// Runs the trial without commands.
    fn try_out(&mut self) -> Result<(), StateError> {
        let damaged = |what: &str| Err(StateError::Damaged(format!("{what} is not finite")));
        for _ in 0..TRIAL {
            let step = self.step(&ControlInput::default());
            match self.fault() {
                Some(Fault::Panic(words)) => return Err(StateError::Panics(words.clone())),
                // A state that soon breaks is still valid: a user may want to inspect
                // it.
                Some(_) => return Ok(()),
                None => {}
            }
            let vectors = step
                .imu
                .iter()
                .flat_map(|s| [s.angular_velocity, s.linear_acceleration]);
            if !vectors.flat_map(|v| [v.x, v.y, v.z]).all(f64::is_finite) {
                return damaged("a measurement of the IMU");
            }
        }
        let o = &self.odometry;
        let odometry = [o.position[0], o.position[1], o.heading, o.linear, o.angular];
        if !odometry.into_iter().all(f64::is_finite) {
            return damaged("the odometry");
        }
        let hand = self.control.desired_pose();
        let (t, r) = (hand.translation.vector, hand.rotation.coords);
        if !t.iter().chain(r.iter()).all(|x| x.is_finite()) {
            return damaged("the goal of the arm");
        }
        Ok(())
    }

    fn take(&mut self, content: &[u8], put: LoadState) -> Result<(), StateError> {
        let damaged = |e: postcard::Error| StateError::Format(e.to_string());
        let (found, _) = postcard::take_from_bytes::<u32>(content).map_err(damaged)?;
        if found != PHYSICS_VERSION {
            return Err(StateError::Version { found });
        }
        let (stored, rest) = postcard::take_from_bytes::<Stored>(content).map_err(damaged)?;
        if !rest.is_empty() {
            let found = format!("{} bytes follow its end", rest.len());
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
        put(&mut self.world, &stored.world)?;
        if let Some(fault) = self.world.fault() {
            let words = fault_words(&fault, &self.model, &self.scene);
            return Err(StateError::Damaged(words));
        }
        self.control.restore(stored.control);
        self.imu = stored.imu;
        self.odometry = stored.odometry;
        self.broken = None;
        self.evaluation = Evaluation::default();
        self.snapshot = std::sync::Arc::<Snapshot>::new(self.world.snapshot());
        if let (Some(evaluator), Some(state)) = (&mut self.evaluator, stored.evaluator) {
            evaluator.restore(state);
            // A copy evaluates the same state again; the original must not.
            self.evaluation = evaluator.clone().update(&self.snapshot);
        }
        Ok(())
    }
}
