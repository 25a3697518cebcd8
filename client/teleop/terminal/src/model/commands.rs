//! Converts keys of chair, arm and gripper into commands.

use wheelarm_proto::v1;

use super::{Effect, Model};
use crate::drive;
use wheelarm_proto::geometry::{self, normalized};
use wheelarm_teleop_web::phase::{self, Work};

impl Model {
    pub(super) fn resize(&mut self, coarser: bool, now: f64) {
        self.arm.resize(coarser);
        let [translation, rotation] = self.arm.steps;
        self.say(
            now,
            format!("steps {:.1} mm, {rotation:.3} rad", translation * 1e3),
        );
    }

    /// Handles a key of the chair, if it is one.
    pub(super) fn chair(&mut self, key: char, now: f64) -> Option<Vec<Effect>> {
        if drive::SPEEDS.iter().any(|(k, _)| *k == key) {
            self.drive.key(key, now);
            let [linear, angular] = self.drive.speeds;
            self.say(now, format!("speeds {linear:.2} m/s, {angular:.2} rad/s"));
            return Some(Vec::new());
        }
        if !self.drive.key(key, now) {
            return None;
        }
        if let Err(why) = self.can_command(now) {
            // A stop is sent even while commands are not accepted.
            self.drive.forget();
            self.warn(now, why);
            return Some(Vec::new());
        }
        let work = self.drive.direction.is_some().then_some(Work::Chair);
        let base = self.drive.due(now);
        let command = v1::Command {
            base,
            ..v1::Command::default()
        };
        Some(self.command(command, work))
    }

    pub(super) fn arm(&mut self, axis: usize, sign: f64, now: f64) -> Vec<Effect> {
        if let Err(why) = self.can_command(now) {
            self.warn(now, why);
            return Vec::new();
        }
        let desired = self.situation.applied.as_ref();
        let desired = desired.and_then(|a| normalized("pose", a.desired_pose.as_ref()).ok());
        let present = self.situation.base_from_tool;
        let step = self
            .arm
            .step(axis, sign, desired.as_ref(), present.as_ref(), now);
        let target = match step {
            Ok(target) => target,
            Err(refused) => {
                self.warn(now, refused.to_string());
                return Vec::new();
            }
        };
        self.arm_problem.clear();
        let command = v1::Command {
            arm: Some(v1::ArmCommand {
                target: Some(v1::arm_command::Target::Pose(v1::CartesianTarget {
                    frame: v1::CommandFrame::BaseLink.into(),
                    pose: Some(geometry::pose(&target)),
                })),
            }),
            ..v1::Command::default()
        };
        self.command(command, Some(Work::Arm))
    }

    pub(super) fn gripper(&mut self, closing: bool, now: f64) -> Vec<Effect> {
        if let Err(why) = self.can_command(now) {
            self.warn(now, why);
            return Vec::new();
        }
        let commanded = self.situation.applied.as_ref().map(|a| a.knuckle);
        let Some(commanded) = commanded.or(self.situation.knuckle()) else {
            self.warn(now, "the gripper's angle has not come yet");
            return Vec::new();
        };
        let Some(knuckle) = self.arm.grip(closing, commanded, now) else {
            self.warn(now, "the robot's description has not come yet");
            return Vec::new();
        };
        let command = v1::Command {
            gripper: Some(v1::GripperCommand {
                target: Some(v1::gripper_command::Target::Knuckle(knuckle)),
                max_force: None,
            }),
            ..v1::Command::default()
        };
        self.command(command, Some(Work::Gripper))
    }

    /// Sends a command now, or with the next answer in lock-step.
    pub(super) fn command(&mut self, mut command: v1::Command, work: Option<Work>) -> Vec<Effect> {
        command.device = v1::Device::Keyboard.into();
        // Chair keys move the chair while held; hand and gripper move in steps.
        command.mode = match work {
            Some(Work::Arm | Work::Gripper) => v1::InputMode::Step.into(),
            _ => v1::InputMode::Hold.into(),
        };
        if let Some(work) = work {
            let (phase, name) = phase::of(work, self.situation.pad_force);
            command.phase = phase.into();
            name.clone_into(&mut command.phase_name);
        }
        if self.lock_step() {
            let pending = &mut self.pending;
            pending.arm = command.arm.or(pending.arm.take());
            pending.base = command.base.or(pending.base.take());
            pending.gripper = command.gripper.or(pending.gripper.take());
            if command.phase != 0 {
                pending.phase = command.phase;
                pending.phase_name = command.phase_name;
            }
            return Vec::new();
        }
        let header = Box::new(self.situation.header.clone());
        vec![Effect::Send(header, Box::new(command))]
    }

    /// Whether the simulation waits for this program at every control tick.
    pub(super) fn lock_step(&self) -> bool {
        let scenario = self.situation.scenario();
        let paced = scenario.is_some_and(|s| s.pacing() == v1::Pacing::LockStep);
        paced && self.situation.episode().is_some()
    }
}
