//! Shift: the chair rolls a little while the hand stays where it is at a handle, so that the arm
//! reaches the rest of an arc.

use nalgebra::Isometry3;
use wheelarm_planning::footprint_check::FootprintCheck;
use wheelarm_planning::hybrid_a_star::Segment;

use super::Now;
use crate::base_placement::{self, GENTLE};
use crate::drive::{Drive, DriveLimits};

/// Lengths that are tried, metres: back before ahead, as a door opens towards the chair.
const LENGTHS: [f64; 10] = [
    -0.06, -0.12, -0.18, -0.25, 0.06, -0.32, 0.12, -0.4, 0.18, 0.25,
];
/// Spacing at which arm and floor are checked, metres.
const SPACING: f64 = 0.04;
/// Room around the chair, metres.
const ROOM: f64 = 0.02;
/// Limits of the chair: the hand holds a handle.
const SLOW: DriveLimits = DriveLimits {
    speed: 0.08,
    acceleration: 0.1,
    braking: 0.1,
    turn_rate: 0.1,
    turn_acceleration: 0.1,
    bend_speed: f64::INFINITY,
};
/// The chair has arrived this long after the end of its drive, seconds.
const REST: f64 = 0.8;

/// A roll of the chair under way.
#[derive(Clone, Debug)]
pub(super) struct Shift {
    drive: Drive,
    begun: f64,
    /// The hand in `house`.
    hand: Isometry3<f64>,
    /// Metres.
    pub length: f64,
}

impl Shift {
    /// The shortest roll after which the arm follows one of the lists of `ways` in `house`
    /// gently. The chair keeps clear of the furniture as it is and, of what moves, as `opened`.
    pub(super) fn plan(
        now: &mut Now<'_>,
        ways: &[Vec<Isometry3<f64>>],
        opened: &FootprintCheck,
    ) -> Option<Self> {
        let chair = now.observation.chair();
        let hand = now.house_from_desired();
        let present = now.scene.footprint_check(now.poses);
        let base_from_house = |by: f64| {
            let at = base_placement::standing(&chair.rolled(by, 0.0));
            (at * now.scene.chair_from_base).inverse()
        };
        let found = LENGTHS.into_iter().find(|length| {
            let steps = (length.abs() / SPACING).ceil() as u32;
            let rolled = |step: u32| length * f64::from(step) / f64::from(steps);
            let is_free = (1..=steps).all(|step| {
                let pose = chair.rolled(rolled(step), 0.0);
                present.is_free(&pose, ROOM) && opened.is_free(&pose, ROOM)
            });
            let held = (1..=steps).map(|step| base_from_house(rolled(step)) * hand);
            let held: Vec<_> = held.collect();
            let start = base_from_house(0.0) * hand;
            let there = base_from_house(*length);
            is_free
                && ways.iter().any(|way| {
                    let way = way.iter().map(|pose| there * pose);
                    let poses: Vec<_> = held.iter().copied().chain(way).collect();
                    base_placement::reaches_within(&start, &poses, GENTLE, now.reach)
                })
        });
        let length = found?;
        let roll = Segment::Roll {
            length,
            curvature: 0.0,
        };
        Some(Self {
            drive: Drive::new(chair, &[roll], &SLOW),
            begun: now.observation.time,
            hand,
            length,
        })
    }

    /// Target of the hand in `base_link` and velocity of the chair; `None` when it is over.
    pub(super) fn step(&self, now: &Now<'_>) -> Option<(Isometry3<f64>, [f64; 2])> {
        let time = now.observation.time - self.begun;
        let base = match time < self.drive.duration() {
            true => self.drive.command(time, &now.observation.chair()),
            false => [0.0, 0.0],
        };
        let tool = now.scene.house_from_base(now.observation).inverse() * self.hand;
        (time < self.drive.duration() + REST).then_some((tool, base))
    }
}
