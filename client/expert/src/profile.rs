//! The operator profile: speeds, clearances, forces and habits in which one episode
//! differs from another, sampled from a seed.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::drive::DriveLimits;
use super::habits::Habits;
use super::tool_path::Shape;
use wheelarm_planning::floor_map::DRIVE_CLEARANCE;
use wheelarm_planning::hybrid_a_star::PathPreferences;
use wheelarm_proto::exact;
use wheelarm_proto::settings::Style;

/// The seed of the plain operator: no habits, one speed, one force.
pub const PLAIN: u64 = 0;
/// Speeds of chair and arm in the human-like style, as a share of the quick one's.
const HUMAN: [f64; 2] = [0.30, 0.45];
/// Slowest and fastest operator, as a share of the plain one's speeds: durations then vary
/// by a third, less than in data of several people.
const TEMPO: [f64; 2] = [0.30, 1.0];
/// The arm may be faster than the plain one's by this.
const ARM: f64 = 1.15;
/// Greatest difference of the speeds of chair and arm from the common tempo.
const APART: f64 = 0.12;
/// Force cap at each pad, N: least and greatest for an object of medium width.
const FORCE: [f64; 2] = [28.0, 70.0];
/// The cap at no width, and what the gripper's whole stroke adds, as a share of it: wide
/// objects are heavier.
const FORCE_BY_WIDTH: [f64; 2] = [0.75, 0.5];
/// Bow of free movements, as a share of their length.
const BOW: [f64; 2] = [0.13, 0.28];
/// To which side they bow, radians from upwards.
const SIDE: f64 = 1.2;
/// Greatest speed with the arm stowed and in narrow places, m/s, and on arcs: the chair begins
/// to turn late, and doors are narrow.
const NARROW: [f64; 2] = [0.35, 0.2];
/// Overlap of the legs of one movement.
const OVERLAP: [f64; 2] = [0.15, 0.40];

/// Preferences of a grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspPreferences {
    /// Distance from the pregrasp to the grasp, metres.
    pub standoff: f64,
    /// Distance from the arm's base to the object on the floor plan, metres.
    pub distance: f64,
    /// The object is raised by this much, metres.
    pub lift: f64,
}

/// Sampled parameters of one episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatorProfile {
    /// Chair.
    pub drive: DriveLimits,
    /// Arcs and clearance of the chair's path.
    pub path: PathPreferences,
    /// Hand.
    pub grasp: GraspPreferences,
    /// Peak speed of the hand in free space, m/s.
    pub free_speed: f64,
    /// Shape of the hand's path in free space.
    pub shape: Shape,
    /// Peak speed of the hand during the approach, m/s.
    pub approach_speed: f64,
    /// Peak speed of the hand with the object, m/s.
    pub carry_speed: f64,
    /// The hand moves back by this much with the object, metres.
    pub retract: f64,
    /// Force cap at each pad, N.
    pub force: f64,
    /// Habits; the plain operator has none.
    pub habits: Option<Habits>,
    /// Seed of the human-like pace; `None` for a constant rate.
    pub pace: Option<u64>,
    /// Speeds as a share of the plain operator's.
    pub tempo: f64,
}

impl OperatorProfile {
    /// A profile sampled from `seed`; that of [`PLAIN`] has no habits.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let plain = Self::plain(&mut rng);
        match seed {
            PLAIN => plain,
            _ => plain.varied(&mut rng),
        }
    }

    fn plain(rng: &mut ChaCha8Rng) -> Self {
        let mut sample = |low: f64, high: f64| rng.random_range(low..high);
        Self {
            drive: DriveLimits {
                speed: sample(0.42, 0.50),
                acceleration: sample(0.18, 0.22),
                braking: sample(0.25, 0.35),
                turn_rate: sample(0.50, 0.65),
                turn_acceleration: sample(0.50, 0.65),
                bend_speed: f64::INFINITY,
            },
            path: PathPreferences {
                radius: sample(0.70, 0.90),
                margin: DRIVE_CLEARANCE,
            },
            grasp: GraspPreferences {
                standoff: sample(0.10, 0.13),
                distance: sample(0.70, 0.78),
                lift: sample(0.15, 0.19),
            },
            free_speed: sample(0.25, 0.35),
            approach_speed: sample(0.10, 0.14),
            carry_speed: sample(0.16, 0.22),
            retract: sample(0.08, 0.13),
            shape: Shape {
                bow: [sample(0.0, 0.05), 0.0],
                ..Shape::default()
            },
            force: 40.0,
            habits: None,
            pace: None,
            tempo: 1.0,
        }
    }

    /// The same with habits, tempo, force and curves of its own.
    fn varied(mut self, rng: &mut ChaCha8Rng) -> Self {
        let mut sample = |low: f64, high: f64| rng.random_range(low..high);
        // Slow and quick operators are more frequent than those between.
        let share = 0.5 - 0.5 * exact::cos(std::f64::consts::PI * sample(0.0, 1.0));
        self.tempo = TEMPO[0] * exact::powf(TEMPO[1] / TEMPO[0], share);
        let mut between = |[low, high]: [f64; 2]| low * exact::powf(high / low, sample(0.0, 1.0));
        self.force = between(FORCE);
        self.shape.bow[0] = between(BOW);
        self.shape.overlap = between(OVERLAP);
        let chair = between([1.0 - APART, 1.0 + APART]) * self.tempo;
        let arm = between([1.0 - APART, 1.0 + APART]) * self.tempo * ARM;
        self.shape.bow[1] = sample(-SIDE, SIDE);
        self.at_speeds(chair.min(1.0), arm);
        self.habits = Some(Habits::sample(rng));
        self
    }

    /// The same with the speed of a chair in narrow places.
    #[must_use]
    pub fn in_narrow_places(&self) -> Self {
        let mut slow = *self;
        slow.drive.speed = slow.drive.speed.min(NARROW[0]);
        slow.drive.bend_speed = NARROW[1];
        slow
    }

    /// Multiplies the speeds of chair and arm. Accelerations fall more, by the power 1.5: a
    /// slow operator is also a gentle one.
    fn at_speeds(&mut self, chair: f64, arm: f64) {
        let gentle = chair * chair.sqrt();
        self.drive.speed *= chair;
        self.drive.turn_rate *= chair;
        self.drive.acceleration *= gentle;
        self.drive.braking *= gentle;
        self.drive.turn_acceleration *= gentle;
        self.free_speed *= arm;
        // Not faster where something may be pushed over or dropped.
        self.approach_speed *= arm.min(1.0);
        self.carry_speed *= arm.min(1.0);
    }

    /// Force cap at each pad for an object whose width is this share of the gripper's stroke, N.
    #[must_use]
    pub fn force_at(&self, share: f64) -> f64 {
        let [none, whole] = FORCE_BY_WIDTH;
        match self.habits {
            Some(_) => self.force * (none + whole * share),
            None => self.force,
        }
    }

    /// The same operator in a style: a human-like one moves at `HUMAN` times the
    /// speeds, at an irregular pace. Tempo counts half there, because pauses add to the
    /// duration.
    #[must_use]
    pub fn in_style(mut self, style: Style, seed: u64) -> Self {
        if style == Style::Human {
            let [chair, arm] = HUMAN.map(|share| share / self.tempo.sqrt());
            self.at_speeds(chair, arm);
            self.tempo = self.tempo.sqrt();
            self.pace = Some(seed);
        }
        self
    }
}
