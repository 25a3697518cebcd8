//! The simulation: control → world → sensors → task, one control tick a step.
//!
//! No I/O after loading, no wall clock, no network: the same scenario and the
//! same inputs give the same bits.

#[cfg(test)]
mod bits;
mod calibration;
mod disturb;
mod envelope;
mod expected;
mod guard;
mod scenario;
mod shown;
mod state;
#[cfg(test)]
pub(crate) mod tests;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Isometry3;
use wheelarm_proto::PHYSICS_HZ;

pub use disturb::{Disturbance, Disturbances, MAX_STRENGTH, Pushed};
pub use guard::{anomaly_words, fault_words};
pub use scenario::{
    ALL_CAMERAS, CameraPlace, CameraSetting, HOUSE, Lens, MAX_SIZE, Pacing, Quality, SOFT_MASS,
    Scenario, ScenarioError, Schedules, SensorSetting, Starts,
};
pub use shown::{Recorded, RecordedSkin, Unfit};
pub use state::StateError;

use crate::robot::control::{ControlInput, GripperMap, RobotControl, Targets};
use crate::robot::{ARM_JOINTS, RecordedFrame, RobotError, RobotModel};
use crate::scene::{Body, Placement, Scene, SceneError};
use crate::sensors::frames::{self, RelativeState};
use crate::sensors::imu::{self, Imu};
use crate::sensors::models::{self, Device, SensorError};
use crate::sensors::odometry::Odometry;
use crate::snapshot::{BodyRef, Contact, Fault, Snapshot};
use crate::tasks::{self, Draw, Evaluation, Evaluator, Floor, SceneDraw, TaskSpec, Variant};
use crate::world::{World, WorldError, WorstOfSoft};

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

/// A running simulation.
pub struct Simulation {
    assets: PathBuf,
    scenario: Scenario,
    schedules: Schedules,
    devices: Vec<Device>,
    model: RobotModel,
    scene: Scene,
    task: Option<TaskSpec>,
    gripper: GripperMap,
    control: RobotControl,
    world: World,
    imu: Imu,
    odometry: Odometry,
    evaluator: Option<Evaluator>,
    evaluation: Evaluation,
    snapshot: Arc<Snapshot>,
    /// Why no step is taken any more, also in words.
    broken: Option<(Fault, String)>,
    /// Recorded states are shown, nothing is computed.
    shown: bool,
}

/// What one control tick produced.
#[derive(Debug, Default)]
pub struct Step {
    /// IMU measurements that fell due, oldest first.
    pub imu: Vec<imu::Sample>,
    /// Cameras (indices into the scenario's list) that fell due, with the
    /// state they see, oldest first.
    pub frames: Vec<(Arc<Snapshot>, Vec<usize>)>,
}

impl Simulation {
    /// Loads everything that a scenario names and draws what it leaves open.
    ///
    /// # Errors
    /// [`SimError`] that names the file or field and the cure.
    pub fn new(assets: &Path, scenario: Scenario) -> Result<Self, SimError> {
        Self::new_within(assets, scenario, &|| false)
    }

    /// As [`Simulation::new`], giving up where soft objects settle for so long
    /// that `late` says so.
    ///
    /// # Errors
    /// As [`Simulation::new`], and [`WorldError::Settling`].
    pub fn new_within(
        assets: &Path,
        scenario: Scenario,
        late: &dyn Fn() -> bool,
    ) -> Result<Self, SimError> {
        let made = guard::caught(|| Self::make(assets, scenario, late));
        made.unwrap_or_else(|words| Err(SimError::Panicked(words)))
    }

