//! Where the arm stands on the chair, seen from above.

use wheelarm_proto::v1;

use crate::pose::{orientation, yaw};
use crate::urdf::{ARM_BASE, CHAIR, Robot};

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

/// `base_link` in `wheelchair_root`, by the robot description in the file.
pub fn arm_mount(assets: &[v1::AssetText]) -> Option<Plane> {
    let mount = Robot::of(assets)?.fixed(CHAIR, ARM_BASE)?;
    Some(Plane {
        x: mount[0],
        y: mount[1],
        yaw: yaw(orientation(&mount)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_before_the_arm_lies_behind_a_turned_mount() {
        let text = r#"<robot name="r"><link name="wheelchair_root"/><link name="pole"/>
            <link name="base_link"/>
            <joint name="a" type="fixed"><parent link="wheelchair_root"/>
            <child link="pole"/><origin xyz="0.4 0.3 0.5"/></joint>
            <joint name="b" type="fixed"><origin xyz="0.1 0 0" rpy="0 0 3.14159265"/>
            <parent link="pole"/><child link="base_link"/></joint></robot>"#;
        let asset = v1::AssetText {
            path: "robots/r/r.urdf".into(),
            text: text.into(),
        };
        let mount = arm_mount(&[asset]).unwrap();
        assert!((mount.x - 0.5).abs() < 1e-9 && (mount.y - 0.3).abs() < 1e-9);
        let (x, y) = mount.point(1.0, 0.0);
        assert!((x + 0.5).abs() < 1e-6 && (y - 0.3).abs() < 1e-6);
        assert_eq!(arm_mount(&[]), None);
    }
}
