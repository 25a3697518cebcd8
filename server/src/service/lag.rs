//! The way from the gate to the robot's control, where a sensor model says how
//! long it takes: what is asked is applied later, and `applied` says when.
//!
//! Off, nothing passes here. What the gate does to stop the robot is not delayed:
//! the watchdog sits at the robot.

use wheelarm_sensors::delay::{Delay, DelayLine};
use wheelarm_sensors::noise::{Random, key_of};

use super::inbox::{REST, Stopped};
use crate::robot::control::{ArmIntent, ControlInput};
use crate::sensors::models::Device;

/// Inputs on their way.
#[derive(Debug)]
pub struct Lag {
    delay: Delay,
    seed: u64,
    on_way: DelayLine<ControlInput>,
}

impl Lag {
    /// The lag of the scenario's devices; `None` where commands are at once.
    #[must_use]
    pub fn of(devices: &[Device]) -> Option<Self> {
        devices.iter().find_map(|device| {
            let delay = device.model.command?.times(device.strength);
            (delay.most > 0.0).then(|| Self {
                delay,
                seed: device.seed ^ key_of("command"),
                on_way: DelayLine::default(),
            })
        })
    }

    /// Forgets what is on its way.
    pub fn restart(&mut self) {
        self.on_way.clear();
    }

    /// What reaches the control at a control tick at which the gate lets `input`
    /// through; what the gate `stopped` by it is not delayed, all other groups are.
    pub fn pass(&mut self, tick: u64, mut input: ControlInput, stopped: Stopped) -> ControlInput {
        let mut at_once = ControlInput::default();
        // A new command may have taken the place of the stop: that one comes later.
        if stopped.base {
            at_once.base = Some(REST);
            input.base.take_if(|base| *base == REST);
        }
        if stopped.arm {
            at_once.arm = Some(ArmIntent::Hold);
            input.arm.take_if(|arm| *arm == ArmIntent::Hold);
        }
        // What was asked before the stop must not come after it.
        for waiting in self.on_way.waiting() {
            if stopped.base {
                waiting.base = None;
            }
            if stopped.arm {
                waiting.arm = None;
            }
            if stopped.control {
                waiting.gripper = None;
            }
        }
        if input != ControlInput::default() {
            let mut random = Random::new(self.seed, [tick, 4]);
            self.on_way
                .send(tick + self.delay.ticks(&mut random), input);
        }
        let mut taken = ControlInput::default();
        while let Some((_, input)) = self.on_way.arrived(tick) {
            taken = ControlInput {
                arm: input.arm.or(taken.arm),
                base: input.base.or(taken.base),
                gripper: input.gripper.or(taken.gripper),
            };
        }
        ControlInput {
            arm: at_once.arm.or(taken.arm),
            base: at_once.base.or(taken.base),
            gripper: taken.gripper,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::control::{BaseIntent, GripperIntent};
    use wheelarm_sensors::Model;

    const NONE: Stopped = Stopped {
        base: false,
        arm: false,
        control: false,
    };
    const ARM: Stopped = Stopped {
        base: false,
        arm: true,
        control: false,
    };
    const ALL: Stopped = Stopped {
        base: true,
        arm: true,
        control: true,
    };

    fn lag(seed: u64, strength: f64) -> Option<Lag> {
        let command = Delay {
            mean: 0.05,
            deviation: 0.015,
            least: 0.02,
            most: 0.12,
        };
        let device = Device {
            camera: String::new(),
            seed,
            strength,
            model: Model {
                command: Some(command),
                ..Model::default()
            },
        };
        Lag::of(&[device])
    }

    fn asked(value: f64) -> ControlInput {
        ControlInput {
            arm: Some(ArmIntent::Joints([value; 6])),
            ..ControlInput::default()
        }
    }

    fn value(input: &ControlInput) -> Option<f64> {
        match input.arm {
            Some(ArmIntent::Joints([value, ..])) => Some(value),
            _ => None,
        }
    }

    #[test]
    fn commands_come_later_in_their_order_and_by_the_seed() {
        let run = |seed| {
            let mut lag = lag(seed, 1.0).unwrap();
            let ticks = (0..400).map(|k| 4 * k);
            ticks
                .map(|tick| value(&lag.pass(tick, asked(tick as f64), NONE)))
                .collect::<Vec<_>>()
        };
        let all = run(1);
        assert_eq!(all, run(1));
        assert_ne!(all, run(2));
        let mut ages = Vec::new();
        let mut newest = -1.0;
        for (k, told) in all.iter().enumerate() {
            if let Some(told) = told {
                assert!(*told > newest);
                newest = *told;
                ages.push(4.0 * k as f64 - told);
            }
        }
        // Between 4.8 and 28.8 ticks, up to the next control tick.
        assert!(ages.iter().all(|age| (4.0..=33.0).contains(age)));
        let mean = ages.iter().sum::<f64>() / ages.len() as f64;
        assert!((9.0..18.0).contains(&mean), "{mean} ticks");
        assert!(lag(1, 0.0).is_none());
    }

    #[test]
    fn a_stop_is_at_once_and_nothing_comes_after_it() {
        let mut lag = lag(1, 1.0).unwrap();
        lag.pass(0, asked(1.0), NONE);
        let stop = ControlInput {
            arm: Some(ArmIntent::Hold),
            ..ControlInput::default()
        };
        assert_eq!(lag.pass(4, stop.clone(), ARM), stop);
        for tick in (8..200).step_by(4) {
            let none = ControlInput::default();
            assert_eq!(lag.pass(tick, none.clone(), NONE), none);
        }
    }

    #[test]
    fn behind_the_end_of_control_nothing_of_the_former_holder_comes() {
        let mut lag = lag(1, 1.0).unwrap();
        let close = ControlInput {
            gripper: Some(GripperIntent {
                knuckle: 0.8,
                max_force: None,
            }),
            ..asked(1.0)
        };
        lag.pass(0, close, NONE);
        // In the same tick the new holder drives: the chair stops, and drives later.
        let drives = ControlInput {
            base: Some(BaseIntent {
                linear: 0.3,
                angular: 0.0,
            }),
            arm: Some(ArmIntent::Hold),
            ..ControlInput::default()
        };
        let told = lag.pass(4, drives.clone(), ALL);
        assert_eq!((told.base, &told.arm), (Some(REST), &drives.arm));
        let later: Vec<_> = (8..200)
            .step_by(4)
            .map(|tick| lag.pass(tick, ControlInput::default(), NONE))
            .collect();
        assert!(later.iter().all(|input| input.gripper.is_none()));
        assert_eq!(later.iter().filter(|input| input.base.is_some()).count(), 1);
    }

    #[test]
    fn a_stop_of_the_arm_lets_the_gripper_close() {
        let mut lag = lag(1, 1.0).unwrap();
        let close = ControlInput {
            gripper: Some(GripperIntent {
                knuckle: 0.8,
                max_force: None,
            }),
            ..asked(1.0)
        };
        lag.pass(0, close, NONE);
        let stop = ControlInput {
            arm: Some(ArmIntent::Hold),
            ..ControlInput::default()
        };
        let mut told = vec![lag.pass(4, stop, ARM)];
        told.extend(
            (8..200)
                .step_by(4)
                .map(|tick| lag.pass(tick, ControlInput::default(), NONE)),
        );
        assert_eq!(
            told.iter().filter(|input| input.gripper.is_some()).count(),
            1
        );
        assert!(told[1..].iter().all(|input| input.arm.is_none()));
    }
}
