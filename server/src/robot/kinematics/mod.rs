//! Kinematics of the arm: product of exponentials, body Jacobian and inverse
//! kinematics, computed from the loaded URDF.
//!
//! Stateless, and without allocation after [`ArmKinematics::new`].

mod inverse;
pub mod screw;

use nalgebra::{Isometry3, Matrix6, Point3, Unit, Vector3};

use super::RobotModel;
pub use inverse::{Reason, Solution, Unreachable};
use screw::Screw;

/// Name of a joint of the arm in messages, counted from 0 at the base.
pub(super) fn joint_word(joint: usize) -> String {
    format!("arm joint {}", joint + 1)
}

/// The arm from its base link to the end effector.
///
/// With the body screws B and the pose M of the end effector at zero,
/// `T(q) = M exp([B1] q1) … exp([B6] q6)`. Lynch & Park 2017, section 4.1.3.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmKinematics {
    /// base_from_end_effector at zero.
    zero: Isometry3<f64>,
    /// Joint axes in the end effector frame at zero.
    screws: [Screw; 6],
    /// Lower joint limits, rad; `-inf` for continuous joints.
    lower: [f64; 6],
    /// Upper joint limits, rad; `inf` for continuous joints.
    upper: [f64; 6],
    /// Joint speed limits, rad/s.
    speed: [f64; 6],
    /// Origin of the second joint at zero in the arm's base, m.
    shoulder: Point3<f64>,
    /// Largest distance of the end effector from the shoulder, m.
    reach: f64,
}

impl ArmKinematics {
    /// From the joints between arm base and end effector, which `RobotModel::load` has
    /// checked: the six of the arm and fixed ones.
    #[must_use]
    pub fn new(model: &RobotModel) -> ArmKinematics {
        let roles = &model.roles;
        let chain = model.chain(roles.arm_base, roles.end_effector);
        let chain = chain.unwrap_or_default();
        let mut base_from_joint = Isometry3::identity();
        let mut axes = [(Unit::new_unchecked(Vector3::z()), Point3::origin()); 6];
        let (mut lower, mut upper) = ([f64::NEG_INFINITY; 6], [f64::INFINITY; 6]);
        let mut speed = [0.0; 6];
        // Distances between consecutive joint origins beyond the shoulder.
        let mut reach = 0.0;
        for &index in &chain {
            let joint = &model.joints[index];
            base_from_joint *= joint.origin;
            let arm_joint = roles.arm_index(index);
            if let Some(i) = arm_joint {
                axes[i] = (
                    Unit::new_unchecked(base_from_joint * joint.axis.into_inner()),
                    base_from_joint * Point3::origin(),
                );
                lower[i] = joint.limits.lower;
                upper[i] = joint.limits.upper;
                speed[i] = joint.limits.velocity;
            }
            if arm_joint != Some(0) && arm_joint != Some(1) {
                reach += joint.origin.translation.vector.norm();
            }
        }
        let zero = base_from_joint;
        ArmKinematics {
            screws: axes.map(|(axis, point)| {
                Screw::revolute(
                    zero.inverse_transform_vector(&axis),
                    zero.inverse_transform_point(&point).coords,
                )
            }),
            zero,
            lower,
            upper,
            speed,
            shoulder: axes[1].1,
            reach,
        }
    }

    /// Lower joint limits, rad; `-inf` for continuous joints.
    #[must_use]
    pub fn lower(&self) -> &[f64; 6] {
        &self.lower
    }

    /// Upper joint limits, rad; `inf` for continuous joints.
    #[must_use]
    pub fn upper(&self) -> &[f64; 6] {
        &self.upper
    }

    /// Joint speed limits, rad/s.
    #[must_use]
    pub fn speed(&self) -> &[f64; 6] {
        &self.speed
    }

    /// base_from_end_effector.
    #[must_use]
    pub fn forward(&self, joints: &[f64; 6]) -> Isometry3<f64> {
        // Multiplied in the order of `forward_and_jacobian`, for the same bits.
        let joints = self.screws.iter().zip(joints).rev();
        self.zero
            * joints.fold(Isometry3::identity(), |beyond, (screw, angle)| {
                screw.exponential(*angle) * beyond
            })
    }

    /// Body Jacobian, 6x6, rows `[angular; linear]`: columns are the end
    /// effector's twist in its own frame per joint speed. Lynch & Park 2017,
    /// section 5.1.2.
    #[must_use]
    pub fn jacobian_body(&self, joints: &[f64; 6]) -> Matrix6<f64> {
        self.forward_and_jacobian(joints).1
    }

    /// Both at once: they share the exponentials.
    #[must_use]
    pub fn forward_and_jacobian(&self, joints: &[f64; 6]) -> (Isometry3<f64>, Matrix6<f64>) {
        let mut jacobian = Matrix6::zeros();
        // exp([B(i+1)] q(i+1)) … exp([B6] q6)
        let mut beyond = Isometry3::identity();
        for i in (0..6).rev() {
            // Twist of the screw seen from the end effector: Ad(beyond⁻¹) B.
            let screw = &self.screws[i];
            let angular = beyond.rotation.inverse_transform_vector(&screw.angular);
            let linear = beyond.rotation.inverse_transform_vector(
                &(screw.linear - beyond.translation.vector.cross(&screw.angular)),
            );
            for row in 0..3 {
                jacobian[(row, i)] = angular[row];
                jacobian[(row + 3, i)] = linear[row];
            }
            beyond = screw.exponential(joints[i]) * beyond;
        }
        (self.zero * beyond, jacobian)
    }
}

#[cfg(test)]
mod tests;
