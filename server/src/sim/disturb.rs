//! Disturbances between the command gate and the motors.
//!
//! Samples are a pure function of seed and tick, so no generator state has to be saved.
//! Every kind of sample has its own random stream. All magnitudes are in the tables
//! below; those without a source are guesses.

use nalgebra::Vector3;
use wheelarm_proto::random::{open_fraction, splitmix64 as mix};
use wheelarm_proto::{CONTROL_HZ, TICKS_PER_CONTROL, exact};

use crate::robot::ARM_JOINTS;
use crate::robot::control::{TICKS, Targets};
use crate::world::GRAVITY;

/// Largest strength.
pub const MAX_STRENGTH: u32 = 3;

/// Standard deviation of the arm's targets by strength, rad (guess: 2 mm, 4 mm and
/// 8 mm at the hand of an outstretched arm; noise on what is applied after Laskey et
/// al., DART, 2017).
const ARM_NOISE: [f64; 4] = [0.0, 0.0015, 0.003, 0.006];
/// Standard deviation of the wheels' speeds by strength, as a share of them (guess).
const WHEEL_NOISE: [f64; 4] = [0.0, 0.03, 0.06, 0.12];
/// Control ticks between sampled values of the noise, smoothly interpolated (guess).
const KNOT: u64 = 20;

/// Force on the chair by strength, N (guess: from a person brushing against it to a
/// nudge).
const CHAIR_PUSH: [f64; 4] = [0.0, 40.0, 80.0, 160.0];
/// Force on the hand by strength, N (guess).
const HAND_PUSH: [f64; 4] = [0.0, 5.0, 10.0, 20.0];
/// Force on the target by strength, as a share of its weight (guess: one that pulls at
/// a held object and does not tip a bottle; one that slides most objects or tips a
/// bottle; a knock. Measured: 0.7 tipped 13 of 40 bottles).
const TARGET_PUSH: [f64; 4] = [0.0, 0.4, 0.7, 1.0];
/// Control ticks of a push (guess: 0.1 s).
const PUSH: u64 = 6;
/// Each window of this many control ticks contains a push (guess: 6 s) ...
const PUSH_WINDOW: u64 = 6 * CONTROL_HZ;
/// ... with this probability (guess).
const PUSH_SHARE: f64 = 0.6;

/// Remaining share of the gripper's force by strength (guess: it holds; it creeps, and
/// deformables fall; it slips. Measured: 0.3 dropped the bear in most episodes).
const SLIP: [f64; 4] = [1.0, 0.6, 0.3, 0.1];
/// Control ticks of a slip (guess: 0.13 s).
const SLIP_TICKS: u64 = 8;
/// As for pushes (guess: 4 s).
const SLIP_WINDOW: u64 = 4 * CONTROL_HZ;
/// As for pushes (guess).
const SLIP_SHARE: f64 = 0.5;

/// Intentional disturbances of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disturbances {
    /// Seed; `None`: the scenario's.
    pub seed: Option<u64>,
    /// Strength of the noise on applied set points, 0 to [`MAX_STRENGTH`].
    pub noise: u32,
    /// Strength of pushes.
    pub pushes: u32,
    /// Strength of slips.
    pub slips: u32,
}

/// Target of a push.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PushTarget {
    /// The chair.
    Chair,
    /// The arm's hand.
    Hand,
    /// An object, by its index in the scene.
    Object(usize),
}

/// The disturbance of one control tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// Added to the arm's set points at the start and end of the tick, rad.
    pub joints: [[f64; ARM_JOINTS]; 2],
    /// Factors on the speeds of the left and the right wheel.
    pub wheels: [f64; 2],
    /// Target and force of the push in `house`, N.
    pub push: Option<(PushTarget, Vector3<f64>)>,
    /// Factor on the gripper's force.
    pub grip: f64,
}

/// Random streams.
#[derive(Clone, Copy)]
enum Row {
    Joint = 1,
    Wheel = 2,
    Push = 3,
    Slip = 4,
}