    fn make(
        assets: &Path,
        mut scenario: Scenario,
        late: &dyn Fn() -> bool,
    ) -> Result<Self, SimError> {
        scenario.schedules()?;
        let model = RobotModel::load(assets, &scenario.robot)?;
        let usual = model.settings.cameras.iter().filter(|c| !c.on_request);
        scenario.name_cameras(usual.map(|c| c.name.as_str()));
        calibration::draw(&mut scenario, &model)?;
        let schedules = scenario.schedules()?;
        let own = model.settings.cameras.iter().map(|c| c.name.as_str());
        let cameras: Vec<_> = own.chain(["room"]).collect();
        let devices = models::load(assets, &scenario.sensors, &cameras, scenario.seed)?;
        let mut scene = Scene::load(assets, &scenario.scene)?;
        let task = match scenario.task.as_str() {
            "" => None,
            name => Some(TaskSpec::load(
                assets,
                name,
                &scene,
                &model.settings.corridor,
            )?),
        };
        let variant = match &task {
            Some(task) => Some(variant(task, &scenario)?.clone()),
            None => None,
        };
        scene.keep_optional(variant.as_ref().map_or(&[], |variant| &variant.furniture));
        scenario.variant = variant.as_ref().map(|variant| variant.name.clone());
        let floor = match scenario.starts {
            Starts::Near => None,
            Starts::Anywhere => Some(Floor::new(&model, &scene)),
        };
        let drawn = task
            .as_ref()
            .zip(variant.as_ref())
            .map(|(task, variant)| (task, variant, floor.as_ref()));
        let is_told = !scenario.instruction.is_empty();
        let placed = draw_open_values(&mut scenario, &mut scene, drawn)?;
        if let (Some(task), false) = (&task, is_told) {
            say(assets, &mut scenario, &scene, task)?;
        }
        let arm = *scenario.arm.get_or_insert(model.settings.home);
        let knuckle = *scenario.knuckle.get_or_insert(0.0);
        check_pose(&model, &arm, knuckle)?;
        let placements: Vec<_> = scenario.objects.iter().map(|(_, p)| *p).collect();
        let start = scenario.start.unwrap_or(scene.start);
        let gripper = GripperMap::new(&model);
        let control = RobotControl::at(&model, &arm, knuckle);
        let world = World::new_within(&model, &scene, &placements, &start, &arm, knuckle, late)?;
        if let Some((one, other, depth)) = world.overlap(&placed) {
            let name = |object: usize| scenario.objects[object].0.clone();
            return Err(SimError::Overlap {
                one: name(one),
                other: name(other),
                depth,
            });
        }
        guard::check_new(world.fault(), &model, &scene)?;
        let snapshot = Arc::new(world.snapshot());
        let mut evaluator = task
            .as_ref()
            .map(|t| Evaluator::new(t, &scene, &model, &scenario.target))
            .transpose()?;
        if let Some(evaluator) = &mut evaluator {
            if scenario.time_limit == Some(0.0)
                && let Some(task) = &task
            {
                let expected = expected::seconds(task, &scene, &scenario);
                scenario.time_limit = Some((expected::ROOM * expected).ceil());
            }
            evaluator.bend(scenario.time_limit, scenario.disturbances.is_some());
        }
        let evaluation = evaluator
            .as_mut()
            .map(|e| e.update(&snapshot))
            .unwrap_or_default();
        let mut sim = Self {
            assets: assets.to_owned(),
            imu: Imu::new(scenario.seed),
            odometry: Odometry::new(model.settings.wheel_radius, model.settings.track),
            scenario,
            schedules,
            devices,
            model,
            scene,
            task,
            gripper,
            control,
            world,
            evaluator,
            evaluation,
            snapshot,
            broken: None,
            shown: false,
        };
        sim.update_odometry();
        // The first acceleration needs a velocity to start from.
        let link = sim.snapshot.links[sim.model.roles.imu];
        sim.imu.prime(&link);
        Ok(sim)
    }

    /// Starts the task anew from the present state: an episode's clock and its
    /// conditions begin with the episode.
    pub fn begin_episode(&mut self) {
        if let Some(evaluator) = &mut self.evaluator {
            evaluator.reset();
            self.evaluation = evaluator.update(&self.snapshot);
        }
    }

