//! The simulation: control → world → sensors → task, one control tick per step.
//!
//! No I/O after loading, no wall clock, no network: the same scenario and the same
//! inputs give the same bits.

mod arm_balls;
mod calibration;
mod carriers;
mod disturb;
mod envelope;
mod error;
mod expected;
#[cfg(test)]
mod golden_hash;
mod guard;
mod packs;
mod person_clearance;
mod person_guard;
mod playback;
#[cfg(test)]
mod rest_tests;
#[cfg(test)]
mod rules_tests;
mod scenario;
mod scenario_sampling;
mod state;
#[cfg(test)]
pub(crate) mod tests;
mod view_start;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use wheelarm_proto::PHYSICS_HZ;

pub use disturb::{Disturbance, Disturbances, MAX_STRENGTH, PushTarget};
pub use error::{SimError, StateError};
pub use guard::{anomaly_words, fault_words};
pub use packs::{ObjectPack, PackRequest, ScenePack, load_scene};
pub use playback::{IncompatibleState, RecordedSkin, RecordedState};
pub use scenario::{
    ALL_CAMERAS, CameraPlace, CameraSetting, HOUSE, Lens, MAX_SIZE, Pacing, Quality, Requested,
    SOFT_MASS, Scenario, ScenarioError, Schedules, SensorSetting, Starts,
};

use crate::people::{Motion, Person};
use crate::robot::control::{ControlInput, GripperMap, RobotControl, Targets};
use crate::robot::{ARM_JOINTS, RecordedFrame, RobotModel};
use crate::scene::Scene;
use crate::sensors::frames::{self, RelativeState};
use crate::sensors::imu::{self, Imu};
use crate::sensors::models::{self, Device};
use crate::sensors::odometry::Odometry;
use crate::sensors::scan::Scanner;
use crate::snapshot::{BodyRef, Contact, Fault, Snapshot};
use crate::tasks::{
    Evaluation, Evaluator, Floor, MapSource, SamplingRules, TaskSpec, Variant, stocked,
};
use crate::world::{World, WorstOfSoft};
use arm_balls::ArmBalls;
use carriers::Carriers;
use scenario_sampling::{
    check_pose, generate_instruction, sample_open_values, sampled, sampling_rules, seated, settled,
};

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
    person: Option<Arc<Person>>,
    motion: Option<Motion>,
    arm_balls: ArmBalls,
    carriers: Carriers,
    imu: Imu,
    odometry: Odometry,
    evaluator: Option<Evaluator>,
    evaluation: Evaluation,
    snapshot: Arc<Snapshot>,
    /// Why no further step runs, with a description.
    broken: Option<(Fault, String)>,
    /// Recorded states are played back; nothing is simulated.
    shown: bool,
}

/// Output of one control tick.
#[derive(Debug, Default)]
pub struct Step {
    /// IMU measurements that became due, oldest first.
    pub imu: Vec<imu::Sample>,
    /// Cameras (indices into the scenario's list) that became due, with the state to
    /// render, oldest first.
    pub frames: Vec<(Arc<Snapshot>, Vec<usize>)>,
}

impl Simulation {
    /// Loads the files of a scenario and samples its open values.
    ///
    /// # Errors
    /// [`SimError`] that names the file or field and the fix.
    pub fn new(assets: &Path, scenario: Scenario) -> Result<Self, SimError> {
        Self::new_within(assets, scenario, &|| false)
    }

    /// As [`Simulation::new`], but fails when deformables settle for longer than `late`
    /// allows.
    ///
    /// # Errors
    /// As [`Simulation::new`], and [`WorldError::Settling`](crate::world::WorldError::Settling).
    pub fn new_within(
        assets: &Path,
        scenario: Scenario,
        late: &dyn Fn() -> bool,
    ) -> Result<Self, SimError> {
        let made = guard::caught(|| Self::make(assets, scenario, late, false));
        made.unwrap_or_else(|words| Err(SimError::Panicked(words)))
    }

    /// As [`Simulation::new_within`], for playback ([`Simulation::show`]): a robot that
    /// starts inside another body is accepted, since older physics versions recorded
    /// such starts.
    ///
    /// # Errors
    /// As [`Simulation::new_within`].
    pub fn for_playback(
        assets: &Path,
        scenario: Scenario,
        late: &dyn Fn() -> bool,
    ) -> Result<Self, SimError> {
        let made = guard::caught(|| Self::make(assets, scenario, late, true));
        made.unwrap_or_else(|words| Err(SimError::Panicked(words)))
    }

