//! Delay between the command gate and the robot's control, when a sensor model defines
//! one. A delayed input is applied later, and `applied` reports when.
//!
//! Stops of the gate are not delayed: the watchdog runs on the robot. Without a model
//! nothing passes here.

use wheelarm_proto::random::fnv1a;
use wheelarm_sensor_models::delay::{Delay, DelayLine};
use wheelarm_sensor_models::noise::Random;

use super::command_gate::{REST, StoppedGroups};
use crate::robot::control::{ArmIntent, ControlInput};
use crate::sensors::models::Device;

/// Delayed inputs.
#[derive(Debug)]
pub struct CommandDelay {
    delay: Delay,
    seed: u64,
    on_way: DelayLine<ControlInput>,
}

impl CommandDelay {
    /// The command delay of the scenario's devices; `None` without one.
    #[must_use]
    pub fn from_devices(devices: &[Device]) -> Option<Self> {
        devices.iter().find_map(|device| {
            let delay = device.model.command?.times(device.strength);
            (delay.most > 0.0).then(|| Self {
                delay,
                seed: device.seed ^ fnv1a("command"),
                on_way: DelayLine::default(),
            })
        })
    }

    /// Drops all delayed inputs.
    pub fn restart(&mut self) {
        self.on_way.clear();
    }

    /// Returns the input that reaches the control at this tick, when the gate passes
    /// `input`. Groups in `stopped` are not delayed, all others are.
    pub fn pass(
        &mut self,
        tick: u64,
        mut input: ControlInput,
        stopped: StoppedGroups,
    ) -> ControlInput {
        let mut at_once = ControlInput::default();
        // A new command may have replaced the stop in this tick: it is delayed.
        if stopped.base {
            at_once.base = Some(REST);
            input.base.take_if(|base| *base == REST);
        }
        if stopped.arm {
            at_once.arm = Some(ArmIntent::Hold);
            input.arm.take_if(|arm| *arm == ArmIntent::Hold);
        }
        // Commands from before the stop must not arrive after it.
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
    use wheelarm_sensor_models::Model;

    const NONE: StoppedGroups = StoppedGroups {
        base: false,
        arm: false,
        control: false,
    };
    const ARM: StoppedGroups = StoppedGroups {
        base: false,
        arm: true,
        control: false,
    };
    const ALL: StoppedGroups = StoppedGroups {
        base: true,
        arm: true,
        control: true,
    };

    fn command_delay(seed: u64, strength: f64) -> Option<CommandDelay> {
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
        CommandDelay::from_devices(&[device])
    }

    fn input_with(value: f64) -> ControlInput {
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
    fn delays_follow_the_seed_and_keep_the_order() {
        let run = |seed| {
            let mut command_delay = command_delay(seed, 1.0).unwrap();
            let ticks = (0..400).map(|k| 4 * k);
            ticks
                .map(|tick| value(&command_delay.pass(tick, input_with(tick as f64), NONE)))
                .collect::<Vec<_>>()
        };
        let all = run(1);
        assert_eq!(all, run(1));
        assert_ne!(all, run(2));
        let mut ages = Vec::new();
        let mut newest = -1.0;
        for (k, delayed) in all.iter().enumerate() {
            if let Some(delayed) = delayed {
                assert!(*delayed > newest);
                newest = *delayed;
                ages.push(4.0 * k as f64 - delayed);
            }
        }
        // Between 4.8 and 28.8 ticks, up to the next control tick.
        assert!(ages.iter().all(|age| (4.0..=33.0).contains(age)));
        let mean = ages.iter().sum::<f64>() / ages.len() as f64;
        assert!((9.0..18.0).contains(&mean), "{mean} ticks");
        assert!(command_delay(1, 0.0).is_none());
    }

    #[test]
    fn a_stop_is_immediate_and_drops_delayed_commands() {
        let mut command_delay = command_delay(1, 1.0).unwrap();
        command_delay.pass(0, input_with(1.0), NONE);
        let stop = ControlInput {
            arm: Some(ArmIntent::Hold),
            ..ControlInput::default()
        };
        assert_eq!(command_delay.pass(4, stop.clone(), ARM), stop);
        for tick in (8..200).step_by(4) {
            let none = ControlInput::default();
            assert_eq!(command_delay.pass(tick, none.clone(), NONE), none);
        }
    }

    #[test]
    fn no_command_of_the_former_holder_arrives_after_control_ends() {
        let mut command_delay = command_delay(1, 1.0).unwrap();
        let close = ControlInput {
            gripper: Some(GripperIntent {
                knuckle: 0.8,
                max_force: None,
            }),
            ..input_with(1.0)
        };
        command_delay.pass(0, close, NONE);
        // In the same tick the new holder drives: the chair stops, and drives later.
        let drives = ControlInput {
            base: Some(BaseIntent {
                linear: 0.3,
                angular: 0.0,
            }),
            arm: Some(ArmIntent::Hold),
            ..ControlInput::default()
        };
        let delayed = command_delay.pass(4, drives.clone(), ALL);
        assert_eq!((delayed.base, &delayed.arm), (Some(REST), &drives.arm));
        let later: Vec<_> = (8..200)
            .step_by(4)
            .map(|tick| command_delay.pass(tick, ControlInput::default(), NONE))
            .collect();
        assert!(later.iter().all(|input| input.gripper.is_none()));
        assert_eq!(later.iter().filter(|input| input.base.is_some()).count(), 1);
    }

    #[test]
    fn stop_of_the_arm_does_not_stop_the_gripper() {
        let mut command_delay = command_delay(1, 1.0).unwrap();
        let close = ControlInput {
            gripper: Some(GripperIntent {
                knuckle: 0.8,
                max_force: None,
            }),
            ..input_with(1.0)
        };
        command_delay.pass(0, close, NONE);
        let stop = ControlInput {
            arm: Some(ArmIntent::Hold),
            ..ControlInput::default()
        };
        let mut delayed = vec![command_delay.pass(4, stop, ARM)];
        delayed.extend(
            (8..200)
                .step_by(4)
                .map(|tick| command_delay.pass(tick, ControlInput::default(), NONE)),
        );
        assert_eq!(
            delayed
                .iter()
                .filter(|input| input.gripper.is_some())
                .count(),
            1
        );
        assert!(delayed[1..].iter().all(|input| input.arm.is_none()));
    }
}