    /// Advances by one control tick (4 physics ticks).
    pub fn step(&mut self, input: &ControlInput) -> Step {
        self.step_telling(input, |_, _| {})
    }

    /// As [`Simulation::step`]; `tell` hears what is applied before the physics
    /// takes its time. A state that breaks is not shown: nothing is due in such
    /// a step, the last good state stays, and [`Simulation::broken`] says why.
    pub fn step_telling(
        &mut self,
        input: &ControlInput,
        tell: impl FnOnce(&Targets, &RobotControl),
    ) -> Step {
        if self.broken.is_some() || self.shown {
            return Step::default();
        }
        let last = Arc::clone(&self.snapshot);
        match guard::caught(|| self.advance(input, tell)) {
            Ok(Ok(step)) => step,
            Ok(Err(fault)) => self.break_off(fault, last),
            Err(words) => self.break_off(Fault::Panic(words), last),
        }
    }

    fn advance(
        &mut self,
        input: &ControlInput,
        tell: impl FnOnce(&Targets, &RobotControl),
    ) -> Result<Step, Fault> {
        let disturbance = self.disturbance();
        let mut targets = self.control.update(input, &self.snapshot);
        tell(&targets[0], &self.control);
        let push = disturbance.as_ref().and_then(|d| d.push);
        self.world.push(push.map(|(on, force)| (self.body_of(on), force)));
        if let Some(disturbance) = &disturbance {
            disturbance.apply(&mut targets);
        }
        let mut step = Step::default();
        for (i, target) in targets.iter().enumerate() {
            self.world.apply(target);
            self.world.step();
            let last = i + 1 == targets.len();
            let fault = match last {
                true => self.world.fault(),
                false => self.world.fault_of_tick(),
            };
            if let Some(fault) = fault {
                return Err(fault);
            }
            self.sense(&mut step, last);
        }
        self.update_odometry();
        if let Some(evaluator) = &mut self.evaluator {
            self.evaluation = evaluator.update(&self.snapshot);
        }
        Ok(step)
    }

    /// What disturbs the coming control tick; `None` where the scenario has no
    /// disturbances.
    #[must_use]
    pub fn disturbance(&self) -> Option<Disturbance> {
        let disturbances = self.scenario.disturbances.as_ref()?;
        // What is soft has no weight of its own in the engine, and furniture none.
        let target = self.scene.object_named(&self.scenario.target);
        let target = target.filter(|&i| self.scene.objects[i].soft.is_none());
        let target = target.map(|i| (i, self.scenario.objects[i].1.mass));
        Some(disturbances.at(self.scenario.seed, self.world.tick(), target))
    }

    /// The body that a push goes to.
    #[must_use]
    pub fn body_of(&self, pushed: Pushed) -> BodyRef {
        match pushed {
            Pushed::Chair => BodyRef::Link(0),
            Pushed::Hand => BodyRef::Link(self.model.roles.end_effector),
            Pushed::Object(index) => BodyRef::Object(index),
        }
    }

    /// Reads the sensors that are due at the present tick. A whole snapshot is
    /// taken where somebody looks: cameras, and everybody else after the last
    /// of a control tick's ticks.
    fn sense(&mut self, step: &mut Step, last: bool) {
        let tick = self.world.tick();
        let due = self.cameras_due(tick);
        if last || !due.is_empty() {
            self.snapshot = Arc::new(self.world.snapshot());
        }
        let noise = self
            .scenario
            .imu_noise
            .then(|| imu::Noise::from_settings(&self.model.settings.imu));
        // The link is one of the model's, so there always is a state.
        if let Some(link) = self.world.link(self.model.roles.imu) {
            let sample = self.imu.measure(tick, &link, noise);
            if self.schedules.imu.due(tick) {
                step.imu.push(sample);
            }
        }
        if !due.is_empty() {
            step.frames.push((Arc::clone(&self.snapshot), due));
        }
    }

    fn cameras_due(&self, tick: u64) -> Vec<usize> {
        let cameras = self.schedules.cameras.iter().enumerate();
        cameras
            .filter(|(_, c)| c.due(tick))
            .map(|(i, _)| i)
            .collect()
    }

