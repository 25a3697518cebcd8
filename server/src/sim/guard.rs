//! Limits the damage of a broken simulation to one episode: panics of the physics are
//! caught, and an implausible state stops the simulation until the next reset.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use wheelarm_proto::check::Number;

use super::{SimError, Simulation, Step};
use crate::people::person_part;
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::snapshot::{Anomaly, BodyRef, Fault, Snapshot};

/// Runs `work` and returns the message of a panic. Values changed by `work` must not be
/// used after a panic.
///
/// # Errors
/// The message of the panic.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| {
        let text = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied());
        text.unwrap_or("without message")
            .chars()
            .take(400)
            .collect()
    })
}

impl Simulation {
    /// Why the state is broken: no further step runs, and the last good state remains
    /// readable. `None` for a good state.
    #[must_use]
    pub fn broken(&self) -> Option<&str> {
        self.broken.as_ref().map(|(_, words)| words.as_str())
    }

    /// Why the state is broken.
    #[must_use]
    pub fn fault(&self) -> Option<&Fault> {
        self.broken.as_ref().map(|(fault, _)| fault)
    }

    /// Stops the simulation; `last` is the newest good state.
    pub(super) fn break_off(&mut self, fault: Fault, last: Arc<Snapshot>) -> Step {
        let words = fault_words(&fault, &self.model, &self.scene);
        self.snapshot = last;
        self.evaluation.void();
        self.broken = Some((fault, words));
        Step::default()
    }
}

/// Checks a newly created world.
///
/// # Errors
/// [`SimError::Broken`] with a description.
pub(super) fn check_new(
    fault: Option<Fault>,
    model: &RobotModel,
    scene: &Scene,
) -> Result<(), SimError> {
    match fault {
        None => Ok(()),
        Some(fault) => Err(SimError::Broken(fault_words(&fault, model, scene))),
    }
}

fn name(body: BodyRef, model: &RobotModel, scene: &Scene) -> String {
    let name = match body {
        BodyRef::Link(i) => model.links.get(i).map(|l| &l.name),
        BodyRef::Object(i) => scene.objects.get(i).map(|b| &b.name),
        BodyRef::Furniture(i) => scene.furniture.get(i).map(|b| &b.name),
        BodyRef::Person(i) => return person_part(i),
    };
    name.cloned().unwrap_or_default()
}

/// Describes a fault.
#[must_use]
pub fn fault_words(fault: &Fault, model: &RobotModel, scene: &Scene) -> String {
    let name = |body| name(body, model, scene);
    let object = |i: usize| name(BodyRef::Object(i));
    match fault {
        Fault::NotFinite(body) => format!("the state of {} is not finite", name(*body)),
        Fault::JointSpeed { joint, speed, most } => {
            let joint = model.joints.get(*joint).map_or("a joint", |j| &j.name);
            format!("{joint} turns at {speed:.1} rad/s, the limit is {most:.1}")
        }
        Fault::Contact {
            first,
            second,
            force,
        } => format!(
            "{} and {} press with {force:.3e} N, the limit is {:.0e}",
            name(*first),
            name(*second),
            crate::world::health::CONTACT_FORCE
        ),
        Fault::NodeSpeed { object: i, speed } => format!(
            "a node of {} moves at {speed:.3e} m/s, the limit is {}",
            object(*i),
            crate::world::health::NODE_SPEED
        ),
        Fault::Energy { object: i, energy } => format!(
            "{} has an energy of {energy:.3e} J, the limit is {}",
            object(*i),
            crate::world::health::SOFT_ENERGY
        ),
        Fault::Outside { at } => {
            let [x, y, z] = [at.x, at.y, at.z].map(|x| Number((x * 1e2).round() / 1e2));
            format!("the chair is at ({x}, {y}, {z}) m: outside the home, or above the floor")
        }
        Fault::Panic(words) => format!("the simulation panicked: {words}"),
    }
}

/// Describes an anomaly.
#[must_use]
pub fn anomaly_words(anomaly: &Anomaly, model: &RobotModel, scene: &Scene) -> String {
    match anomaly {
        Anomaly::NotFinite(body) => {
            format!("the state of {} is not finite", name(*body, model, scene))
        }
        Anomaly::Escaped(body) => {
            format!("the state of {} left the house", name(*body, model, scene))
        }
        Anomaly::Fast(joint) => {
            let joint = model.joints.get(*joint).map_or("a joint", |j| &j.name);
            format!("{joint} turns faster than twice its limit")
        }
    }
}
