//! The operator profile: speeds, clearances and habits in which one operator
//! differs from another, drawn from a seed.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::drive::DriveLimits;
use wheelarm_proto::exact;
use wheelarm_proto::settings::Style;
use wheelarm_route::hybrid_a_star::PathPreferences;

/// Speeds of the human-like style at their peaks, as a share of the quick one's.
const HUMAN: f64 = 0.5;

/// Stop and go of the human-like style: a while of motion and a pause after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopAndGo {
    /// Seconds of motion, whose speed swells and ebbs away.
    pub go: f64,
    /// Seconds of pause.
    pub stop: f64,
}

impl StopAndGo {
    /// How fast the operator goes at a time since the beginning, 0 to 1.
    #[must_use]
    pub fn rate(&self, time: f64) -> f64 {
        let at = time.rem_euclid(self.go + self.stop);
        match at < self.go {
            true => exact::sin(std::f64::consts::PI * at / self.go).powi(2),
            false => 0.0,
        }
    }
}

/// How the hand takes things.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspPreferences {
    /// Distance from the pregrasp to the grasp, metres.
    pub standoff: f64,
    /// Distance from the arm's base to the thing on the floor plan, metres.
    pub distance: f64,
    /// The thing is raised by this much, metres.
    pub lift: f64,
}

/// What differs between one operator and another.
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
    /// The hand's path in free space is arched by this share of its length.
    pub arch: f64,
    /// Peak speed of the hand during the approach, m/s.
    pub approach_speed: f64,
    /// Peak speed of the hand with the object, m/s.
    pub carry_speed: f64,
    /// The hand goes back by this much with the object, metres.
    pub retract: f64,
    /// Force cap at each pad, N.
    pub force: f64,
    /// Stop and go; none for who goes straight on.
    pub pace: Option<StopAndGo>,
}

impl OperatorProfile {
    /// A profile drawn from `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |low: f64, high: f64| rng.random_range(low..high);
        Self {
            drive: DriveLimits {
                speed: draw(0.42, 0.50),
                acceleration: draw(0.18, 0.22),
                braking: draw(0.25, 0.35),
                turn_rate: draw(0.50, 0.65),
                turn_acceleration: draw(0.50, 0.65),
            },
            path: PathPreferences {
                radius: draw(0.70, 0.90),
                margin: 0.05,
            },
            grasp: GraspPreferences {
                standoff: draw(0.10, 0.13),
                distance: draw(0.70, 0.78),
                lift: draw(0.15, 0.19),
            },
            free_speed: draw(0.25, 0.35),
            approach_speed: draw(0.10, 0.14),
            carry_speed: draw(0.16, 0.22),
            retract: draw(0.08, 0.13),
            arch: draw(0.0, 0.05),
            force: 40.0,
            pace: None,
        }
    }

    /// The same operator in a style: a human-like one goes at `HUMAN` times the
    /// speeds, in stop and go.
    #[must_use]
    pub fn in_style(mut self, style: Style) -> Self {
        if style == Style::Human {
            let squared = HUMAN * HUMAN;
            self.drive.speed *= HUMAN;
            self.drive.turn_rate *= HUMAN;
            self.drive.acceleration *= squared;
            self.drive.braking *= squared;
            self.drive.turn_acceleration *= squared;
            self.free_speed *= HUMAN;
            self.approach_speed *= HUMAN;
            self.carry_speed *= HUMAN;
            // Who moves fast also pauses less.
            let habit = (self.free_speed / HUMAN - 0.25) / 0.10;
            self.pace = Some(StopAndGo {
                go: 0.72 + 0.17 * habit,
                stop: 1.27 + 0.6 * (1.0 - habit),
            });
        }
        self
    }
}
