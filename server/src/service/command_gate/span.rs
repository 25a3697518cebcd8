//! A command that covers several control ticks: its input for each tick, interpolated
//! from the set points in force to the requested values.

use nalgebra::Isometry3;
use wheelarm_proto::TICKS_PER_CONTROL;

use crate::robot::control::{ArmIntent, BaseIntent, ControlInput, GripperIntent, IntentFrame};

/// Set points in force before a control tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoints {
    /// Set points of joint_1 to joint_6, rad.
    pub joints: [f64; 6],
    /// base_from_end_effector at these joint positions.
    pub tool: Isometry3<f64>,
    /// chair_from_base.
    pub chair_from_base: Isometry3<f64>,
    /// house_from_base.
    pub house_from_base: Isometry3<f64>,
    /// Commanded velocity of the wheels.
    pub base: BaseIntent,
    /// Set point of the knuckle, rad.
    pub knuckle: f64,
}

/// A command while its control ticks pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    from: SetPoints,
    to: ControlInput,
    /// First tick.
    start: u64,
    /// Number of control ticks.
    count: u64,
}

impl Span {
    /// Applies `to` over `count` control ticks from the tick `start`.
    pub fn new(from: SetPoints, to: ControlInput, start: u64, count: u32) -> Self {
        let count = u64::from(count.max(1));
        Self {
            from,
            to,
            start,
            count,
        }
    }

    /// Number of control ticks before `tick`; `None` outside the span.
    fn step(&self, tick: u64) -> Option<u64> {
        let step = tick.checked_sub(self.start)? / TICKS_PER_CONTROL;
        (step < self.count).then_some(step)
    }

    /// Whether it covers the control tick at `tick`.
    pub fn covers(&self, tick: u64) -> bool {
        self.step(tick).is_some()
    }

    /// The input of the control tick at `tick`.
    pub fn input(&self, tick: u64) -> Option<ControlInput> {
        let step = self.step(tick)?;
        // The last tick returns the requested values exactly.
        if step + 1 == self.count {
            return Some(self.at_end(step));
        }
        let part = (step + 1) as f64 / self.count as f64;
        let between = |from: f64, to: f64| from + (to - from) * part;
        Some(ControlInput {
            arm: self
                .to
                .arm
                .as_ref()
                .and_then(|arm| self.arm(arm, part, step)),
            base: self.to.base.map(|to| BaseIntent {
                linear: between(self.from.base.linear, to.linear),
                angular: between(self.from.base.angular, to.angular),
            }),
            gripper: self.to.gripper.map(|to| GripperIntent {
                knuckle: between(self.from.knuckle, to.knuckle),
                ..to
            }),
        })
    }

    fn at_end(&self, step: u64) -> ControlInput {
        let mut input = self.to.clone();
        // A relative step is applied with the first tick only.
        if step > 0 && matches!(input.arm, Some(ArmIntent::Step { .. })) {
            input.arm = None;
        }
        input
    }

    fn arm(&self, to: &ArmIntent, part: f64, step: u64) -> Option<ArmIntent> {
        Some(match *to {
            ArmIntent::Joints(goal) => ArmIntent::Joints(std::array::from_fn(|i| {
                self.from.joints[i] + (goal[i] - self.from.joints[i]) * part
            })),
            ArmIntent::Pose { frame, pose } => {
                let from = match frame {
                    IntentFrame::ArmBase => self.from.tool,
                    IntentFrame::Wheelchair => self.from.chair_from_base * self.from.tool,
                    IntentFrame::House => self.from.house_from_base * self.from.tool,
                    // The gate rejects this frame for poses.
                    IntentFrame::EndEffector => Isometry3::identity(),
                };
                // Opposite rotations cannot be interpolated.
                let pose = from.try_lerp_slerp(&pose, part, 1e-9).unwrap_or(pose);
                ArmIntent::Pose { frame, pose }
            }
            // A velocity is repeated, or it would become stale.
            ArmIntent::Twist { .. } => *to,
            ArmIntent::Step { .. } | ArmIntent::Hold if step > 0 => return None,
            ArmIntent::Step { .. } | ArmIntent::Hold => *to,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    fn set_points() -> SetPoints {
        SetPoints {
            joints: [0.1; 6],
            tool: Isometry3::translation(0.4, 0.0, 0.3),
            chair_from_base: Isometry3::translation(0.3, 0.2, 0.5),
            house_from_base: Isometry3::translation(1.0, 2.0, 0.5),
            base: BaseIntent {
                linear: 0.1,
                angular: 0.0,
            },
            knuckle: 0.2,
        }
    }

    fn base(linear: f64) -> ControlInput {
        ControlInput {
            base: Some(BaseIntent {
                linear,
                angular: -0.3,
            }),
            ..ControlInput::default()
        }
    }

    #[test]
    fn values_are_interpolated_and_exact_at_the_last_tick() {
        let span = Span::new(set_points(), base(0.4), 240, 3);
        let at = |tick| span.input(tick).and_then(|i| i.base).map(|b| b.linear);
        assert!((at(240).unwrap() - 0.2).abs() < 1e-12);
        assert!((at(244).unwrap() - 0.3).abs() < 1e-12);
        assert_eq!(at(248), Some(0.4));
        assert_eq!(at(252), None);
        assert!(span.covers(250) && !span.covers(252) && !span.covers(236));
        // A span of one tick returns the command itself.
        assert_eq!(
            Span::new(set_points(), base(0.4), 0, 0).input(0),
            Some(base(0.4))
        );
    }

    #[test]
    fn joints_and_poses_of_every_frame_start_at_the_arm() {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.4);
        for (frame, from) in [
            (IntentFrame::ArmBase, set_points().tool),
            (
                IntentFrame::Wheelchair,
                set_points().chair_from_base * set_points().tool,
            ),
            (
                IntentFrame::House,
                set_points().house_from_base * set_points().tool,
            ),
        ] {
            let goal = Isometry3::from_parts((from.translation.vector * 1.2).into(), turned);
            let to = ControlInput {
                arm: Some(ArmIntent::Pose { frame, pose: goal }),
                ..ControlInput::default()
            };
            let span = Span::new(set_points(), to, 0, 2);
            let Some(ArmIntent::Pose { pose, .. }) = span.input(0).and_then(|i| i.arm) else {
                panic!("no pose")
            };
            let middle = from.translation.vector * 1.1;
            assert!((pose.translation.vector - middle).norm() < 1e-12);
            assert!((pose.rotation.angle() - 0.2).abs() < 1e-12);
            let end = span.input(4).and_then(|i| i.arm);
            assert_eq!(end, Some(ArmIntent::Pose { frame, pose: goal }));
        }
        let to = ControlInput {
            arm: Some(ArmIntent::Joints([0.3; 6])),
            ..ControlInput::default()
        };
        let half = Span::new(set_points(), to, 0, 2)
            .input(0)
            .and_then(|i| i.arm);
        let Some(ArmIntent::Joints(half)) = half else {
            panic!("no joints")
        };
        assert!(half.iter().all(|q| (q - 0.2).abs() < 1e-12));
    }

    #[test]
    fn a_step_is_applied_once() {
        let to = ControlInput {
            arm: Some(ArmIntent::Step {
                frame: IntentFrame::ArmBase,
                translation: Vector3::new(0.01, 0.0, 0.0),
                rotation: Vector3::zeros(),
            }),
            ..ControlInput::default()
        };
        let span = Span::new(set_points(), to, 0, 3);
        let steps = [0, 4, 8].map(|tick| span.input(tick).is_some_and(|i| i.arm.is_some()));
        assert_eq!(steps, [true, false, false]);
    }
}
