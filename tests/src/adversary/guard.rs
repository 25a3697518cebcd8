//! An operator who presses the seated person as hard as the guard allows.
//!
//! A seed gives the person, the start, the object in the hand and a series of devices
//! of at most two seconds each. Each change of device is a take-over: the new intent
//! begins while the old one still moves. One tick in six hundred the operator sends nothing.

use std::path::Path;
use std::sync::OnceLock;

use anyhow::{Context as _, Result};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use wheelarm_proto::CONTROL_HZ;
use wheelarm_server::people::{BodyPart, PARTS, PersonSetting};
use wheelarm_server::robot::control::{
    ArmIntent, BaseIntent, ControlInput, GripperIntent, IntentFrame,
};
use wheelarm_server::scene::Placement;
use wheelarm_server::sim::{Pacing, Scenario, Simulation};
use wheelarm_server::snapshot::BodyRef;

use super::{Start, chair_at};

/// Greatest force on a part of the body, N.
const MOST: f64 = 15.0;
/// Objects in the hand, with the width, m, at which the fingers hold them, and how far their
/// middle is beyond the grasp point, m: the palm does not reach into them.
const HELD: [(&str, f64, f64); 4] = [
    ("coke", 0.066, 0.0),
    ("straw_cup", 0.068, 0.0),
    ("tomato_soup", 0.0677, 0.0),
    ("mustard", 0.058, 0.044),
];
/// Bodies and postures by turns.
const BODIES: [&str; 7] = [
    "man_p50",
    "woman_p5",
    "man_p95",
    "woman_80",
    "woman_heavy",
    "girl_12",
    "man_thin",
];
const POSTURES: [&str; 6] = [
    "hands_in_lap",
    "hands_on_armrests",
    "hands_on_thighs",
    "leaning_forward",
    "leaning_left",
    "looking_up",
];
/// Knuckle angle, rad, and force, N, of a closed hand: beyond those of any gripper, so that
/// the control clamps them to its own.
const CLOSED: f64 = 4.0;
const GRIP: f64 = 1e4;

/// One episode against the guard.
#[derive(Clone, Copy, Debug)]
pub struct GuardRun {
    /// Everything follows from it.
    pub seed: u64,
    /// Whether the guard is on; off shows that the operator is strong.
    pub guard: bool,
}

/// Result of an episode.
#[derive(Clone, Debug, Default)]
pub struct GuardVerdict {
    /// Control ticks.
    pub ticks: u64,
    /// Greatest force of the robot, of what it holds, and of furniture on each part of
    /// the body, N, in the order of `PARTS`.
    pub forces: [f64; PARTS.len()],
    /// The same for the parts above the limit, with the tick, the bodies and the device.
    pub broken: Vec<String>,
    /// Share of ticks in which the person was touched.
    pub touched: f64,
    /// The simulation ended by itself.
    pub fault: Option<String>,
}

impl GuardVerdict {
    /// Greatest force on any part, N.
    #[must_use]
    pub fn force(&self) -> f64 {
        self.forces.iter().copied().fold(0.0, f64::max)
    }
}

/// Kind of arm command for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Device {
    /// Twists towards the target.
    Twist,
    /// Twists along the contact normal, into the body.
    Press,
    /// Steps towards the target.
    Steps,
    /// A pose in the target.
    Pose,
    /// Joint positions at which the arm is inside the body.
    Joints,
    /// Joint positions anywhere.
    AnyJoints,
    /// Turns of the hand.
    Turn,
    /// Nothing is sent.
    Silent,
}

const DEVICES: [Device; 10] = [
    Device::Twist,
    Device::Press,
    Device::Twist,
    Device::Steps,
    Device::Pose,
    Device::Joints,
    Device::Joints,
    Device::AnyJoints,
    Device::Turn,
    Device::Silent,
];

const FRAMES: [IntentFrame; 4] = [
    IntentFrame::ArmBase,
    IntentFrame::EndEffector,
    IntentFrame::Wheelchair,
    IntentFrame::House,
];

struct Operator {
    random: ChaCha8Rng,
    device: Device,
    frame: IntentFrame,
    left: u64,
    /// Capsule that is pressed.
    target: usize,
    goal: [f64; 6],
    spin: Vector3<f64>,
    base: BaseIntent,
    knuckle: f64,
    holds: bool,
}