    fn make(
        assets: &Path,
        mut scenario: Scenario,
        late: &dyn Fn() -> bool,
        playback: bool,
    ) -> Result<Self, SimError> {
        scenario.schedules()?;
        let model = RobotModel::load(assets, &scenario.robot)?;
        let usual = model.settings.cameras.iter().filter(|c| !c.on_request);
        scenario.name_cameras(usual.map(|c| c.name.as_str()));
        calibration::sample(&mut scenario, &model)?;
        let schedules = scenario.schedules()?;
        if scenario.scan_rate_hz > 0.0 && model.settings.scanner.is_none() {
            return Err(ScenarioError::NoScanner(scenario.robot).into());
        }
        // Image sensors need cameras; without cameras there are none.
        let own = model.settings.cameras.iter().map(|c| c.name.as_str());
        let cameras: Vec<_> = match scenario.cameras.is_empty() {
            true => own.chain(["room"]).collect(),
            false => scenario.cameras.iter().map(|c| c.name.as_str()).collect(),
        };
        let devices = models::load(assets, &scenario.sensors, &cameras, scenario.seed)?;
        let scene = load_scene(
            assets,
            &scenario.scene,
            &scenario.pack,
            (&scenario.object_packs, scenario.object_split),
        )?;
        let mut scene = stocked(assets, &scenario.task, scene)?;
        let task = match scenario.task.as_str() {
            "" => None,
            name => Some(TaskSpec::load(
                assets,
                name,
                &scene,
                &model.settings.gripper.corridor,
            )?),
        };
        let settled = match &task {
            Some(task) => Some(settled(task, &scenario, &scene)?),
            None => None,
        };
        let is_variant_open = scenario.variant.is_none();
        let furniture = settled.as_ref().map_or(&[][..], |(_, own)| &own.furniture);
        scene.keep_optional(furniture);
        if scenario.person.as_ref().is_none_or(|p| p.drawn.is_none()) {
            scenario.requested.person = scenario.person.clone();
        }
        if let Some((care, _)) = settled.as_ref().filter(|(task, _)| task.is_care()) {
            // A care task needs a person.
            scenario.person = Some(care.cared_for(scenario.person.take()));
        }
        let seated_person = seated(assets, &mut scenario, &model)?;
        let arm_balls = ArmBalls::new(&model);
        let rules = sampling_rules(&mut scenario, &scene);
        let is_sampled = scenario.objects.is_empty() || scenario.start.is_none();
        let (starts, by_maps) = (scenario.starts, rules == SamplingRules::Maps && is_sampled);
        let reach = match by_maps {
            true => model.read_reach_map(assets)?,
            false => None,
        };
        let open_floor = |scene: &Scene| {
            let floor = match &seated_person {
                None => Floor::new(&model, scene),
                Some((person, _)) => Floor::occupied(&model, scene, person, |arm| {
                    arm_balls.is_clear(person, &model, arm)
                }),
            };
            match by_maps {
                true => floor.by_maps(scene, reach.clone(), starts),
                false => floor,
            }
        };
        let needs_floor = match rules {
            SamplingRules::Ranges => starts == Starts::Anywhere,
            SamplingRules::Maps => is_sampled,
        };
        let mut floor = needs_floor.then(|| open_floor(&scene));
        let is_query = task.as_ref().is_some_and(TaskSpec::is_query);
        let drawn = task.zip(settled).map(|(task, settled)| {
            let open = (&scenario, is_variant_open);
            sampled(&task, settled, open, &scene, floor.as_ref())
        });
        let (about, sample) = drawn.unzip();
        let (task, variant) = about.unzip();
        scenario.variant = variant.as_ref().map(|own: &Variant| own.name.clone());
        let has_instruction = !scenario.instruction.is_empty();
        let wants_view = scenario.start_in_view && scenario.start.is_none();
        let placed = sample_open_values(&mut scenario, &mut scene, task.as_ref().zip(sample))?;
        if let (true, Some(about)) = (wants_view, task.as_ref().zip(variant.as_ref())) {
            let floor = floor.get_or_insert_with(|| open_floor(&scene));
            view_start::choose(&mut scenario, about, floor, (&model, &scene));
        }
        if let (Some(task), false) = (&task, has_instruction) {
            generate_instruction(assets, &mut scenario, &scene, task)?;
        }
        let arm = *scenario.arm.get_or_insert(model.settings.home);
        let knuckle = *scenario.knuckle.get_or_insert(0.0);
        check_pose(&model, &arm, knuckle)?;
        let placements: Vec<_> = scenario.objects.iter().map(|(_, p)| *p).collect();
        let start = scenario.start.unwrap_or(scene.start);
        let gripper = GripperMap::new(&model);
        let control = RobotControl::at_rest(&model, &arm, knuckle);
        let mut world =
            World::new_within(&model, &scene, &placements, &start, &arm, knuckle, late)?;
        if let Some((person, motion)) = &seated_person {
            world.seat(person, *motion);
        }
        let (person, motion) = seated_person.clone().unzip();
        let carriers = Carriers::new(&model);
        if let Some((one, other, depth)) = world.overlap(&placed) {
            let name = |object: usize| scenario.objects[object].0.clone();
            return Err(SimError::Overlap {
                one: name(one),
                other: name(other),
                depth,
            });
        }
        if !playback && let Some((link, other, depth)) = world.robot_overlap() {
            let name = |body: BodyRef| match body {
                BodyRef::Link(link) => model.links[link].name.clone(),
                BodyRef::Object(object) => scenario.objects[object].0.clone(),
                BodyRef::Furniture(piece) => scene.furniture[piece].name.clone(),
                BodyRef::Person(part) => {
                    let capsule = person.as_ref().map(|p| p.capsules[part].name.as_str());
                    format!("{} of the person", capsule.unwrap_or("body"))
                }
            };
            return Err(SimError::RobotOverlap {
                link: name(link),
                other: name(other),
                depth,
            });
        }
        guard::check_new(world.fault(), &model, &scene)?;
        let snapshot = Arc::new(world.snapshot());
        let mut evaluator = task
            .as_ref()
            .map(|t| Evaluator::new(t, &scene, &model, &scenario.target, person.as_deref()))
            .transpose()?;
        if let Some(evaluator) = &mut evaluator {
            let is_far = is_query && by_maps && expected::may_be_long(&scenario);
            if (is_far || scenario.time_limit == Some(0.0))
                && let Some(about) = task.as_ref().zip(variant.as_ref())
            {
                let floor = floor.unwrap_or_else(|| open_floor(&scene));
                let limit = expected::limit(about, is_query, &floor, (&model, &scene), &scenario);
                scenario.requested.open_limit |= limit.is_some();
                scenario.time_limit = limit;
            }
            evaluator.bend(scenario.time_limit, scenario.disturbances.is_some());
        }
        let evaluation = evaluator
            .as_mut()
            .map(|e| e.update(&snapshot))
            .unwrap_or_default();
        let drive = &model.settings.drive;
        let mut sim = Self {
            assets: assets.to_owned(),
            imu: Imu::new(scenario.seed),
            odometry: Odometry::new(drive.wheel_radius, drive.track),
            scenario,
            schedules,
            devices,
            model,
            scene,
            task,
            gripper,
            control,
            world,
            person,
            motion,
            arm_balls,
            carriers,
            evaluator,
            evaluation,
            snapshot,
            broken: None,
            shown: false,
        };
        sim.update_odometry();
        // The first acceleration needs a previous velocity.
        let link = sim.snapshot.links[sim.model.roles.imu];
        sim.imu.prime(&link);
        Ok(sim)
    }

