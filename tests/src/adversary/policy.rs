//! Adversarial policies.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use wheelarm_server::robot::control::{
    ArmIntent, BaseIntent, ControlInput, GripperIntent, IntentFrame,
};
use wheelarm_server::sim::Simulation;

/// Closed knuckle, rad, and greatest force, N: beyond those of any gripper, so that the
/// control clamps them to its own.
const CLOSED: f64 = 4.0;
const HARD: f64 = 1e4;
/// Target of the hand over an object, metres.
const ABOVE: f64 = 0.12;

/// Kind of adversarial policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Joint targets jump between far ends at 60 Hz.
    Limits,
    /// Random joint targets, random driving.
    Joints,
    /// Random twists of the hand.
    Twists,
    /// Random steps of the hand, driving to and fro.
    Steps,
    /// Random poses.
    Poses,
    /// Full speed with the arm stretched out.
    Ram,
    /// The hand pressed down on the surface below.
    PressDown,
    /// The arm folded into its own chair.
    IntoItself,
    /// After the object: at it, pressed on it, thrown, the gripper working.
    Harass,
    /// The bear pressed onto the table with an open, then a closed hand.
    Press,
    /// The bear held with full force and pulled.
    Tear,
    /// The bear grasped, swung and released.
    Throw,
    /// The bear pushed along the table and against its objects.
    SqueezeAtTable,
    /// The bear grasped and pressed against the wall.
    SqueezeAtWall,
    /// The bear grasped and pressed against the chair and the arm itself.
    SqueezeAtChair,
}

impl Kind {
    /// For any task.
    pub const ANYWHERE: [Self; 9] = [
        Self::Limits,
        Self::Joints,
        Self::Twists,
        Self::Steps,
        Self::Poses,
        Self::Ram,
        Self::PressDown,
        Self::IntoItself,
        Self::Harass,
    ];
    /// For the soft object.
    pub const AT_THE_BEAR: [Self; 8] = [
        Self::Harass,
        Self::Press,
        Self::Tear,
        Self::Throw,
        Self::SqueezeAtTable,
        Self::Harass,
        Self::SqueezeAtWall,
        Self::SqueezeAtChair,
    ];
}

/// One policy with its state.
#[derive(Debug)]
pub struct Policy {
    kind: Kind,
    random: ChaCha8Rng,
    object: usize,
    hand: usize,
    joints: [f64; 6],
    drive: [f64; 2],
    offset: Vector3<f64>,
    spin: Vector3<f64>,
    push: Vector3<f64>,
    knuckle: f64,
}

impl Policy {
    /// A policy at the start of a scene.
    #[must_use]
    pub fn new(kind: Kind, seed: u64, sim: &Simulation) -> Self {
        let target = &sim.scenario().target;
        let mut objects = sim.scene().objects.iter();
        let hand = sim.model().link(&sim.model().settings.end_effector_link);
        Self {
            kind,
            random: ChaCha8Rng::seed_from_u64(seed),
            object: objects.position(|o| o.name == *target).unwrap_or(0),
            hand: hand.unwrap_or(0),
            joints: [0.0; 6],
            drive: [0.0; 2],
            offset: Vector3::zeros(),
            spin: Vector3::zeros(),
            push: Vector3::zeros(),
            knuckle: 0.0,
        }
    }

    fn within(&mut self, far: f64) -> f64 {
        self.random.random_range(-far..=far)
    }

    fn vector(&mut self, far: f64) -> Vector3<f64> {
        Vector3::new(self.within(far), self.within(far), self.within(far))
    }

    fn either(&mut self, a: f64, b: f64) -> f64 {
        if self.random.random_bool(0.5) { a } else { b }
    }

    fn drive(&mut self, tick: u64, every: u64, linear: f64, angular: f64) -> Option<BaseIntent> {
        if tick.is_multiple_of(every) {
            self.drive = [self.within(linear), self.within(angular)];
        }
        let [linear, angular] = self.drive;
        Some(BaseIntent { linear, angular })
    }

    fn grip(&mut self, tick: u64, every: u64) -> Option<GripperIntent> {
        if tick.is_multiple_of(every) {
            self.knuckle = self.either(0.0, CLOSED);
        }
        grip(self.knuckle)
    }

