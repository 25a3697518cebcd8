//! Motions to a pose: choice of the path, and the straight line.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion};

use super::cartesian::{Velocity, apart, joint_speeds, weighted};
use super::{ArmControl, ArmState, Motion};
use crate::robot::control::profile::stopping_speed;
use crate::robot::kinematics::screw::rotation_vector;

/// Distance, m, and angle, rad, up to which joints interpolate to a pose.
const NEAR: (f64, f64) = (0.05, 0.2);
/// Largest joint change to a near pose, rad.
const NEAR_CHANGE: f64 = 0.4;
/// Spacing of the samples that check a line, m and rad.
const SAMPLE: (f64, f64) = (0.02, 0.1);
/// Largest joint change between two samples, rad.
const SAMPLE_CHANGE: f64 = 0.35;
/// Distance from the end of a line, m and rad, below which joints interpolate to end
/// exactly.
const LANDING: (f64, f64) = (0.01, 0.05);
/// Steps without motion on a line after which joints interpolate instead: 0.25 s.
const STALL_STEPS: u32 = 60;

impl ArmControl {
    /// Chooses the motion to a pose. For an unreachable one the arm brakes.
    pub(super) fn reach(&self, state: &mut ArmState, goal: &Isometry3<f64>) {
        let (from_desired, turn) = apart(&state.desired, goal);
        let under_way = matches!(state.motion, Motion::Joints { .. } | Motion::Line { .. });
        if under_way && from_desired < 1e-9 && turn < 1e-9 {
            // Repeated goal: the planned motion continues.
            return;
        }
        let present = self.kinematics.forward(&state.position);
        let (distance, angle) = apart(&present, goal);
        let near = distance <= NEAR.0 && angle <= NEAR.1;
        let near_joints = near
            .then(|| {
                self.kinematics
                    .solve_local(goal, &state.position, NEAR_CHANGE)
                    .ok()
            })
            .flatten();
        let motion = if let Some(solution) = near_joints {
            Ok(state.motion.on_to(solution.joints))
        } else if let Some(joints) = self.end_of_line(&state.position, &present, goal) {
            Ok(Motion::Line {
                goal: *goal,
                joints,
                still: 0,
            })
        } else {
            self.kinematics
                .solve_nearest(goal, &state.position)
                .map(|solution| Motion::toward(solution.joints))
        };
        match motion {
            Ok(motion) => {
                state.motion = motion;
                state.desired = *goal;
            }
            Err(unreachable) => {
                state.motion = Motion::Hold;
                state.problem = Some(unreachable.to_string());
            }
        }
    }

    /// Joint positions at the end of the straight line to `goal`, if the arm can follow
    /// all of it.
    fn end_of_line(
        &self,
        from: &[f64; 6],
        present: &Isometry3<f64>,
        goal: &Isometry3<f64>,
    ) -> Option<[f64; 6]> {
        let (distance, angle) = apart(present, goal);
        let samples = (distance / SAMPLE.0).max(angle / SAMPLE.1).ceil().max(1.0);
        if samples > 500.0 {
            return None;
        }
        let way = goal.translation.vector - present.translation.vector;
        let turn = rotation_vector(&present.rotation.rotation_to(&goal.rotation));
        let mut joints = *from;
        for i in 1..=samples as usize {
            let part = i as f64 / samples;
            let pose = Isometry3::from_parts(
                Translation3::from(present.translation.vector + way * part),
                UnitQuaternion::from_scaled_axis(turn * part) * present.rotation,
            );
            joints = self
                .kinematics
                .solve_local(&pose, &joints, SAMPLE_CHANGE)
                .ok()?
                .joints;
        }
        Some(joints)
    }

    /// Joint speeds that move the end effector along a straight line.
    pub(super) fn along_line(
        &self,
        state: &mut ArmState,
        pose: &Isometry3<f64>,
        jacobian: &Matrix6<f64>,
        (goal, joints, still): (Isometry3<f64>, [f64; 6], u32),
        dt: f64,
    ) -> [f64; 6] {
        let way = goal.translation.vector - pose.translation.vector;
        let turn = rotation_vector(&pose.rotation.rotation_to(&goal.rotation));
        let (distance, angle) = (way.norm(), turn.norm());
        let fastest = state
            .velocity
            .iter()
            .fold(0.0_f64, |most, speed| most.max(speed.abs()));
        let still = if fastest < 1e-3 { still + 1 } else { 0 };
        if (distance < LANDING.0 && angle < LANDING.1) || still > STALL_STEPS {
            state.motion = Motion::toward(joints);
            return self.towards_joints(&state.position, &joints, dt);
        }
        state.motion = Motion::Line {
            goal,
            joints,
            still,
        };
        let settings = &self.settings;
        let linear = stopping_speed(distance, settings.tool_acceleration, dt)
            .min(settings.tool_speed)
            / distance.max(1e-9);
        let angular = stopping_speed(angle, settings.tool_turn_acceleration, dt)
            .min(settings.tool_turn_rate)
            / angle.max(1e-9);
        let rate = linear.min(angular);
        let velocity = Velocity {
            linear: way * rate,
            angular: turn * rate,
        };
        joint_speeds(&weighted(jacobian), &velocity.in_tool(pose))
    }
}
