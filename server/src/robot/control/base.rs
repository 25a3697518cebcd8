//! The chair: converts a body twist to wheel speeds, along the chair's own acceleration
//! profile.

use serde::{Deserialize, Serialize};
use wheelarm_proto::exact;

use super::profile::towards;
use super::{BaseIntent, Guard};
use crate::robot::{DriveSettings, Settings};

/// Differential drive: rear wheels and the chair's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveGeometry {
    /// Wheel radius, m.
    pub wheel_radius: f64,
    /// Distance between the wheels, m.
    pub track: f64,
}

impl DriveGeometry {
    /// From the values of `robot.toml`.
    #[must_use]
    pub fn new(settings: &Settings) -> DriveGeometry {
        DriveGeometry {
            wheel_radius: settings.drive.wheel_radius,
            track: settings.drive.track,
        }
    }

    /// Left and right wheel speed, rad/s, for a motion of the chair.
    #[must_use]
    pub fn wheel_speeds(&self, motion: &BaseIntent) -> [f64; 2] {
        let side = motion.angular * self.track / 2.0;
        [
            (motion.linear - side) / self.wheel_radius,
            (motion.linear + side) / self.wheel_radius,
        ]
    }

    /// Motion of the chair for left and right wheel speed, rad/s; for angles instead of
    /// speeds, the travelled distance and turn.
    #[must_use]
    pub fn motion(&self, [left, right]: [f64; 2]) -> BaseIntent {
        BaseIntent {
            linear: (right + left) / 2.0 * self.wheel_radius,
            angular: (right - left) / self.track * self.wheel_radius,
        }
    }
}

/// Commanded and present velocity of the chair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BaseState {
    /// Commanded, within the caps.
    pub wanted: BaseIntent,
    /// Present command to the wheels.
    pub now: BaseIntent,
}

impl BaseState {
    /// Accepts a new intent, limited to the caps.
    pub(super) fn take(&mut self, intent: &BaseIntent, drive: &DriveSettings) {
        let forward = drive.forward_speed.min(drive.hard_forward_speed);
        let backward = drive.backward_speed.min(drive.hard_backward_speed);
        let turn = drive.turn_speed.min(drive.hard_turn_speed);
        self.wanted = BaseIntent {
            linear: exact::within(intent.linear, -backward, forward),
            angular: exact::within(intent.angular, -turn, turn),
        };
    }

    /// One step of the profile, `left` steps before the next intent may arrive. A speed
    /// that is reachable by then is reached exactly then: with a stream of speeds the
    /// chair would otherwise jerk 60 times per second. A guard limits the speed but
    /// does not change `wanted`, because its limits may end at any time.
    pub(super) fn advance(
        &mut self,
        drive: &DriveSettings,
        guard: Option<&Guard>,
        dt: f64,
        left: usize,
    ) {
        let wanted = guard.map_or(self.wanted, |guard| guard.of_chair(self.wanted, self.now));
        let stop = wanted == BaseIntent::default();
        let braking =
            |profile: f64, at_stop: f64| if stop { profile.max(at_stop) } else { profile };
        let linear_braking = if self.now.linear > 0.0 {
            braking(drive.forward_deceleration, drive.stop_deceleration)
        } else {
            braking(drive.backward_deceleration, drive.stop_deceleration)
        };
        let linear_gain = if wanted.linear > 0.0 {
            drive.forward_acceleration
        } else {
            drive.backward_acceleration
        };
        self.now.linear = ramp(
            self.now.linear,
            wanted.linear,
            linear_gain * dt,
            linear_braking * dt,
            left,
        );
        self.now.angular = ramp(
            self.now.angular,
            wanted.angular,
            drive.turn_acceleration * dt,
            braking(drive.turn_deceleration, drive.stop_turn_deceleration) * dt,
            left,
        );
    }
}

/// One step of a speed: it brakes while it is too fast or has the wrong sign, and
/// accelerates otherwise. It never crosses zero within a step, and except for stopping
/// its steps are at most as large as needed to arrive in `left` of them.
fn ramp(now: f64, wanted: f64, gain: f64, braking: f64, left: usize) -> f64 {
    let reverses = now * wanted < 0.0;
    let even = if wanted == 0.0 {
        f64::INFINITY
    } else {
        (wanted - now).abs() / left.max(1) as f64
    };
    if reverses {
        towards(now, 0.0, braking)
    } else if wanted.abs() < now.abs() {
        towards(now, wanted, braking.min(even))
    } else {
        towards(now, wanted, gain.min(even))
    }
}