    /// Control input of a control tick.
    pub fn input(&mut self, tick: u64, sim: &Simulation) -> ControlInput {
        match self.kind {
            Kind::Limits => {
                let joints = std::array::from_fn(|_| self.either(-100.0, 100.0));
                input(Some(ArmIntent::Joints(joints)), None, self.grip(tick, 1))
            }
            Kind::Joints => {
                if tick.is_multiple_of(25) {
                    self.joints = std::array::from_fn(|_| self.within(6.3));
                }
                let arm = Some(ArmIntent::Joints(self.joints));
                input(arm, self.drive(tick, 40, 5.0, 10.0), self.grip(tick, 30))
            }
            Kind::Twists => {
                if tick.is_multiple_of(16) {
                    (self.push, self.spin) = (self.vector(10.0), self.vector(20.0));
                }
                let frame = self.frame();
                let arm = Some(twist(frame, self.push, self.spin));
                input(arm, self.drive(tick, 60, 5.0, 10.0), self.grip(tick, 10))
            }
            Kind::Steps => {
                let arm = ArmIntent::Step {
                    frame: self.frame(),
                    translation: self.vector(1.0),
                    rotation: self.vector(3.2),
                };
                let (linear, angular) = (self.either(-5.0, 5.0), self.either(-10.0, 10.0));
                let base = Some(BaseIntent { linear, angular });
                input(Some(arm), base, self.grip(tick, 30))
            }
            Kind::Poses => {
                let arm = tick.is_multiple_of(20).then(|| self.pose());
                input(arm, self.drive(tick, 90, 0.5, 1.0), self.grip(tick, 45))
            }
            Kind::Ram => {
                let first = self.within(1.0);
                let arm =
                    (tick == 0).then_some(ArmIntent::Joints([first, 1.2, 0.6, 0.0, 0.2, 0.0]));
                if tick.is_multiple_of(120) {
                    self.drive = [self.either(5.0, -5.0), self.within(3.0)];
                }
                input(arm, self.drive(1, 2, 0.0, 0.0), self.grip(tick, 20))
            }
            Kind::PressDown => {
                let (aside, spin) = (self.vector(0.3), self.vector(2.0));
                let down = Vector3::new(aside.x, aside.y, -10.0);
                let arm = Some(twist(IntentFrame::House, down, spin));
                input(arm, self.drive(tick, 100, 1.0, 2.0), self.grip(tick, 20))
            }
            Kind::IntoItself => {
                let arm = if (tick / 120).is_multiple_of(2) {
                    let first = self.either(0.0, std::f64::consts::PI);
                    ArmIntent::Joints([first, -2.2, -2.5, 0.0, -2.0, 0.0])
                } else {
                    twist(IntentFrame::Wheelchair, self.vector(3.0), Vector3::zeros())
                };
                input(Some(arm), None, self.grip(tick, 60))
            }
            Kind::Harass => self.harass(tick, sim),
            Kind::Press => self.work(
                tick,
                sim,
                &[Phase::Onto, Phase::Down, Phase::Down, Phase::Away],
            ),
            Kind::Tear => self.work(
                tick,
                sim,
                &[Phase::Onto, Phase::Take, Phase::Tear, Phase::Tear],
            ),
            Kind::Throw => self.work(
                tick,
                sim,
                &[Phase::Onto, Phase::Take, Phase::Swing, Phase::LetGo],
            ),
            Kind::SqueezeAtTable => self.work(
                tick,
                sim,
                &[Phase::Onto, Phase::Take, Phase::Down, Phase::Aside],
            ),
            Kind::SqueezeAtWall => self.work(
                tick,
                sim,
                &[Phase::Onto, Phase::Take, Phase::Ahead, Phase::Ahead],
            ),
            Kind::SqueezeAtChair => self.work(
                tick,
                sim,
                &[Phase::Onto, Phase::Take, Phase::Back, Phase::Back],
            ),
        }
    }

    fn frame(&mut self) -> IntentFrame {
        let frames = [
            IntentFrame::ArmBase,
            IntentFrame::EndEffector,
            IntentFrame::Wheelchair,
            IntentFrame::House,
        ];
        frames[self.random.random_range(0..frames.len())]
    }