    fn update_odometry(&mut self) {
        let [left, right] = self
            .model
            .roles
            .wheels
            .map(|wheel| self.snapshot.joints[wheel]);
        self.odometry.update(
            [left.position, right.position],
            [left.velocity, right.velocity],
        );
    }

    /// The state at the present tick.
    #[must_use]
    pub fn snapshot(&self) -> &Arc<Snapshot> {
        &self.snapshot
    }

    /// Pictures that are due at the present tick, for the start of an episode.
    #[must_use]
    pub fn frames_now(&self) -> Vec<(Arc<Snapshot>, Vec<usize>)> {
        let due = self.cameras_due(self.snapshot.tick);
        if due.is_empty() {
            Vec::new()
        } else {
            vec![(Arc::clone(&self.snapshot), due)]
        }
    }

    /// Whether the state streams are due at the present tick.
    #[must_use]
    pub fn state_due(&self) -> bool {
        self.schedules.state.due(self.snapshot.tick)
    }

    /// Whether the shapes of soft objects are due at the present tick.
    #[must_use]
    pub fn deformable_due(&self) -> bool {
        self.schedules.deformable.due(self.snapshot.tick)
    }

    /// Hash over the whole state; `Some` once per simulated second.
    #[must_use]
    pub fn hash_due(&self) -> Option<u64> {
        if self.broken.is_some() || self.shown {
            return None;
        }
        self.snapshot
            .tick
            .is_multiple_of(PHYSICS_HZ)
            .then(|| self.world.hash())
    }

    /// The scenario, with everything that was drawn.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The sensor models that are on.
    #[must_use]
    pub fn devices(&self) -> &[Device] {
        &self.devices
    }

    /// The robot.
    #[must_use]
    pub fn model(&self) -> &RobotModel {
        &self.model
    }

    /// The home.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The task, if there is one.
    #[must_use]
    pub fn task(&self) -> Option<&TaskSpec> {
        self.task.as_ref()
    }

    /// The assets folder.
    #[must_use]
    pub fn assets(&self) -> &Path {
        &self.assets
    }

    /// The worst that was seen of each soft object since the start.
    #[must_use]
    pub fn worst_of_soft(&self) -> Vec<WorstOfSoft> {
        self.world.worst_of_soft()
    }

    /// The robot's control, for what it publishes.
    #[must_use]
    pub fn control(&self) -> &RobotControl {
        &self.control
    }

    /// Odometry at the present tick.
    #[must_use]
    pub fn odometry(&self) -> &Odometry {
        &self.odometry
    }

    /// State of the task at the present tick.
    #[must_use]
    pub fn evaluation(&self) -> &Evaluation {
        &self.evaluation
    }

    /// Contacts of the robot with furniture at the present tick that are harder
    /// than [`tasks::HARD`]; none without a task.
    pub fn hard_collisions(&self) -> impl Iterator<Item = &Contact> {
        let judge = self.evaluator.iter();
        judge.flat_map(move |evaluator| evaluator.hard_collisions(&self.snapshot))
    }

    /// The recorded joints, in the order of the robot's description.
    #[must_use]
    pub fn recorded_joints(&self) -> Vec<crate::snapshot::JointState> {
        let recorded = self.model.roles.joints.iter();
        recorded.map(|r| self.snapshot.joints[r.joint]).collect()
    }

    /// The recorded frames, in the order of the robot's description.
    #[must_use]
    pub fn recorded_frames(&self) -> Vec<RelativeState> {
        let relative = |frame: &RecordedFrame| {
            let link = &self.snapshot.links[frame.link];
            match frame.parent {
                Some(parent) => frames::relative(&self.snapshot.links[parent], link),
                None => frames::in_world(link),
            }
        };
        self.model.roles.frames.iter().map(relative).collect()
    }