    /// Restarts the task from the present state: its clock and conditions begin with
    /// the episode. `time_limit`, simulated seconds, applies to this episode only;
    /// default is the scenario's.
    pub fn begin_episode(&mut self, time_limit: Option<f64>) {
        if let Some(evaluator) = &mut self.evaluator {
            evaluator.reset();
            evaluator.limit_episode(time_limit);
            self.evaluation = evaluator.update(&self.snapshot);
        }
    }

    /// Advances by one control tick (4 physics ticks).
    pub fn step(&mut self, input: &ControlInput) -> Step {
        self.step_telling(input, |_, _| {})
    }

    /// As [`Simulation::step`]; `on_applied` receives the applied set points before the
    /// physics runs. After a step that breaks the state nothing is due, the last good
    /// state stays, and [`Simulation::broken`] gives the reason.
    pub fn step_telling(
        &mut self,
        input: &ControlInput,
        on_applied: impl FnOnce(&Targets, &RobotControl),
    ) -> Step {
        if self.broken.is_some() || self.shown {
            return Step::default();
        }
        let last = Arc::clone(&self.snapshot);
        match guard::caught(|| self.advance(input, on_applied)) {
            Ok(Ok(step)) => step,
            Ok(Err(fault)) => self.break_off(fault, last),
            Err(words) => self.break_off(Fault::Panic(words), last),
        }
    }