impl Disturbances {
    /// The disturbance of the control tick that begins at the physics tick `tick`, in a
    /// scenario of `scenario_seed` with the pushable object `target` (index, kg), if it
    /// has one.
    #[must_use]
    pub fn disturbance(
        &self,
        scenario_seed: u64,
        tick: u64,
        target: Option<(usize, f64)>,
    ) -> Disturbance {
        let draw = CounterRandom(self.seed.unwrap_or(scenario_seed));
        let now = tick / TICKS_PER_CONTROL;
        let of = |table: [f64; 4], strength: u32| table[strength.min(MAX_STRENGTH) as usize];
        let arm = of(ARM_NOISE, self.noise);
        let joints =
            |at: u64| std::array::from_fn(|joint| arm * draw.smooth(Row::Joint, joint as u64, at));
        let share = of(WHEEL_NOISE, self.noise);
        let wheels =
            std::array::from_fn(|wheel| 1.0 + share * draw.smooth(Row::Wheel, wheel as u64, now));
        let push = draw.moment(Row::Push, now, PUSH_WINDOW, PUSH, PUSH_SHARE);
        let push = push.filter(|_| self.pushes > 0).map(|window| {
            let angle = std::f64::consts::TAU * draw.uniform(Row::Push, 2, window);
            let (sin, cos) = exact::sin_cos(angle);
            let third = (3.0 * draw.uniform(Row::Push, 3, window)) as u64;
            let (on, force) = match (third, target) {
                (0, _) => (PushTarget::Chair, of(CHAIR_PUSH, self.pushes)),
                (1, Some((index, mass))) => (
                    PushTarget::Object(index),
                    of(TARGET_PUSH, self.pushes) * mass * GRAVITY,
                ),
                _ => (PushTarget::Hand, of(HAND_PUSH, self.pushes)),
            };
            (on, Vector3::new(cos, sin, 0.0) * force)
        });
        let slip = draw.moment(Row::Slip, now, SLIP_WINDOW, SLIP_TICKS, SLIP_SHARE);
        Disturbance {
            joints: [joints(now), joints(now + 1)],
            wheels,
            push,
            grip: slip.map_or(1.0, |_| of(SLIP, self.slips)),
        }
    }
}

impl Disturbance {
    /// Disturbs the set points of the tick.
    pub fn apply(&self, targets: &mut [Targets; TICKS]) {
        let [from, to] = &self.joints;
        for (i, target) in targets.iter_mut().enumerate() {
            let part = (i + 1) as f64 / TICKS as f64;
            for joint in 0..ARM_JOINTS {
                let way = to[joint] - from[joint];
                target.arm_position[joint] += from[joint] + way * part;
                target.arm_velocity[joint] += way * CONTROL_HZ as f64;
            }
            for (speed, factor) in target.wheel_velocity.iter_mut().zip(self.wheels) {
                *speed *= factor;
            }
            target.pad_force *= self.grip;
        }
    }
}

/// Counter-based random numbers: each is a hash of seed, row, column and place.
#[derive(Clone, Copy)]
struct CounterRandom(u64);

impl CounterRandom {
    /// Uniform in 0 to 1, both excluded.
    fn uniform(self, row: Row, column: u64, place: u64) -> f64 {
        let bits = mix(mix(mix(mix(self.0) ^ row as u64) ^ column) ^ place);
        open_fraction(bits)
    }

    /// Mean 0, standard deviation 1 (Box and Muller).
    fn normal(self, row: Row, column: u64, place: u64) -> f64 {
        let radius = (-2.0 * exact::ln(self.uniform(row, 2 * column, place))).sqrt();
        let angle = std::f64::consts::TAU * self.uniform(row, 2 * column + 1, place);
        radius * exact::cos(angle)
    }

    /// Normal values at every [`KNOT`], smoothly interpolated.
    fn smooth(self, row: Row, column: u64, now: u64) -> f64 {
        let (knot, part) = (now / KNOT, (now % KNOT) as f64 / KNOT as f64);
        let weight = part * part * (3.0 - 2.0 * part);
        let [from, to] = [knot, knot + 1].map(|place| self.normal(row, column, place));
        from + (to - from) * weight
    }

