//! Habits: the choices among equally good ways to do the work in which one episode differs
//! from another. Each is a wish: where the wish is out of reach or not collision-free, the
//! plain choice is used.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::tool_path::Shape;

/// How the hand moves from the pregrasp to the grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ApproachHabit {
    /// It stops at the pregrasp.
    Stop,
    /// It misjudges the pregrasp by this much in its own frame, metres, and corrects.
    Correct([f64; 3]),
    /// It does not stop: the approach begins before the hand has arrived.
    Blend,
}

/// Sampled choices of one episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Habits {
    /// Bearing of the object from the arm's base at the grasp against the chair's heading,
    /// radians.
    pub bearing: f64,
    /// Distance from the arm's base to the object on the floor plan, metres.
    pub distance: f64,
    /// Direction of the hand against the line from the arm's base, radians.
    pub twist: f64,
    /// Lean of the hand, as a share of the usual lean of the grasp, 0 to 1.
    pub lean: f64,
    /// Height of the grasp on an upright object, -1 (low) to 1 (high).
    pub height: f64,
    /// The hand gets ready from this share of the drive on, by these offsets from home in
    /// `wheelchair_root`, metres, of which the last is where it ends; `None` keeps it at home.
    pub prepare: Option<(f64, [[f64; 3]; STOPS])>,
    /// From the pregrasp to the grasp.
    pub approach: ApproachHabit,
    /// The chair backs off by this much while the object is carried back, metres.
    pub back_off: Option<f64>,
}

/// Step sequences by share: whether the hand gets ready during the drive, the approach, and
/// whether the chair backs off with the object. Shares are such that a task without backing
/// off still has five sequences above 10 %.
const SEQUENCES: [(f64, bool, ApproachHabit, bool); 6] = [
    (0.18, false, ApproachHabit::Stop, false),
    (0.18, false, ApproachHabit::Correct([0.0; 3]), true),
    (0.16, true, ApproachHabit::Stop, true),
    (0.18, true, ApproachHabit::Correct([0.0; 3]), true),
    (0.15, true, ApproachHabit::Blend, false),
    (0.15, true, ApproachHabit::Blend, true),
];
/// Most intermediate positions of a hand that gets ready.
pub const STOPS: usize = 5;
/// Greatest wanted bearing, radians.
const BEARING: f64 = 0.75;
/// Limits beside a seated person: to the person, and away, radians.
const BESIDE_PERSON: [f64; 2] = [-0.30, 0.85];

impl Habits {
    /// Samples the habits of one episode.
    #[must_use]
    pub fn sample(rng: &mut ChaCha8Rng) -> Self {
        let mut sample = |low: f64, high: f64| rng.random_range(low..high);
        let mut rest = sample(0.0, 1.0);
        let mut chosen = SEQUENCES[0];
        for sequence in SEQUENCES {
            chosen = sequence;
            rest -= sequence.0;
            if rest < 0.0 {
                break;
            }
        }
        let (_, prepares, approach, backs_off) = chosen;
        let begin = sample(0.02, 0.12);
        let ready = [(); STOPS].map(|()| {
            [
                sample(-0.12, -0.01),
                sample(-0.07, 0.07),
                sample(-0.14, 0.10),
            ]
        });
        let off = [
            sample(-0.03, 0.03),
            sample(-0.005, 0.03),
            sample(-0.045, -0.015),
        ];
        Self {
            bearing: sample(-BEARING, BEARING),
            distance: sample(0.66, 0.80),
            twist: sample(-0.25, 0.25),
            lean: sample(0.0, 1.0),
            height: sample(-1.0, 1.0),
            prepare: prepares.then_some((begin, ready)),
            approach: match approach {
                ApproachHabit::Correct(_) => ApproachHabit::Correct(off),
                other => other,
            },
            back_off: backs_off.then_some(sample(0.12, 0.35)),
        }
    }

    /// The same on the other side.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self {
            bearing: -self.bearing,
            twist: -self.twist,
            ..*self
        }
    }

    /// The same with half of the bearing and twist.
    #[must_use]
    pub fn milder(&self) -> Self {
        Self {
            bearing: 0.5 * self.bearing,
            twist: 0.5 * self.twist,
            ..*self
        }
    }

    /// The wanted bearing; the arm keeps away from the side of a seated person.
    #[must_use]
    pub fn bearing(&self, person_sits: bool) -> f64 {
        let [least, most] = match person_sits {
            true => BESIDE_PERSON,
            false => [-BEARING, BEARING],
        };
        // Evenly over what is left.
        let share = (self.bearing + BEARING) / (2.0 * BEARING);
        least + share * (most - least)
    }
}

/// Shapes of a movement to try in this order; the last one is straight.
#[must_use]
pub fn shapes(shape: &Shape) -> [Shape; 4] {
    let [share, angle] = shape.bow;
    let bow = |share, angle| Shape {
        bow: [share, angle],
        ..*shape
    };
    [
        *shape,
        bow(share, -angle),
        bow(0.5 * share, 0.0),
        Shape::default(),
    ]
}
