//! The evaluator: conditions at every control tick, success, and cause of failure.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use super::condition::{Memory, seconds};
use super::context::Context;
use super::failure::Failure;
use super::predicates::AnyPredicate;
use super::spec::{FailureSpec, TaskSpec};
use crate::people::Person;
use crate::robot::RobotModel;
use crate::scene::{Scene, SceneError, Surface};
use crate::snapshot::{Anomaly, BodyRef, Contact, Snapshot};

/// Contact force of the robot with furniture above which a collision is hard, N.
pub const HARD: f64 = 50.0;
/// Speed below which an object is at rest, m/s.
const REST_SPEED: f64 = 0.02;

/// Evaluates one episode of a task.
#[derive(Clone, Debug)]
pub struct Evaluator {
    conditions: Vec<(String, AnyPredicate, bool)>,
    failure: FailureSpec,
    time_limit: f64,
    /// Limit of the running episode, if it has its own.
    episode_limit: Option<f64>,
    /// A target that falls but remains reachable is not dropped.
    fetches: bool,
    context: Context,
    /// Surface on which the target starts.
    carrier: Option<Surface>,
    /// Furniture on which the target must end.
    goal: Option<String>,
    state: EvaluatorState,
}

/// Complete state of an evaluator: saved and restored with the world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorState {
    /// Tick of the first snapshot.
    start: Option<u64>,
    /// Poses of the objects in the first snapshot.
    starts: Vec<Isometry3<f64>>,
    memories: Vec<Memory>,
    /// The target has been lifted in the gripper.
    was_lifted: bool,
    outcome: Option<Outcome>,
}

/// Result of the task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Outcome {
    Success,
    Failed(Failure),
}

/// State of the task after one snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// All required conditions have held at the same time.
    pub success: bool,
    /// Success or failure: the result is final.
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
    /// Predicate and subject, for example `lifted_and_held(mustard)`.
    pub name: String,
    /// The predicate alone, for example `lifted_and_held`.
    pub predicate: &'static str,
    /// Whether it holds now.
    pub holds: bool,
    /// The measured quantity, SI.
    pub value: f64,
    /// Required for success, or only reported.
    pub required: bool,
}

impl Evaluation {
    /// Voids a success after the simulation broke.
    pub fn void(&mut self) {
        self.success = false;
        self.done = true;
        self.failure = Some(Failure::Physics);
    }
}

impl Evaluator {
    /// An evaluator for `spec` in `scene` with this robot; `target` is the sampled
    /// target, `person` the person in the chair.
    ///
    /// # Errors
    /// When the scene does not contain the target.
    pub fn new(
        spec: &TaskSpec,
        scene: &Scene,
        model: &RobotModel,
        target: &str,
        person: Option<&Person>,
    ) -> Result<Self, SceneError> {
        let child = |joint: usize| model.joints[joint].child;
        let roles = &model.roles;
        let object = scene.object_named(target);
        let known = object.is_some() || scene.furniture_named(target).is_some();
        if !known || !spec.targets.iter().any(|name| name == target) {
            return Err(spec.place().key("target").wrong(
                format!("{target:?}"),
                format!(
                    "one of {} in the scene {:?}",
                    spec.targets.join(", "),
                    scene.name
                ),
                "name one of the task's targets, or none to sample it",
            ));
        }
        let others = spec.targets.iter().filter(|name| *name != target);
        let furniture = scene.furniture_named(target);
        let mut variants = spec.area.variants.iter();
        let start = variants.find_map(|variant| variant.place(target));
        let surfaces = scene.furniture.iter().filter_map(|body| {
            let surface = scene.surface_named(&body.name, None)?;
            Some((body.name.clone(), surface.clone()))
        });
        let mut evaluator = Self {
            conditions: spec
                .conditions
                .iter()
                .filter(|c| person.is_some() || !c.with_person)
                .map(|c| (c.label(), c.predicate.clone(), c.required))
                .collect(),
            failure: spec.failure,
            time_limit: spec.time_limit,
            episode_limit: None,
            fetches: false,
            context: Context {
                bodies: scene.objects.clone(),
                starts: Vec::new(),
                surfaces: surfaces.collect(),
                joints: (scene.joints.iter())
                    .map(|joint| (joint.name.clone(), joint.motion))
                    .collect(),
                sliding: scene.joints.iter().map(|j| j.furniture).collect(),
                pads: roles.finger_tips.map(child),
                wheels: (roles.wheels.iter().chain(&roles.casters))
                    .map(|&joint| child(joint))
                    .collect(),
                target: object,
                target_joint: scene
                    .joints
                    .iter()
                    .position(|j| Some(j.furniture) == furniture),
                lap: person.map(|person| person.lap),
                mouth: person.map(Person::own_mouth),
                decoys: others.filter_map(|name| scene.object_named(name)).collect(),
            },
            carrier: start
                .and_then(|p| scene.surface_named(&p.on, p.surface.as_deref()))
                .cloned(),
            goal: spec.region_name().map(str::to_owned),
            state: EvaluatorState::default(),
        };
        evaluator.reset();
        Ok(evaluator)
    }