    /// The window of `window` control ticks, if `now` is within the event of `length`
    /// control ticks that it contains with probability `share`.
    fn moment(self, row: Row, now: u64, window: u64, length: u64, share: f64) -> Option<u64> {
        let (place, at) = (now / window, now % window);
        let happens = self.uniform(row, 0, place) < share;
        let first = (self.uniform(row, 1, place) * (window - length) as f64) as u64;
        (happens && (first..first + length).contains(&at)).then_some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Disturbances = Disturbances {
        seed: None,
        noise: 2,
        pushes: 2,
        slips: 2,
    };

    #[test]
    fn samples_of_a_tick_are_deterministic_and_continuous() {
        let target = Some((1, 0.5));
        let all: Vec<_> = (0..600)
            .map(|k| ALL.disturbance(7, 4 * k, target))
            .collect();
        for (k, drawn) in all.iter().enumerate().rev() {
            assert_eq!(*drawn, ALL.disturbance(7, 4 * k as u64, target));
        }
        for pair in all.windows(2) {
            assert_eq!(pair[0].joints[1], pair[1].joints[0]);
        }
        assert_ne!(all[5], ALL.disturbance(8, 20, target));
        let own = Disturbances {
            seed: Some(7),
            ..ALL
        };
        assert_eq!(all[5], own.disturbance(8, 20, target));
    }

    #[test]
    fn noise_pushes_and_slips_match_the_tables() {
        let ticks = 120_000;
        let all: Vec<_> = (0..ticks)
            .map(|k| ALL.disturbance(3, 4 * k, Some((0, 1.0))))
            .collect();
        let mean_square = |of: &dyn Fn(&Disturbance) -> f64| {
            all.iter().map(|d| of(d) * of(d)).sum::<f64>() / ticks as f64
        };
        // Between knots the interpolation has less variance: the mean of w² + (1-w)² is
        // 26/35.
        let deviation = (26.0f64 / 35.0).sqrt() * ARM_NOISE[2];
        for joint in 0..ARM_JOINTS {
            let found = mean_square(&|d| d.joints[0][joint]).sqrt();
            assert!((found / deviation - 1.0).abs() < 0.05, "{joint}: {found}");
        }
        let share = |count: usize| count as f64 / ticks as f64;
        let pushed = share(all.iter().filter(|d| d.push.is_some()).count());
        let wanted = PUSH_SHARE * PUSH as f64 / PUSH_WINDOW as f64;
        assert!((pushed / wanted - 1.0).abs() < 0.15, "{pushed} of {wanted}");
        let slipped = share(all.iter().filter(|d| d.grip == SLIP[2]).count());
        let wanted = SLIP_SHARE * SLIP_TICKS as f64 / SLIP_WINDOW as f64;
        assert!(
            (slipped / wanted - 1.0).abs() < 0.15,
            "{slipped} of {wanted}"
        );
        for on in [PushTarget::Chair, PushTarget::Hand, PushTarget::Object(0)] {
            assert!(
                all.iter()
                    .any(|d| d.push.is_some_and(|(body, _)| body == on))
            );
        }
        for (on, force) in all.iter().filter_map(|d| d.push) {
            let wanted = match on {
                PushTarget::Chair => CHAIR_PUSH[2],
                PushTarget::Hand => HAND_PUSH[2],
                PushTarget::Object(_) => TARGET_PUSH[2] * GRAVITY,
            };
            assert!((force.norm() - wanted).abs() < 1e-9, "{on:?}: {force}");
            assert_eq!(force.z, 0.0);
        }
        let calm = Disturbances {
            noise: 0,
            pushes: 0,
            slips: 0,
            ..ALL
        };
        let calm = calm.disturbance(3, 4, None);
        assert_eq!(
            (calm.joints, calm.wheels, calm.push, calm.grip),
            ([[0.0; 6]; 2], [1.0; 2], None, 1.0)
        );
    }
}