    /// Positions of the arm's joints, from base to hand, rad.
    #[must_use]
    pub fn arm_positions(&self) -> [f64; ARM_JOINTS] {
        self.model
            .roles
            .arm
            .map(|j| self.snapshot.joints[j].position)
    }

    /// Distance between the gripper's pads by its linkage, m.
    #[must_use]
    pub fn opening(&self) -> f64 {
        let knuckle = self.model.roles.knuckles[0];
        self.gripper.opening(self.snapshot.joints[knuckle].position)
    }

    /// Contact force at the left and the right finger tip, normal and friction, N.
    #[must_use]
    pub fn pad_forces(&self) -> [f64; 2] {
        self.model.roles.finger_tips.map(|joint| {
            let pad = BodyRef::Link(self.model.joints[joint].child);
            let touching = self.snapshot.contacts.iter();
            touching
                .filter(|c| c.first == pad || c.second == pad)
                .map(|c| c.force.norm())
                .sum()
        })
    }
}

/// The variant of a task's area that a scenario names, or whose things it
/// places; else the one that is drawn.
fn variant<'a>(task: &'a TaskSpec, scenario: &Scenario) -> Result<&'a Variant, SimError> {
    let offering = || task.variants();
    let given = match &scenario.variant {
        Some(name) => offering().find(|variant| variant.name == *name),
        None if scenario.objects.is_empty() => {
            tasks::variant_of(task, scenario.seed, scenario.variant_share)
        }
        // A recording that does not tell its variant tells what was there.
        None => {
            let placed = |variant: &&Variant| {
                let certain = variant.places.iter().filter(|place| place.is_certain());
                let there = certain.filter(|place| {
                    scenario
                        .objects
                        .iter()
                        .any(|(name, _)| *name == place.object)
                });
                there.count()
            };
            // Of those with as many, the first has the fewest things missing.
            offering().rev().max_by_key(placed)
        }
    };
    given.ok_or_else(|| {
        let known: Vec<_> = offering().map(|v| format!("{:?}", v.name)).collect();
        SimError::Variant {
            name: scenario.variant.clone().unwrap_or_default(),
            task: task.name.clone(),
            known: known.join(", "),
        }
    })
}

/// Fills in placements, target, start pose and instruction that the scenario
/// leaves open, and takes what is not there out of the scene. Tells of each object
/// whether the scenario places it elsewhere than it would be drawn.
fn draw_open_values(
    scenario: &mut Scenario,
    scene: &mut Scene,
    task: Option<(&TaskSpec, &Variant, Option<&Floor>)>,
) -> Result<Vec<bool>, SimError> {
    if let Some((name, _)) = scenario
        .objects
        .iter()
        .find(|(n, _)| !scene.objects.iter().any(|o| o.name == *n))
    {
        let known: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
        return Err(SimError::Object {
            name: name.clone(),
            scene: scene.name.clone(),
            known: known.join(", "),
        });
    }
    if let Some((name, ..)) = scenario
        .slides
        .iter()
        .find(|(n, ..)| scene.joint_named(n).is_none())
    {
        let known: Vec<_> = scene.joints.iter().map(|j| j.name.as_str()).collect();
        return Err(SimError::Slide {
            name: name.clone(),
            scene: scene.name.clone(),
            known: known.join(", "),
        });
    }
    check_soft(scenario, scene)?;
    let drawn = match task {
        Some((task, variant, floor)) => tasks::draw(task, variant, scene, scenario.seed, floor),
        None => undisturbed(scene),
    };
    let given = std::mem::take(&mut scenario.objects);
    let tells_none = given.is_empty();
    let placed: Vec<bool>;
    (scenario.objects, placed) = scene
        .objects
        .iter()
        .zip(drawn.scene.placements)
        .filter_map(|(object, drawn)| {
            let given = given.iter().find(|(name, _)| *name == object.name);
            let elsewhere = given.is_some_and(|(_, p)| drawn.is_none_or(|d| d.pose != p.pose));
            // Of what may be missing, a scenario that tells objects tells all.
            let drawn = drawn.filter(|_| tells_none || !object.optional);
            let placement = given.map(|(_, p)| *p).or(drawn)?;
            Some(((object.name.clone(), placement), elsewhere))
        })
        .unzip();
    scene.objects.retain(|object| {
        scenario
            .objects
            .iter()
            .any(|(name, _)| *name == object.name)
    });
    let slides = drawn.scene.slides.into_iter().zip(drawn.scene.positions);
    for (joint, drawn) in scene.joints.iter_mut().zip(slides) {
        let mut given = scenario.slides.iter();
        let given = given.find(|(name, ..)| *name == joint.name);
        (joint.resistance, joint.start) = given.map_or(drawn, |(_, r, p)| (*r, *p));
    }
    let slides = scene.joints.iter();
    let slides = slides.map(|j| (j.name.clone(), j.resistance, j.start));
    scenario.slides = slides.collect();
    let start: Isometry3<f64> = scenario.start.unwrap_or(drawn.scene.start);
    scenario.start = Some(start);
    scenario.arm = scenario.arm.or(drawn.scene.arm);
    scenario.knuckle = scenario.knuckle.or(drawn.scene.knuckle);
    if scenario.target.is_empty() {
        scenario.target = drawn.target;
    }
    if scenario.instruction.is_empty() {
        scenario.instruction = drawn.instruction;
    }
    Ok(placed)
}

