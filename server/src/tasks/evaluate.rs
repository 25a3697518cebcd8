//! The judge: conditions at every control tick, success, and why it failed.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use wheelarm_proto::PHYSICS_HZ;

use super::predicate::{Memory, Predicate};
use super::spec::{FailureSpec, TaskSpec};
use crate::robot::RobotModel;
use crate::scene::{Body, Scene, SceneError};
use crate::snapshot::{Anomaly, BodyRef, Snapshot};

/// Joints whose child links carry the pads.
const PAD_JOINTS: [&str; 2] = [
    "robotiq_85_left_finger_tip_joint",
    "robotiq_85_right_finger_tip_joint",
];

/// Judges one episode of a task.
#[derive(Clone, Debug)]
pub struct Evaluator {
    conditions: Vec<(String, Predicate, bool)>,
    failure: FailureSpec,
    time_limit: f64,
    context: Context,
    state: EvaluatorState,
}

/// What predicates know about the world beside the snapshot.
#[derive(Clone, Debug)]
pub(super) struct Context {
    /// Objects of the scene.
    pub bodies: Vec<Body>,
    /// Poses in the first snapshot.
    pub starts: Vec<Isometry3<f64>>,
    /// Links that carry the pads, left and right.
    pub pads: [usize; 2],
    /// Links that roll on the floor.
    pub wheels: Vec<usize>,
    /// The target object.
    pub target: usize,
}

impl Context {
    pub(super) fn object(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|body| body.name == name)
    }
}

/// All that an evaluator remembers: save it with the world, restore it with it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorState {
    /// Tick of the first snapshot.
    start: Option<u64>,
    /// Poses of the objects in the first snapshot.
    starts: Vec<Isometry3<f64>>,
    memories: Vec<Memory>,
    /// The target has been up in the gripper.
    was_lifted: bool,
    outcome: Option<Outcome>,
}

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Outcome {
    Success,
    Failed(Failure),
}

/// Why it failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Failure {
    /// The target fell, from the gripper or from where it stood.
    Dropped,
    /// The target lies where it stood.
    Tipped,
    /// The time is over.
    Timeout,
    /// The simulation lost the target or its state is not finite.
    Lost,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Dropped => "dropped",
            Self::Tipped => "tipped",
            Self::Timeout => "timeout",
            Self::Lost => "lost",
        })
    }
}

/// State of the task after one snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// All required conditions have held at one time.
    pub success: bool,
    /// Success or failure: nothing changes any more.
    pub done: bool,
    /// Why it failed.
    pub failure: Option<Failure>,
    /// Every condition, in the order of the task file.
    pub conditions: Vec<Condition>,
    /// Simulated seconds since the first snapshot.
    pub elapsed: f64,
}

/// One condition after one snapshot.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// Predicate and object, for example `lifted_and_held(mustard)`.
    pub name: String,
    /// Whether it holds now.
    pub holds: bool,
    /// The measured quantity, SI.
    pub value: f64,
    /// Needed for success, or only reported.
    pub required: bool,
}

impl Evaluator {
    /// A judge for `spec` in `scene` with this robot.
    ///
    /// # Errors
    /// When the robot lacks a joint that conditions need, or the scene an object.
    pub fn new(spec: &TaskSpec, scene: &Scene, model: &RobotModel) -> Result<Self, SceneError> {
        let child = |name: &str| {
            let joint = model.joints.iter().find(|joint| joint.name == name);
            joint.map(|joint| joint.child)
        };
        let pad = |name: &str| {
            child(name).ok_or_else(|| {
                spec.place().key("robot").wrong(
                    format!("a model without joint {name:?}"),
                    "the finger tip joints of the gripper",
                    "use the joint names of the recorded joints in the URDF",
                )
            })
        };
        let target = scene.object_named(&spec.target).ok_or_else(|| {
            spec.place().key("target").wrong(
                format!("{:?}", spec.target),
                format!("an object of the scene {:?}", scene.name),
                "load the task's own scene",
            )
        })?;
        let mut evaluator = Self {
            conditions: spec
                .conditions
                .iter()
                .map(|c| (c.predicate.label(), c.predicate.clone(), c.required))
                .collect(),
            failure: spec.failure,
            time_limit: spec.time_limit,
            context: Context {
                bodies: scene.objects.clone(),
                starts: Vec::new(),
                pads: [pad(PAD_JOINTS[0])?, pad(PAD_JOINTS[1])?],
                wheels: model
                    .joints
                    .iter()
                    .filter(|joint| joint.name.ends_with("_wheel_joint"))
                    .map(|joint| joint.child)
                    .collect(),
                target,
            },
            state: EvaluatorState::default(),
        };
        evaluator.reset();
        Ok(evaluator)
    }