    fn advance(
        &mut self,
        input: &ControlInput,
        on_applied: impl FnOnce(&Targets, &RobotControl),
    ) -> Result<Step, Fault> {
        let disturbance = self.disturbance();
        self.control.set_guard(self.person_guard(input));
        let mut targets = self.control.update(input, &self.snapshot);
        on_applied(&targets[0], &self.control);
        let push = disturbance.as_ref().and_then(|d| d.push);
        self.world
            .push(push.map(|(on, force)| (self.body_of(on), force)));
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

    /// The disturbance of the coming control tick; `None` when the scenario has none.
    #[must_use]
    pub fn disturbance(&self) -> Option<Disturbance> {
        let disturbances = self.scenario.disturbances.as_ref()?;
        // Deformables have no mass of their own in the engine; furniture cannot be
        // pushed.
        let target = self.scene.object_named(&self.scenario.target);
        let target = target.filter(|&i| self.scene.objects[i].soft.is_none());
        let target = target.map(|i| (i, self.scenario.objects[i].1.mass));
        Some(disturbances.disturbance(self.scenario.seed, self.world.tick(), target))
    }

    /// The body that a push acts on.
    #[must_use]
    pub fn body_of(&self, pushed: PushTarget) -> BodyRef {
        match pushed {
            PushTarget::Chair => BodyRef::Link(0),
            PushTarget::Hand => BodyRef::Link(self.model.roles.end_effector),
            PushTarget::Object(index) => BodyRef::Object(index),
        }
    }

    /// Reads the sensors that are due at the present tick. A whole snapshot is taken
    /// only for cameras, and after the last physics tick of a control tick.
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
        // The link is part of the model, so its state exists.
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

    /// Images that are due at the present tick, for the start of an episode.
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

    /// Whether the shapes of deformables are due at the present tick.
    #[must_use]
    pub fn deformable_due(&self) -> bool {
        self.schedules.deformable.due(self.snapshot.tick)
    }

    /// Distances by the laser scanner at the present tick, metres: +infinity beyond its
    /// range, -infinity below. `None` when no scan is due, the robot has no scanner, or
    /// recorded states are played back.
    #[must_use]
    pub fn scan_due(&self) -> Option<Vec<f32>> {
        let is_due = self.schedules.scan.due(self.snapshot.tick) && !self.shown;
        let settings = self.model.settings.scanner.as_ref().filter(|_| is_due)?;
        let scanner = Scanner::new(settings, self.model.link(&settings.link)?);
        let link = self.snapshot.links.get(scanner.link)?;
        let at = link.pose * scanner.mount;
        Some(scanner.reported(self.world.scan(&at, &scanner.rays)))
    }

    /// Input of a map of the home in the present state.
    #[must_use]
    pub fn map_source(&self, with_objects: bool) -> MapSource {
        let objects = self.snapshot.objects.iter().map(|object| object.pose);
        let objects: Vec<_> = objects.filter(|_| with_objects).collect();
        let chair = self.snapshot.links.first().map(|link| link.pose);
        let robot = (&self.model, self.person.as_deref());
        MapSource::new(robot, &self.scene, &chair.unwrap_or_default(), &objects)
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

    /// The scenario, including all sampled values.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The active sensor models.
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

    /// The person in the chair.
    #[must_use]
    pub fn person(&self) -> Option<&Arc<Person>> {
        self.person.as_ref()
    }

    /// Contacts of the person with the robot, and with objects that it touches.
    pub fn touches(&self) -> impl Iterator<Item = &Contact> {
        let contacts = &self.snapshot.contacts;
        let held = move |object: BodyRef| {
            let mut all = contacts.iter();
            all.any(|c| matches!(c.first, BodyRef::Link(_)) && c.second == object)
        };
        contacts.iter().filter(move |contact| {
            let by_robot = match contact.first {
                BodyRef::Link(_) => true,
                BodyRef::Object(_) => held(contact.first),
                BodyRef::Furniture(_) | BodyRef::Person(_) => false,
            };
            by_robot && matches!(contact.second, BodyRef::Person(_))
        })
    }

    /// The task, if any.
    #[must_use]
    pub fn task(&self) -> Option<&TaskSpec> {
        self.task.as_ref()
    }

    /// The assets folder.
    #[must_use]
    pub fn assets(&self) -> &Path {
        &self.assets
    }

    /// The worst audit of each deformable since the start.
    #[must_use]
    pub fn worst_of_soft(&self) -> Vec<WorstOfSoft> {
        self.world.worst_of_soft()
    }

    /// The robot's control, for publication.
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

    /// Contacts of the robot with furniture at the present tick that exceed
    /// [`HARD`](crate::tasks::HARD); none without a task.
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
