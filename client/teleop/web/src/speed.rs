//! Speed limits: from the person's chosen speed and the age of the displayed image.
//!
//! An operator who sees late stops late: the chair may move only as fast as it can stop
//! within `ROOM`, counted from the moment of the displayed image.

use wheelarm_proto::PHYSICS_HZ;
use wheelarm_proto::limits::{MAX_COMMAND_AGE_SECONDS, STALE_COMMAND_SECONDS};

/// Assumed deceleration, m/s².
const BRAKE: f64 = 1.1;
/// Distance within which the chair stops, m.
const ROOM: f64 = 0.40;
/// Age from which only steps and goals are accepted, s: less than the age at which the
/// server's gate rejects motion, because a command is older when it arrives there.
pub const ONLY_STEPS: f64 = 0.9;
const _: () = assert!(ONLY_STEPS < MAX_COMMAND_AGE_SECONDS);
/// Age from which only a stop is accepted, s.
pub const ONLY_STOP: f64 = 2.0;

/// Actions that are accepted from a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Allow {
    /// Everything.
    Drive,
    /// Steps and goals.
    Steps,
    /// Only the stop.
    Stop,
}

impl Allow {
    /// From the age of the loop, s; `None` when no image is displayed.
    #[must_use]
    pub fn at(age: Option<f64>) -> Self {
        match age {
            Some(age) if age <= ONLY_STEPS => Self::Drive,
            Some(age) if age <= ONLY_STOP => Self::Steps,
            _ => Self::Stop,
        }
    }

    /// Name in the page protocol.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Drive => "drive",
            Self::Steps => "steps",
            Self::Stop => "stop",
        }
    }
}

/// Greatest speed of the chair at a loop of `age`, s, in m/s: with it the chair
/// stops within `ROOM` of the displayed state.
#[must_use]
pub fn cap(age: f64) -> f64 {
    let late = BRAKE * (age.max(0.0) + STALE_COMMAND_SECONDS);
    // Rewritten so that nothing cancels when the age is great.
    2.0 * BRAKE * ROOM / (late + (late * late + 2.0 * BRAKE * ROOM).sqrt())
}

/// Age of the loop, s: from the displayed state to the newest one, ticks.
#[must_use]
pub fn age(shown: u64, newest: u64) -> f64 {
    newest.saturating_sub(shown) as f64 / PHYSICS_HZ as f64
}

/// Limits of one of the five speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds {
    /// Chair: m/s and rad/s.
    pub chair: [f64; 2],
    /// Hand: m/s and rad/s.
    pub hand: [f64; 2],
    /// Fingers, m/s.
    pub grip: f64,
    /// Step of chair and hand, m and rad.
    pub step: [f64; 2],
    /// Step of the fingers, m.
    pub grip_step: f64,
}

const TABLE: [Speeds; 5] = [
    speeds([0.10, 0.15], [0.02, 0.10], 0.01, [0.01, 1.0], 0.002),
    speeds([0.20, 0.30], [0.04, 0.20], 0.02, [0.025, 2.5], 0.005),
    speeds([0.35, 0.50], [0.08, 0.35], 0.04, [0.05, 5.0], 0.01),
    speeds([0.50, 0.75], [0.12, 0.55], 0.06, [0.075, 7.5], 0.02),
    speeds([0.63, 1.00], [0.16, 0.80], 8.5e-2, [0.10, 10.0], 0.04),
];

const fn speeds(
    chair: [f64; 2],
    hand: [f64; 2],
    grip: f64,
    [metres, degrees]: [f64; 2],
    grip_step: f64,
) -> Speeds {
    Speeds {
        chair,
        hand,
        grip,
        step: [metres, degrees.to_radians()],
        grip_step,
    }
}

impl Speeds {
    /// Limits of speed 1 to 5; other values are clamped.
    #[must_use]
    pub fn of(speed: u8) -> Self {
        TABLE[usize::from(speed.clamp(1, 5)) - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cap_follows_from_the_stopping_distance() {
        // Loops of a local network, 0.2 s and 0.5 s.
        for (age, expected) in [(0.1, 0.63), (0.2, 0.57), (0.5, 0.42)] {
            assert!((cap(age) - expected).abs() < 0.006, "{age}: {}", cap(age));
        }
        for tenth in 0..30 {
            let age = f64::from(tenth) * 0.1;
            let v = cap(age);
            let way = v * (age + STALE_COMMAND_SECONDS) + v * v / (2.0 * BRAKE);
            assert!((way - ROOM).abs() < 1e-9, "{age} s: {way} m");
        }
    }

    #[test]
    fn an_old_image_allows_steps_and_then_only_a_stop() {
        assert_eq!(Allow::at(None), Allow::Stop);
        for (age, allowed) in [
            (0.0, Allow::Drive),
            (0.9, Allow::Drive),
            (0.91, Allow::Steps),
            (2.0, Allow::Steps),
            (2.01, Allow::Stop),
            (1e9, Allow::Stop),
        ] {
            assert_eq!(Allow::at(Some(age)), allowed, "{age}");
        }
        assert_eq!(age(1000, 1240), 1.0);
        // An image of a state that has not arrived here yet.
        assert_eq!(age(1244, 1240), 0.0);
    }
}