/// Says the task by the grammar, where the scenario asks for it.
fn say(
    assets: &Path,
    scenario: &mut Scenario,
    scene: &Scene,
    task: &TaskSpec,
) -> Result<(), SimError> {
    let Some(language) = &mut scenario.language else {
        return Ok(());
    };
    let placements: Vec<_> = scenario.objects.iter().map(|(_, p)| *p).collect();
    let about = (task, scenario.target.as_str());
    let said = tasks::sentence(assets, about, scene, &placements, scenario.seed, language)?;
    if let Some(said) = said {
        scenario.instruction = said.text;
        language.template = said.template;
        language.question = said.question;
    }
    Ok(())
}

/// Refuses a start at which a joint stands beyond its limits.
fn check_pose(
    model: &RobotModel,
    arm: &[f64; ARM_JOINTS],
    knuckle: f64,
) -> Result<(), ScenarioError> {
    let joints = model.roles.arm.iter().zip(arm);
    let gripper = [(&model.roles.knuckles[0], &knuckle)];
    for (&joint, &position) in joints.chain(gripper) {
        let joint = &model.joints[joint];
        let (least, most) = (joint.limits.lower, joint.limits.upper);
        if !(least..=most).contains(&position) {
            return Err(ScenarioError::Joint {
                name: joint.name.clone(),
                position,
                least,
                most,
            });
        }
    }
    Ok(())
}

/// Refuses masses with which what is soft would not settle.
fn check_soft(scenario: &Scenario, scene: &Scene) -> Result<(), ScenarioError> {
    let (least, most) = SOFT_MASS;
    for (name, placement) in &scenario.objects {
        let mut objects = scene.objects.iter();
        let soft = objects.any(|o| o.name == *name && o.soft.is_some());
        if soft && !(least..=most).contains(&placement.mass) {
            return Err(ScenarioError::SoftMass {
                name: name.clone(),
                mass: placement.mass,
            });
        }
    }
    Ok(())
}

/// Everything at its place in the scene, without what is optional.
fn undisturbed(scene: &Scene) -> Draw {
    let placement = |object: &Body| (!object.optional).then(|| Placement::of(object));
    Draw {
        scene: SceneDraw {
            placements: scene.objects.iter().map(placement).collect(),
            slides: scene.joints.iter().map(|joint| joint.resistance).collect(),
            positions: vec![0.0; scene.joints.len()],
            start: scene.start,
            arm: None,
            knuckle: None,
            attempts: 0,
            clearance: 0.0,
        },
        target: String::new(),
        instruction: String::new(),
    }
}
