//! The phase of the work, derived from the operator's input. Pure.
//!
//! Driving is navigating, gripper keys are grasping, arm keys are reaching
//! until something is held and retracting from then on: the four labels of
//! WheelArm-Sim, without keys for them.

use wheelarm_proto::v1::Phase;

/// A pad touches from this force, N.
const TOUCH: f64 = 1.0;

/// Part of the robot that a key moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// The chair.
    Chair,
    /// The arm.
    Arm,
    /// The gripper.
    Gripper,
}

/// The phase for a key while the pads press with `pad_force`, N.
#[must_use]
pub fn of(work: Work, pad_force: [f64; 2]) -> (Phase, &'static str) {
    let held = pad_force.iter().all(|force| *force > TOUCH);
    match work {
        Work::Chair if held => (Phase::Retracting, "carrying"),
        Work::Chair => (Phase::Navigating, "driving"),
        Work::Gripper => (Phase::Grasping, "gripping"),
        Work::Arm if held => (Phase::Retracting, "lifting"),
        Work::Arm => (Phase::Reaching, "reaching"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holding_an_object_turns_reaching_into_retracting() {
        assert_eq!(of(Work::Arm, [0.0, 5.0]).0, Phase::Reaching);
        assert_eq!(of(Work::Arm, [5.0, 5.0]).0, Phase::Retracting);
        assert_eq!(of(Work::Chair, [0.0, 0.0]).0, Phase::Navigating);
        assert_eq!(of(Work::Gripper, [5.0, 5.0]).0, Phase::Grasping);
    }
}