    /// Forgets everything; the next snapshot is the first.
    pub fn reset(&mut self) {
        self.restore(EvaluatorState {
            memories: vec![Memory::default(); self.conditions.len()],
            ..EvaluatorState::default()
        });
    }

    /// What it remembers.
    #[must_use]
    pub fn state(&self) -> &EvaluatorState {
        &self.state
    }

    /// Goes on from a state of the same task and scene.
    pub fn restore(&mut self, state: EvaluatorState) {
        self.context.starts.clone_from(&state.starts);
        self.state = state;
        self.state
            .memories
            .resize(self.conditions.len(), Memory::default());
    }

    /// Judges the next snapshot; called once per control tick.
    pub fn update(&mut self, snapshot: &Snapshot) -> Evaluation {
        let start = *self.state.start.get_or_insert(snapshot.tick);
        if self.state.starts.is_empty() {
            self.state.starts = snapshot.objects.iter().map(|o| o.pose).collect();
            self.context.starts.clone_from(&self.state.starts);
        }
        let elapsed = seconds(snapshot.tick.saturating_sub(start));
        let conditions: Vec<_> = self
            .conditions
            .iter()
            .zip(&mut self.state.memories)
            .map(|((name, predicate, required), memory)| {
                let measure = predicate.measure(&self.context, memory, snapshot);
                Condition {
                    name: name.clone(),
                    holds: measure.holds,
                    value: measure.value,
                    required: *required,
                }
            })
            .collect();
        let failure = self.failure(snapshot, elapsed);
        if self.state.outcome.is_none() {
            let achieved = conditions.iter().all(|c| c.holds || !c.required);
            self.state.outcome = match failure {
                _ if achieved => Some(Outcome::Success),
                Some(failure) => Some(Outcome::Failed(failure)),
                None => None,
            };
        }
        Evaluation {
            success: self.state.outcome == Some(Outcome::Success),
            done: self.state.outcome.is_some(),
            failure: match self.state.outcome {
                Some(Outcome::Failed(failure)) => Some(failure),
                _ => None,
            },
            conditions,
            elapsed,
        }
    }

    /// Why the task cannot succeed any more, if so.
    fn failure(&mut self, snapshot: &Snapshot, elapsed: f64) -> Option<Failure> {
        let target = self.context.target;
        let lost = snapshot.anomalies.iter().any(|anomaly| {
            let (Anomaly::NotFinite(body) | Anomaly::Escaped(body)) = anomaly;
            *body == BodyRef::Object(target)
        });
        let Some(state) = snapshot.objects.get(target).filter(|_| !lost) else {
            return Some(Failure::Lost);
        };
        let rise = self.context.rise(target, snapshot);
        let held = self.context.held(target, f64::MIN_POSITIVE, snapshot);
        let FailureSpec { drop, tilt } = self.failure;
        if rise < -drop {
            return Some(Failure::Dropped);
        }
        if held && rise > drop {
            self.state.was_lifted = true;
        }
        if !held && self.state.was_lifted && rise < drop {
            return Some(Failure::Dropped);
        }
        if !held && self.context.lean(target, state) > tilt {
            return Some(Failure::Tipped);
        }
        (elapsed >= self.time_limit).then_some(Failure::Timeout)
    }
}

/// Physics ticks as seconds.
pub(super) fn seconds(ticks: u64) -> f64 {
    ticks as f64 / PHYSICS_HZ as f64
}