    fn pose(&mut self) -> ArmIntent {
        let [x, y, z, w] = std::array::from_fn(|_| self.within(1.0));
        let turn = UnitQuaternion::new_normalize(Quaternion::new(w + 1e-3, x, y, z));
        ArmIntent::Pose {
            frame: self.frame(),
            pose: Isometry3::from_parts(self.vector(1.2).into(), turn),
        }
    }

    /// From the hand to a point over the object, metres.
    fn way(&mut self, tick: u64, sim: &Simulation) -> Vector3<f64> {
        if tick.is_multiple_of(30) {
            self.offset = self.vector(0.07);
        }
        let snapshot = sim.snapshot();
        let at = |pose: &Isometry3<f64>| pose.translation.vector;
        let hand = at(&snapshot.links[self.hand].pose);
        let object = snapshot.objects.get(self.object);
        let object = object.map_or(hand, |object| at(&object.pose));
        object + self.offset + Vector3::z() * ABOVE - hand
    }

    fn harass(&mut self, tick: u64, sim: &Simulation) -> ControlInput {
        let way = self.way(tick, sim);
        if tick.is_multiple_of(40) {
            self.spin = self.vector(1.7);
        }
        if tick.is_multiple_of(60) {
            let half = self.either(0.0, 0.4);
            self.knuckle = self.either(half, CLOSED);
        }
        let push = match (tick / 180) % 4 {
            3 => self.vector(10.0),
            2 => Vector3::new(0.0, 0.0, -10.0),
            _ => way.map(|x| (x * 6.0).clamp(-10.0, 10.0)),
        };
        let arm = Some(twist(IntentFrame::House, push, self.spin));
        input(arm, self.drive(tick, 120, 0.2, 0.3), grip(self.knuckle))
    }

    /// Phases of a second and a half, over and over.
    fn work(&mut self, tick: u64, sim: &Simulation, phases: &[Phase]) -> ControlInput {
        let phase = phases[((tick / 90) % phases.len() as u64) as usize];
        let mut way = self.way(tick, sim);
        if tick.is_multiple_of(20) {
            (self.push, self.spin) = (self.vector(3.0), self.vector(3.0));
        }
        let chair = sim.snapshot().links[0].pose.rotation;
        let ahead = chair * Vector3::x();
        let (push, knuckle) = match phase {
            Phase::Onto => (way * 6.0, 0.0),
            Phase::Take => {
                way.z -= ABOVE / 2.0;
                (way * 3.0, CLOSED)
            }
            Phase::Down => (
                Vector3::new(self.push.x * 0.1, self.push.y * 0.1, -10.0),
                CLOSED,
            ),
            Phase::Tear => (self.push * 3.0, CLOSED),
            Phase::Swing => (self.push + Vector3::z(), CLOSED),
            Phase::LetGo => (self.push * 3.0, 0.0),
            Phase::Aside => (Vector3::new(self.push.x, self.push.y, -0.3), CLOSED),
            Phase::Ahead => (ahead * 3.0 + self.push * 0.1, CLOSED),
            Phase::Back => (ahead * -3.0 + self.push * 0.2, CLOSED),
            Phase::Away => (Vector3::z() * 0.5, self.knuckle),
        };
        self.knuckle = knuckle;
        let base = match phase {
            Phase::Ahead => Some(BaseIntent {
                linear: 0.5,
                angular: 0.0,
            }),
            Phase::Back => Some(BaseIntent {
                linear: -0.3,
                angular: 0.3,
            }),
            _ => Some(BaseIntent::default()),
        };
        let arm = Some(twist(IntentFrame::House, push, self.spin * 0.5));
        input(arm, base, grip(knuckle))
    }
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Onto,
    Take,
    Down,
    Tear,
    Swing,
    LetGo,
    Aside,
    Ahead,
    Back,
    Away,
}

fn twist(frame: IntentFrame, linear: Vector3<f64>, angular: Vector3<f64>) -> ArmIntent {
    ArmIntent::Twist {
        frame,
        linear,
        angular,
    }
}

#[expect(clippy::unnecessary_wraps, reason = "an absent group is none")]
fn grip(knuckle: f64) -> Option<GripperIntent> {
    Some(GripperIntent {
        knuckle,
        max_force: Some(HARD),
    })
}

fn input(
    arm: Option<ArmIntent>,
    base: Option<BaseIntent>,
    gripper: Option<GripperIntent>,
) -> ControlInput {
    ControlInput { arm, base, gripper }
}
