//! Finger motion: the commanded opening while they are opened or closed. Pure.

use wheelarm_proto::v1;

use crate::protocol::Held;
use crate::speed::Speeds;
use crate::watch::Situation;

/// Longest time between two messages that counts for the fingers, s.
const GRIP_TIME: f64 = 0.1;

/// The fingers of the robot, and their target while they move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fingers {
    /// Widest opening, m.
    stroke: f64,
    linkage: Option<v1::GripperLinkage>,
    /// Target, m, and when it was moved, s.
    target: Option<(f64, f64)>,
}

impl Fingers {
    /// Stores the gripper of a robot.
    pub fn fit(&mut self, gripper: Option<&v1::GripperDescription>) {
        self.stroke = gripper.map_or(0.0, |g| g.stroke);
        self.linkage = gripper.and_then(|g| g.linkage);
    }

    /// Ends their motion.
    pub fn rest(&mut self) {
        self.target = None;
    }

    /// The target at `time`, s; `None` without held gripper input or while the opening is
    /// unknown.
    pub fn drive(
        &mut self,
        held: &Held,
        speeds: &Speeds,
        time: f64,
        situation: &Situation,
    ) -> Option<v1::GripperCommand> {
        if held.grip == 0.0 {
            self.rest();
            return None;
        }
        let (from, at) = match self.target {
            Some(target) => target,
            None => (self.opening(situation)?, time),
        };
        let passed = (time - at).clamp(0.0, GRIP_TIME);
        let opening = (from + held.grip * speeds.grip * passed).clamp(0.0, self.stroke);
        self.target = Some((opening, time));
        Some(command(opening))
    }

    /// One step, open where `sign` is positive; `None` while the opening is
    /// unknown.
    #[must_use]
    pub fn step(
        &self,
        sign: f64,
        speeds: &Speeds,
        situation: &Situation,
    ) -> Option<v1::GripperCommand> {
        let opening = self.opening(situation)? + sign * speeds.grip_step;
        Some(command(opening.clamp(0.0, self.stroke)))
    }

    /// Opening of the last command, m.
    fn opening(&self, situation: &Situation) -> Option<f64> {
        let commanded = situation.applied.as_ref().map(|a| a.knuckle);
        let opening = self.linkage.zip(commanded.or(situation.knuckle()));
        opening.map(|(linkage, knuckle)| linkage.opening(knuckle).max(0.0))
    }
}

fn command(opening: f64) -> v1::GripperCommand {
    v1::GripperCommand {
        target: Some(v1::gripper_command::Target::Opening(opening)),
        max_force: None,
    }
}