impl GuardRun {
    fn start(random: &mut ChaCha8Rng) -> (Start, Option<Isometry3<f64>>) {
        match random.random_range(0..4) {
            0 => (Start::Sampled, None),
            1 => (Start::Wall, Some(chair_at(-3.85, 2.48, 60.0))),
            _ => (Start::KitchenTable, Some(chair_at(-3.85, 2.48, 86.0))),
        }
    }

    /// The scenario, made from an empty home without a person.
    fn scenario(&self, base: &Simulation, random: &mut ChaCha8Rng) -> (Scenario, bool) {
        let pick = |random: &mut ChaCha8Rng, of: &[&'static str]| {
            of[random.random_range(0..of.len())].to_owned()
        };
        let (_, start) = Self::start(random);
        let person = PersonSetting {
            body: pick(random, &BODIES),
            posture: pick(random, &POSTURES),
            seed: Some(self.seed),
            guard: self.guard,
            mouth_open: random.random_bool(0.3),
            ..PersonSetting::default()
        };
        let mut scenario = Scenario {
            seed: self.seed,
            start,
            person: Some(person),
            ..plain()
        };
        let holds = random.random_bool(0.5);
        if holds {
            let (name, width, beyond) = HELD[random.random_range(0..HELD.len())];
            let model = base.model();
            let chair = start.unwrap_or(base.snapshot().links[0].pose);
            let mut joints = vec![0.0; model.joints.len()];
            for (joint, position) in model.roles.arm.iter().zip(model.settings.home) {
                joints[*joint] = position;
            }
            let hand = chair * model.link_poses(&joints)[model.roles.end_effector];
            let known = &base.scenario().objects;
            if let Some((_, placed)) = known.iter().find(|(known, _)| known == name) {
                let placed = Placement {
                    pose: in_hand(&hand, model.settings.tool_length + beyond),
                    ..*placed
                };
                let map = wheelarm_server::robot::control::GripperMap::new(model);
                scenario.knuckle = Some(map.knuckle(width + 0.001));
                scenario.objects = vec![(name.to_owned(), placed)];
            }
        }
        (scenario, holds)
    }

    /// Runs an episode of a length in seconds.
    ///
    /// # Errors
    /// When the scenario cannot be made.
    pub fn play(&self, assets: &Path, seconds: f64) -> Result<GuardVerdict> {
        static BASE: OnceLock<Simulation> = OnceLock::new();
        let base = BASE.get_or_init(|| Simulation::new(assets, plain()).expect("an empty home"));
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let (scenario, holds) = self.scenario(base, &mut random);
        let mut sim = Simulation::new(assets, scenario).context("the episode")?;
        let mut operator = Operator {
            random,
            device: Device::Silent,
            frame: IntentFrame::House,
            left: 20,
            target: 0,
            goal: sim.arm_positions(),
            spin: Vector3::zeros(),
            base: BaseIntent::default(),
            knuckle: if holds { CLOSED } else { 0.0 },
            holds,
        };
        let mut verdict = GuardVerdict::default();
        let ticks = (seconds * CONTROL_HZ as f64) as u64;
        let mut touched = 0u64;
        for tick in 0..ticks {
            let input = operator.input(&sim);
            sim.step(&input);
            verdict.ticks += 1;
            if let Some(words) = sim.broken() {
                verdict.fault = Some(words.to_owned());
                break;
            }
            touched += u64::from(add_forces(&sim, tick, &operator, &mut verdict));
        }
        verdict.touched = touched as f64 / verdict.ticks.max(1) as f64;
        Ok(verdict)
    }
}

/// The home without a task.
fn plain() -> Scenario {
    Scenario {
        task: String::new(),
        cameras: Vec::new(),
        pacing: Pacing::Fast,
        ..Scenario::default()
    }
}

