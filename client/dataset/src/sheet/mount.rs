//! Where the arm stands on the chair, from the robot description in the file.
//!
//! Reads just the joints' parents, children and origins out of the URDF text;
//! a description that it cannot follow gives no answer.

use wheelarm_proto::v1;

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

struct Joint<'a> {
    parent: &'a str,
    child: &'a str,
    origin: Plane,
    height: f64,
    tilted: bool,
}

/// `base_link` in `wheelchair_root`: x y z, qx qy qz qw; `None` when the mount
/// is tilted.
pub fn mount_pose(assets: &[v1::AssetText]) -> Option<[f64; 7]> {
    let urdf = assets.iter().find(|a| a.path.ends_with(".urdf"))?;
    let (plane, height, tilted) = chain(&urdf.text)?;
    let (s, c) = (0.5 * plane.yaw).sin_cos();
    (!tilted).then_some([plane.x, plane.y, height, 0.0, 0.0, s, c])
}

/// `base_link` in `wheelchair_root`, seen from above.
pub fn arm_mount(assets: &[v1::AssetText]) -> Option<Plane> {
    let urdf = assets.iter().find(|a| a.path.ends_with(".urdf"))?;
    mount_in(&urdf.text)
}

fn mount_in(urdf: &str) -> Option<Plane> {
    chain(urdf).map(|c| c.0)
}

fn chain(urdf: &str) -> Option<(Plane, f64, bool)> {
    let joints: Vec<Joint<'_>> = urdf
        .split("<joint ")
        .skip(1)
        .filter_map(|block| joint(block.split("</joint>").next()?))
        .collect();
    let mut out = Plane {
        x: 0.0,
        y: 0.0,
        yaw: 0.0,
    };
    let (mut height, mut tilted) = (0.0, false);
    let mut link = "base_link";
    for _ in 0..=joints.len() {
        if link == "wheelchair_root" {
            return Some((out, height, tilted));
        }
        let joint = joints.iter().find(|j| j.child == link)?;
        let (x, y) = joint.origin.point(out.x, out.y);
        out = Plane {
            x,
            y,
            yaw: out.yaw + joint.origin.yaw,
        };
        height += joint.height;
        tilted |= joint.tilted;
        link = joint.parent;
    }
    None
}

fn joint(block: &str) -> Option<Joint<'_>> {
    let element = |name: &str| block.split(name).nth(1)?.split('>').next();
    let origin = element("<origin").unwrap_or_default();
    let numbers = |name: &str| -> Vec<f64> {
        attribute(origin, name)
            .unwrap_or_default()
            .split_whitespace()
            .filter_map(|n| n.parse().ok())
            .collect()
    };
    let (xyz, rpy) = (numbers("xyz"), numbers("rpy"));
    let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
    Some(Joint {
        parent: attribute(element("<parent")?, "link")?,
        child: attribute(element("<child")?, "link")?,
        origin: Plane {
            x: at(&xyz, 0),
            y: at(&xyz, 1),
            yaw: at(&rpy, 2),
        },
        height: at(&xyz, 2),
        tilted: at(&rpy, 0).abs() + at(&rpy, 1).abs() > 1e-9,
    })
}

fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    let rest = element.split(&format!("{name}=\"")).nth(1)?;
    rest.split('"').next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mount_is_followed_through_fixed_joints() {
        let urdf = r#"<joint name="a" type="fixed"><parent link="wheelchair_root"/>
            <child link="pole"/><origin xyz="0.4 0.3 0.5"/></joint>
            <joint name="b" type="fixed"><origin xyz="0.1 0 0" rpy="0 0 3.14159265"/>
            <parent link="pole"/><child link="base_link"/></joint>"#;
        let mount = mount_in(urdf).unwrap();
        assert!((mount.x - 0.5).abs() < 1e-9 && (mount.y - 0.3).abs() < 1e-9);
        let (x, y) = mount.point(1.0, 0.0);
        assert!((x + 0.5).abs() < 1e-6 && (y - 0.3).abs() < 1e-6);
        assert_eq!(mount_in("<robot/>"), None);
    }
}
