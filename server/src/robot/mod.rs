//! The robot as a model: URDF, kinematics and control laws. Pure: no physics,
//! no drawing, no network.

pub mod control;

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};

use crate::geometry::{Part, Visual};

/// A robot read from a URDF and its `robot.toml`.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotModel {
    /// Links; index 0 is the root (`wheelchair_root`). Parents stand before children.
    pub links: Vec<Link>,
    /// Joints; joint `i` has child link `i + 1`.
    pub joints: Vec<Joint>,
    /// Numbers of `robot.toml`.
    pub settings: Settings,
}

/// A link.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name.
    pub name: String,
    /// Mass properties; `None` for massless frames.
    pub inertial: Option<Inertial>,
    /// Shapes that touch, in the link frame.
    pub collision: Vec<Part>,
    /// Shapes that are drawn, in the link frame.
    pub visual: Vec<Visual>,
}

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

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Does not.
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
    /// How it moves.
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

/// Limits of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least position, rad or m; `-inf` without limit.
    pub lower: f64,
    /// Greatest position, rad or m; `inf` without limit.
    pub upper: f64,
    /// Greatest speed, rad/s or m/s.
    pub velocity: f64,
    /// Greatest torque or force, N·m or N.
    pub effort: f64,
}

/// Numbers of `robot.toml`.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Cameras on the robot.
    pub cameras: Vec<CameraMount>,
    /// IMU link name.
    pub imu_link: String,
    /// Link of the recorded end effector.
    pub end_effector_link: String,
    /// Link of the arm's base.
    pub arm_base_link: String,
    /// Distance from the end effector frame to the grasp point along z, metres.
    pub tool_length: f64,
    /// Home position of the six arm joints, radians.
    pub home: [f64; 6],
    /// Wheel radius for drive and odometry, metres.
    pub wheel_radius: f64,
    /// Distance between the driven wheels for drive and odometry, metres.
    pub track: f64,
    /// Footprint in `wheelchair_root`: x min, x max, y min, y max, metres.
    pub footprint: [f64; 4],
}

/// A camera on a link.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraMount {
    /// Name: `gen3`, `wheelchair`.
    pub name: String,
    /// Link that carries it.
    pub link: String,
    /// link_from_optical.
    pub pose: Isometry3<f64>,
    /// Picture size for which the intrinsics hold, pixels.
    pub size: [u32; 2],
    /// Focal lengths, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels from the top left corner.
    pub principal: [f64; 2],
    /// Near and far plane, metres.
    pub range: [f64; 2],
}