/// Pose of an object in a level hand that grasps it 65 mm above its foot.
fn in_hand(hand: &Isometry3<f64>, tool: f64) -> Isometry3<f64> {
    let forward = hand.rotation * Vector3::z();
    let mut closing = hand.rotation * Vector3::x();
    if forward.cross(&closing).z < 0.0 {
        closing = -closing;
    }
    let axes = Matrix3::from_columns(&[forward, closing, forward.cross(&closing)]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let grasp = (hand * Point3::new(0.0, 0.0, tool)).coords;
    let foot = grasp - turn * Vector3::new(0.0, 0.0, 0.065);
    Isometry3::from_parts(Translation3::from(foot), turn)
}

/// Adds the forces of a tick; whether the person is touched.
fn add_forces(
    sim: &Simulation,
    tick: u64,
    operator: &Operator,
    verdict: &mut GuardVerdict,
) -> bool {
    let snapshot = sim.snapshot();
    let (Some(person), Some(state)) = (sim.person(), &snapshot.person) else {
        return false;
    };
    // An object counts with the robot while both fingers hold it. One that is dropped falls
    // onto the person, which no guard can stop.
    let tips = sim.model().roles.finger_tips;
    let tips = tips.map(|joint| BodyRef::Link(sim.model().joints[joint].child));
    let held = |object: BodyRef| {
        let mut tips = tips.iter();
        let touches = |tip: &BodyRef| {
            let mut contacts = snapshot.contacts.iter();
            contacts.any(|c| c.first == *tip && c.second == object)
        };
        tips.all(touches)
    };
    let mut own = [0.0; PARTS.len()];
    let mut by = [None; PARTS.len()];
    for contact in &snapshot.contacts {
        let BodyRef::Person(capsule) = contact.second else {
            continue;
        };
        let part = person.capsules[capsule].part.index();
        if matches!(contact.first, BodyRef::Object(_)) && !held(contact.first) {
            continue;
        }
        own[part] += contact.force.norm();
        by[part] = Some(contact.first);
    }
    let mut any = false;
    for (i, part) in PARTS.iter().enumerate() {
        if *part == BodyPart::Mouth {
            continue;
        }
        // Between control ticks: all that presses, or the robot where objects may fall.
        let between = match operator.holds {
            true => state.forces[i].min(state.robot_force),
            false => state.forces[i],
        };
        let force = own[i].max(between);
        any |= force > 0.0;
        if force > MOST && verdict.broken.len() < 4 {
            let by = by[i].map_or_else(|| "an earlier tick".to_owned(), |b| name(sim, b));
            let others = snapshot.contacts.iter().filter(|c| c.force.norm() > 1.0);
            let others = others.filter(|c| {
                matches!(c.first, BodyRef::Link(_)) || matches!(c.second, BodyRef::Person(_))
            });
            let others = others.map(|c| {
                let [one, other] = [name(sim, c.first), name(sim, c.second)];
                format!("{one} on {other} {:.0} N", c.force.norm())
            });
            let others: Vec<String> = others.collect();
            let speeds = sim.model().roles.arm.map(|j| snapshot.joints[j].velocity);
            verdict.broken.push(format!(
                "control tick {tick}: {by} presses {} with {force:.1} N under {:?} in {:?}, chair {:?}; joints at {speeds:.2?} rad/s; {}",
                part.name(),
                operator.device,
                operator.frame,
                (operator.base.linear, operator.base.angular),
                others.join(", "),
            ));
        }
        verdict.forces[i] = verdict.forces[i].max(force);
    }
    any
}

fn name(sim: &Simulation, body: BodyRef) -> String {
    match body {
        BodyRef::Link(i) => sim.model().links[i].name.clone(),
        BodyRef::Object(i) => sim.scene().objects[i].name.clone(),
        BodyRef::Furniture(i) => sim.scene().furniture[i].name.clone(),
        BodyRef::Person(i) => format!("capsule {i}"),
    }
}

impl Operator {
    fn vector(&mut self, far: f64) -> Vector3<f64> {
        let mut part = || self.random.random_range(-far..=far);
        Vector3::new(part(), part(), part())
    }

    fn take_over(&mut self, sim: &Simulation) {
        self.device = DEVICES[self.random.random_range(0..DEVICES.len())];
        self.frame = FRAMES[self.random.random_range(0..FRAMES.len())];
        self.left = self.random.random_range(20..120);
        let person = sim.person().expect("a person");
        self.target = match self.random.random_range(0..3) {
            // Head or face.
            0 => self.random.random_range(0..2),
            _ => self.random.random_range(0..person.capsules.len()),
        };
        self.spin = self.vector(1.7);
        let mut joints = |inside: bool| {
            let mut goal = sim.arm_positions();
            for _ in 0..60 {
                goal = std::array::from_fn(|i| {
                    sim.arm_positions()[i] + self.random.random_range(-1.6..=1.6)
                });
                if !inside || sim.arm_meets(&goal).is_some() {
                    break;
                }
            }
            goal
        };
        self.goal = match self.device {
            Device::Joints => joints(true),
            _ => joints(false),
        };
        let speed = match self.random.random_range(0..5) {
            0 => (0.0, 1.0),
            1 => (0.0, -1.0),
            2 => (0.5, self.random.random_range(-1.0..=1.0)),
            3 => (-0.5, self.random.random_range(-1.0..=1.0)),
            _ => (0.0, 0.0),
        };
        self.base = BaseIntent {
            linear: speed.0,
            angular: speed.1,
        };
        // An object in the hand is mostly kept.
        let opens = self.random.random_bool(if self.holds { 0.1 } else { 0.5 });
        self.knuckle = if opens { 0.0 } else { CLOSED };
    }

    /// From the grasp point to the target in `house`.
    fn way(&self, sim: &Simulation) -> Vector3<f64> {
        let snapshot = sim.snapshot();
        let person = sim.person().expect("a person");
        let head = snapshot.person.as_ref().map(|p| p.head).unwrap_or_default();
        let [a, b] = person.ends(&person.capsules[self.target], &head);
        let aim = snapshot.links[0].pose * nalgebra::center(&a, &b);
        let hand = snapshot.links[sim.model().roles.end_effector].pose;
        aim.coords - (hand * Point3::new(0.0, 0.0, sim.model().settings.tool_length)).coords
    }

    /// frame_from_house of the operator's frame.
    fn frame_from_house(&self, sim: &Simulation) -> Isometry3<f64> {
        let links = &sim.snapshot().links;
        match self.frame {
            IntentFrame::ArmBase => links[sim.model().roles.arm_base].pose.inverse(),
            IntentFrame::EndEffector => links[sim.model().roles.end_effector].pose.inverse(),
            IntentFrame::Wheelchair => links[0].pose.inverse(),
            IntentFrame::House => Isometry3::identity(),
        }
    }

    fn arm(&mut self, sim: &Simulation) -> Option<ArmIntent> {
        let turn = self.frame_from_house(sim).rotation;
        let way = self.way(sim);
        let (frame, spin) = (self.frame, self.spin);
        let twist = |linear: Vector3<f64>, angular: Vector3<f64>| ArmIntent::Twist {
            frame,
            linear: turn * linear,
            angular,
        };
        Some(match self.device {
            Device::Twist => twist(way * 10.0, Vector3::zeros()),
            Device::Press => {
                let contact = sim.touches().next().map(|c| c.force);
                let along = contact.and_then(|force| force.try_normalize(1e-6));
                twist(along.unwrap_or(way) * 10.0, Vector3::zeros())
            }
            Device::Turn => twist(way, spin),
            Device::Steps => ArmIntent::Step {
                frame,
                translation: turn * way.map(|x| x.clamp(-0.05, 0.05)),
                rotation: Vector3::zeros(),
            },
            Device::Pose => {
                let hand = sim.snapshot().links[sim.model().roles.end_effector].pose;
                let at = Translation3::from(hand.translation.vector + way);
                let goal = Isometry3::from_parts(at, hand.rotation);
                ArmIntent::Pose {
                    frame,
                    pose: self.frame_from_house(sim) * goal,
                }
            }
            Device::Joints | Device::AnyJoints => ArmIntent::Joints(self.goal),
            Device::Silent => return None,
        })
    }

    fn input(&mut self, sim: &Simulation) -> ControlInput {
        let grip = |knuckle| {
            Some(GripperIntent {
                knuckle,
                max_force: Some(GRIP),
            })
        };
        if self.left == 0 {
            self.take_over(sim);
        }
        self.left -= 1;
        if self.device == Device::Silent || self.random.random_range(0..600) == 0 {
            return ControlInput {
                gripper: grip(self.knuckle),
                ..ControlInput::default()
            };
        }
        ControlInput {
            arm: self.arm(sim),
            base: Some(self.base),
            gripper: grip(self.knuckle),
        }
    }
}
