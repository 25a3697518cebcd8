//! The arm's mount on the chair, seen from above.

use wheelarm_proto::{check, v1};

use crate::pose::yaw;

/// A pose in the plane: x, y in metres and yaw in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
}

impl Plane {
    /// A point of this frame in the frame's parent.
    pub fn point(&self, x: f64, y: f64) -> (f64, f64) {
        let (s, c) = self.yaw.sin_cos();
        (self.x + c * x - s * y, self.y + s * x + c * y)
    }
}

/// The arm's base in the chair, by the robot's description.
pub fn arm_mount(robot: &v1::RobotDescription) -> Option<Plane> {
    let ([x, y, _], turned) = check::pose("arm mount", robot.arm_mount.as_ref()).ok()?;
    Some(Plane {
        x,
        y,
        yaw: yaw(turned),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_before_the_arm_is_behind_a_turned_mount() {
        let robot = v1::RobotDescription {
            arm_mount: Some(v1::Pose {
                position: Some(v1::Vector3 {
                    x: 0.5,
                    y: 0.3,
                    z: 0.5,
                }),
                orientation: Some(v1::Quaternion {
                    z: 1.0,
                    ..v1::Quaternion::default()
                }),
            }),
            ..v1::RobotDescription::default()
        };
        let mount = arm_mount(&robot).unwrap();
        assert!((mount.x - 0.5).abs() < 1e-9 && (mount.y - 0.3).abs() < 1e-9);
        let (x, y) = mount.point(1.0, 0.0);
        assert!((x + 0.5).abs() < 1e-6 && (y - 0.3).abs() < 1e-6);
        assert_eq!(arm_mount(&v1::RobotDescription::default()), None);
    }
}