    /// Sets another time limit, simulated seconds. With disturbances (`fetches`), a
    /// target that falls back onto its support may be grasped again: it is dropped when
    /// it falls further.
    pub fn bend(&mut self, time_limit: Option<f64>, fetches: bool) {
        self.time_limit = time_limit.unwrap_or(self.time_limit);
        self.fetches = fetches;
    }

    /// Sets the time limit of one episode, simulated seconds; default is the task's.
    pub fn limit_episode(&mut self, time_limit: Option<f64>) {
        self.episode_limit = time_limit;
    }

    /// Resets the state; the next snapshot is the first.
    pub fn reset(&mut self) {
        self.restore(EvaluatorState {
            memories: vec![Memory::default(); self.conditions.len()],
            ..EvaluatorState::default()
        });
    }

    /// Contacts of the robot with furniture that press harder than [`HARD`].
    pub fn hard_collisions<'a>(
        &'a self,
        snapshot: &'a Snapshot,
    ) -> impl Iterator<Item = &'a Contact> {
        let collisions = self.context.collisions(snapshot);
        collisions.filter(|contact| contact.force.norm() > HARD)
    }

    /// Its state.
    #[must_use]
    pub fn state(&self) -> &EvaluatorState {
        &self.state
    }

    /// Continues from a state of the same task and scene.
    pub fn restore(&mut self, state: EvaluatorState) {
        self.context.starts.clone_from(&state.starts);
        self.state = state;
        self.state
            .memories
            .resize(self.conditions.len(), Memory::default());
    }

    /// Evaluates the next snapshot; called once per control tick.
    pub fn update(&mut self, snapshot: &Snapshot) -> Evaluation {
        let start = *self.state.start.get_or_insert(snapshot.tick);
        if self.state.starts.is_empty() {
            self.state.starts = snapshot.objects.iter().map(|o| o.pose).collect();
            self.context.starts.clone_from(&self.state.starts);
        }
        let elapsed = seconds(snapshot.tick.saturating_sub(start));
        let mut lost = None;
        let conditions: Vec<_> = self
            .conditions
            .iter()
            .zip(&mut self.state.memories)
            .map(|((name, predicate, required), memory)| {
                let predicate = predicate.as_dyn();
                let measure = predicate.measure(&self.context, memory, snapshot);
                if *required && measure.is_some_and(|measure| !measure.holds) {
                    lost = lost.or(predicate.loss());
                }
                let measure = measure.unwrap_or_default();
                Condition {
                    name: name.clone(),
                    predicate: predicate.word(),
                    holds: measure.holds,
                    value: measure.value,
                    required: *required,
                }
            })
            .collect();
        // The lost condition is the cause, not a later fall of the target.
        let failure = lost.or_else(|| self.failure(snapshot, elapsed));
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

    /// Why the task has failed, if so.
    fn failure(&mut self, snapshot: &Snapshot, elapsed: f64) -> Option<Failure> {
        let of_target = self
            .context
            .target
            .and_then(|target| self.target_failure(target, snapshot));
        if of_target.is_some() {
            return of_target;
        }
        if self.context.collision_force(snapshot) > self.failure.force {
            return Some(Failure::HardCollision);
        }
        (elapsed >= self.episode_limit.unwrap_or(self.time_limit)).then_some(Failure::Timeout)
    }

    /// A failure of the target that ends the task.
    fn target_failure(&mut self, target: usize, snapshot: &Snapshot) -> Option<Failure> {
        let lost = snapshot.anomalies.iter().any(|anomaly| match anomaly {
            Anomaly::NotFinite(body) | Anomaly::Escaped(body) => *body == BodyRef::Object(target),
            Anomaly::Fast(_) => false,
        });
        let Some(state) = snapshot.objects.get(target).filter(|_| !lost) else {
            return Some(Failure::Lost);
        };
        let rise = self.context.rise(target, snapshot);
        let held = self.context.is_held(target, f64::MIN_POSITIVE, snapshot);
        let FailureSpec {
            drop, tilt, reach, ..
        } = self.failure;
        if held && rise > drop {
            self.state.was_lifted = true;
        }
        // A target put down at its goal is not dropped; the goal may be lower than the start.
        let goal = self.goal.as_deref();
        let arrived = goal.and_then(|on| self.context.inside(target, state, on, drop));
        let arrived = arrived.is_some_and(|(_, inside)| inside);
        if !held && !arrived && rise < -drop {
            return Some(Failure::Dropped);
        }
        if !held && !arrived && !self.fetches && self.state.was_lifted && rise < drop {
            return Some(Failure::Dropped);
        }
        if !held && self.context.lean(target, state) > tilt {
            return Some(Failure::Tipped);
        }
        let rests = state.linear.norm() < REST_SPEED;
        let is_left = rests && !held && !arrived;
        if let (Some(reach), Some(carrier), true) = (reach, &self.carrier, is_left) {
            let inwards = (carrier.edge.inverse() * state.pose).translation.x;
            if inwards > reach {
                return Some(Failure::Unreachable);
            }
        }
        None
    }
}
