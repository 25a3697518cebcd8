//! The chair: body twist in, wheel speeds out, along the chair's own
//! acceleration profile.

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
    /// From the numbers of `robot.toml`.
    #[must_use]
    pub fn new(settings: &Settings) -> DriveGeometry {
        DriveGeometry {
            wheel_radius: settings.wheel_radius,
            track: settings.track,
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

    /// Motion of the chair for left and right wheel speed, rad/s. For angles
    /// instead of speeds the same gives the travelled distance and turn.
    #[must_use]
    pub fn motion(&self, [left, right]: [f64; 2]) -> BaseIntent {
        BaseIntent {
            linear: (right + left) / 2.0 * self.wheel_radius,
            angular: (right - left) / self.track * self.wheel_radius,
        }
    }
}

/// What the chair is asked and what it does now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BaseState {
    /// Asked, within the caps.
    pub wanted: BaseIntent,
    /// Commanded to the wheels now.
    pub now: BaseIntent,
}

impl BaseState {
    /// Takes a new intent, cut to the caps.
    pub(super) fn take(&mut self, intent: &BaseIntent, drive: &DriveSettings) {
        let forward = drive.forward_speed.min(drive.hard_forward_speed);
        let backward = drive.backward_speed.min(drive.hard_backward_speed);
        let turn = drive.turn_speed.min(drive.hard_turn_speed);
        self.wanted = BaseIntent {
            linear: exact::within(intent.linear, -backward, forward),
            angular: exact::within(intent.angular, -turn, turn),
        };
    }

    /// One step of the profile, `left` steps before the next intent may come. A
    /// speed that can be reached by then is reached just then: towards a stream of
    /// speeds the chair would change its own in jerks, 60 times a second.
    /// A guard bounds what is wanted, but for how long only it knows: `wanted` stays.
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

/// One step of a speed: it brakes while it is too fast or of the wrong sign,
/// and gains otherwise. It never passes zero within a step, and takes no larger
/// steps than bring it there in `left` of them, but to stop.
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
