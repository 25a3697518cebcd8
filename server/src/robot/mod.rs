//! The robot as a model: URDF, kinematics and control laws, without physics, rendering
//! and network.

mod clearance;
mod load;
mod outline;
mod reach;
mod roles;
mod settings;

pub mod control;
pub mod kinematics;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::geometry::{Part, Visual};

pub use clearance::ArmSurface;
pub use load::RobotError;
pub use reach::NoReachMap;
pub use roles::{ARM_JOINTS, RecordedFrame, RecordedJoint, Roles};
pub use settings::{
    ArmSettings, CameraMount, CameraTolerance, CorridorSettings, DriveSettings, FrameRole,
    GripperSettings, ImuSettings, JointRole, OutlineSettings, ReachSettings, ScannerSettings,
    SeatSettings, Settings, TravelSettings,
};

/// A robot loaded from a URDF and its `robot.toml`.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotModel {
    /// Name: that of its folder.
    pub name: String,
    /// Path of its URDF below the assets folder.
    pub urdf: String,
    /// The URDF itself.
    pub urdf_text: String,
    /// Links; index 0 is the root, the chair. Parents precede children.
    pub links: Vec<Link>,
    /// Joints; joint `i` has child link `i + 1`.
    pub joints: Vec<Joint>,
    /// Values of `robot.toml`.
    pub settings: Settings,
    /// Joints and links by role.
    pub roles: Roles,
}

impl RobotModel {
    /// Index of a link.
    #[must_use]
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// Index of a joint.
    #[must_use]
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Pose of the arm's base in the chair (chair_from_base).
    #[must_use]
    pub fn arm_mount(&self) -> Isometry3<f64> {
        self.link_poses(&vec![0.0; self.joints.len()])[self.roles.arm_base]
    }

    /// Joints from `ancestor` down to `link`, in this order; `None` when `link` is not
    /// below `ancestor`.
    #[must_use]
    pub fn chain(&self, ancestor: usize, link: usize) -> Option<Vec<usize>> {
        let mut joints = Vec::new();
        let mut at = link;
        while at != ancestor {
            let joint = at.checked_sub(1)?;
            joints.push(joint);
            at = self.joints[joint].parent;
        }
        joints.reverse();
        Some(joints)
    }

    /// Poses of all links in the root frame (root_from_link), in the order of
    /// `links`, from the positions of all joints.
    #[must_use]
    pub fn link_poses(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let mut poses = vec![Isometry3::identity(); self.links.len()];
        for (joint, &position) in self.joints.iter().zip(positions) {
            poses[joint.child] = poses[joint.parent] * joint.transform(position);
        }
        poses
    }
}

/// A link.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name.
    pub name: String,
    /// Mass properties; `None` for massless frames.
    pub inertial: Option<Inertial>,
    /// Colliding shapes, in the link frame.
    pub collision: Vec<Collider>,
    /// Rendered shapes, in the link frame.
    pub visual: Vec<Visual>,
}

/// A colliding shape of a link. The flat faces of the fingers are named [`PAD`].
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    /// Name, unique on its link.
    pub name: String,
    /// Pose and shape in the link frame.
    pub part: Part,
}

/// Name of the collider on each finger tip whose flat face grips.
pub const PAD: &str = "pad";

/// Mass properties of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// kg.
    pub mass: f64,
    /// Centre of mass in the link frame, metres.
    pub com: Point3<f64>,
    /// Inertia about the centre of mass along the link axes, kg·m².
    pub inertia: Matrix3<f64>,
}

/// Type of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Does not move.
    Fixed,
    /// Turns within limits.
    Revolute,
    /// Turns without limits.
    Continuous,
    /// Slides within limits.
    Prismatic,
}

/// A joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name.
    pub name: String,
    /// Type.
    pub kind: JointKind,
    /// Parent link.
    pub parent: usize,
    /// Child link.
    pub child: usize,
    /// parent_from_joint at zero.
    pub origin: Isometry3<f64>,
    /// Axis in the joint (child) frame.
    pub axis: Unit<Vector3<f64>>,
    /// Limits.
    pub limits: Limits,
    /// Follows another joint: `(joint, multiplier, offset)`.
    pub mimic: Option<(usize, f64, f64)>,
}

impl Joint {
    /// parent_from_child at a position, rad or m.
    #[must_use]
    pub fn transform(&self, position: f64) -> Isometry3<f64> {
        match self.kind {
            JointKind::Fixed => self.origin,
            JointKind::Revolute | JointKind::Continuous => {
                self.origin
                    * Isometry3::from_parts(
                        Translation3::identity(),
                        UnitQuaternion::from_axis_angle(&self.axis, position),
                    )
            }
            JointKind::Prismatic => {
                self.origin * Translation3::from(self.axis.into_inner() * position)
            }
        }
    }
}

/// Limits of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Lower position, rad or m; `-inf` without limit.
    pub lower: f64,
    /// Upper position, rad or m; `inf` without limit.
    pub upper: f64,
    /// Largest speed, rad/s or m/s.
    pub velocity: f64,
    /// Largest torque or force, N·m or N.
    pub effort: f64,
}
