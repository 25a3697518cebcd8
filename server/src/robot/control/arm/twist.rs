//! Motion by a twist: a target moves ahead and the arm follows it, limited by joint
//! limits and before singularities.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector6};

use super::cartesian::{Velocity, cut, joint_speeds, slowest, weighted};
use super::{ArmControl, ArmState, Motion};
use crate::robot::kinematics::joint_word;
use crate::robot::kinematics::screw::rotation_vector;

/// Singular value below which a twist towards a singularity is slowed, m/rad.
const NEARLY_SINGULAR: f64 = 0.033;
/// Rate at which a twist's motion returns to its target, 1/s.
const RETURN_RATE: f64 = 20.0;
/// Distance, m, and angle, rad, by which a twist's target may lead the arm.
const LEAD: (f64, f64) = (0.02, 0.1);

impl ArmControl {
    /// Starts or changes a twist without a jump in speed.
    pub(super) fn twist(&self, state: &mut ArmState, in_tool: bool, wanted: Velocity) {
        let now = match state.motion {
            Motion::Twist {
                in_tool: before,
                now,
                ..
            } if before == in_tool => now,
            _ => {
                let (pose, jacobian) = self.kinematics.forward_and_jacobian(&state.position);
                let speed = jacobian * Vector6::from(state.velocity);
                let tool = Velocity {
                    linear: speed.fixed_rows::<3>(3).into_owned(),
                    angular: speed.fixed_rows::<3>(0).into_owned(),
                };
                state.desired = pose;
                if in_tool {
                    tool
                } else {
                    tool.turned(&pose.rotation)
                }
            }
        };
        state.motion = Motion::Twist {
            in_tool,
            wanted,
            now,
        };
    }

    /// Joint speeds that follow a twist; advances its target.
    pub(super) fn by_twist(
        &self,
        state: &mut ArmState,
        pose: &Isometry3<f64>,
        jacobian: &Matrix6<f64>,
        (in_tool, wanted, now): (bool, Velocity, Velocity),
        dt: f64,
    ) -> [f64; 6] {
        let settings = &self.settings;
        let now = if state.problem.is_some() {
            now.forgetting(&wanted)
        } else {
            now
        };
        let now = now.towards(
            &wanted,
            settings.tool_acceleration * dt,
            settings.tool_turn_acceleration * dt,
        );
        state.motion = Motion::Twist {
            in_tool,
            wanted,
            now,
        };
        let Velocity { linear, angular } = if in_tool {
            now.turned(&state.desired.rotation)
        } else {
            now
        };
        let target = Isometry3::from_parts(
            Translation3::from(state.desired.translation.vector + linear * dt),
            UnitQuaternion::from_scaled_axis(angular * dt) * state.desired.rotation,
        );
        let lag = target.translation.vector - pose.translation.vector;
        let turn = rotation_vector(&pose.rotation.rotation_to(&target.rotation));
        // The target waits for an arm that cannot follow.
        let (held_lag, held_turn) = (cut(lag, LEAD.0), cut(turn, LEAD.1));
        let held = held_lag != lag || held_turn != turn;
        state.desired = Isometry3::from_parts(
            Translation3::from(pose.translation.vector + held_lag),
            UnitQuaternion::new_normalize(
                (UnitQuaternion::from_scaled_axis(held_turn) * pose.rotation).into_inner(),
            ),
        );
        if !held {
            state.problem = None;
        } else if state.problem.is_none() {
            state.problem = Some(self.hindrance(&state.position));
        }
        let velocity = Velocity {
            linear: linear + held_lag * RETURN_RATE,
            angular: angular + held_turn * RETURN_RATE,
        };
        let twist = velocity.in_tool(pose);
        self.away_from_singularity(&state.position, &weighted(jacobian), twist)
    }

    /// Joint speeds for a twist that brakes towards a singularity, so that the elbow or
    /// the wrist is at rest before it would flip. Only the component along the
    /// singular direction is slowed, and only inwards.
    fn away_from_singularity(
        &self,
        position: &[f64; 6],
        weighted_jacobian: &Matrix6<f64>,
        twist: Vector6<f64>,
    ) -> [f64; 6] {
        let speeds = joint_speeds(weighted_jacobian, &twist);
        let (value, direction) = slowest(weighted_jacobian);
        let fastest = speeds
            .iter()
            .fold(0.0_f64, |most, speed| most.max(speed.abs()));
        if value >= NEARLY_SINGULAR || fastest == 0.0 {
            return speeds;
        }
        let ahead: [f64; 6] = std::array::from_fn(|i| position[i] + speeds[i] * 0.01 / fastest);
        let ahead = weighted(&self.kinematics.jacobian_body(&ahead));
        if slowest(&ahead).0 >= value {
            return speeds;
        }
        // At the limits, joint speeds decrease like those of a braking joint.
        let excess = (0..6)
            .map(|i| speeds[i].abs() / self.kinematics.speed()[i])
            .fold(1.0, f64::max);
        let twist = twist / excess;
        let left = value / NEARLY_SINGULAR;
        let part = left.sqrt().min(3.0 * left);
        // The rest is slowed proportionally, so that the arm does not slide off.
        let along = direction.dot(&twist);
        let rest = 1.0 - (along.abs() / twist.norm()) * (1.0 - part);
        let slowed = twist * rest - direction * (along * (rest - part));
        joint_speeds(weighted_jacobian, &slowed)
    }

    /// Why a twist is not followed.
    fn hindrance(&self, position: &[f64; 6]) -> String {
        let (lower, upper) = (self.kinematics.lower(), self.kinematics.upper());
        let at_limit =
            (0..6).find(|&i| position[i] - lower[i] < 0.01 || upper[i] - position[i] < 0.01);
        match at_limit {
            Some(i) => format!(
                "the twist is not followed: {} is at its limit, {:.4} rad",
                joint_word(i),
                position[i]
            ),
            None => "the twist is not followed: the arm is stretched or its wrist is straight"
                .to_owned(),
        }
    }
}
