//! The furniture as URDF: a link of each body below the frame `house`, fixed ones by
//! fixed joints, moving ones by their prismatic or revolute joint.
//!
//! Shapes are the colliding ones, so the text needs no file: boxes, cylinders and
//! spheres as they are, and the bounds of everything else.

use std::collections::BTreeMap;
use std::fmt::{self, Write};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;

use super::{Body, FurnitureJoint, Scene};
use crate::geometry::{self, Shape};

/// The frame of all poses, and the root link.
const ROOT: &str = "house";
/// Velocity limit of a joint, m/s or rad/s. URDF requires one; nothing limits the
/// furniture.
const MOST_SPEED: f64 = 100.0;
/// Length of the shadow of the x axis below which a rotation has no separate yaw.
const UPRIGHT: f64 = 1e-9;

impl Scene {
    /// The furniture as URDF. Joints have the names of `FurnitureJoints`, links those
    /// of the bodies.
    #[must_use]
    pub fn furniture_urdf(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_urdf(&mut text);
        text
    }

    fn write_urdf(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "<?xml version=\"1.0\"?>")?;
        writeln!(out, "<robot name=\"{}\">", escaped(&self.name))?;
        let mut colours = BTreeMap::new();
        for material in self.furniture.iter().filter_map(material) {
            colours.entry(&material.name).or_insert(material.color);
        }
        for (name, [r, g, b]) in colours {
            let name = escaped(name);
            writeln!(
                out,
                "  <material name=\"{name}\"><color rgba=\"{r} {g} {b} 1\"/></material>"
            )?;
        }
        writeln!(out, "  <link name=\"{ROOT}\"/>")?;
        for (index, body) in self.furniture.iter().enumerate() {
            let joint = self.joint_of(index);
            write_link(out, body, joint)?;
            match joint {
                Some(joint) => self.write_joint(out, joint, body)?,
                None => {
                    let link = link_name(body);
                    writeln!(out, "  <joint name=\"{link}_fixed\" type=\"fixed\">")?;
                    write_ends(out, ROOT, &link, &body.pose)?;
                    writeln!(out, "  </joint>")?;
                }
            }
        }
        writeln!(out, "</robot>")
    }

    fn write_joint(&self, out: &mut String, joint: &FurnitureJoint, body: &Body) -> fmt::Result {
        let kind = match joint.motion {
            JointMotion::Slides => "prismatic",
            JointMotion::Turns => "revolute",
        };
        let (parent, parent_pose) = self.furniture.get(joint.carrier).map_or_else(
            || (ROOT.to_owned(), Isometry3::identity()),
            |carrier| (link_name(carrier), carrier.pose),
        );
        let name = escaped(&joint.name);
        writeln!(out, "  <joint name=\"{name}\" type=\"{kind}\">")?;
        let carrier_from_body = parent_pose.inverse() * body.pose;
        write_ends(out, &parent, &link_name(body), &carrier_from_body)?;
        let axis = body.pose.rotation.inverse() * joint.axis.into_inner();
        writeln!(out, "    <axis xyz=\"{} {} {}\"/>", axis.x, axis.y, axis.z)?;
        // No motor: the effort limit is 0.
        writeln!(
            out,
            "    <limit lower=\"0\" upper=\"{}\" effort=\"0\" velocity=\"{MOST_SPEED}\"/>",
            joint.travel
        )?;
        writeln!(
            out,
            "    <dynamics damping=\"{}\" friction=\"{}\"/>",
            joint.resistance.damping, joint.resistance.friction
        )?;
        writeln!(out, "  </joint>")
    }
}

fn write_link(out: &mut String, body: &Body, joint: Option<&FurnitureJoint>) -> fmt::Result {
    writeln!(out, "  <link name=\"{}\">", link_name(body))?;
    if let Some(joint) = joint {
        let (mass, com, i) = (joint.mass.mass, joint.mass.com, joint.mass.inertia);
        writeln!(
            out,
            "    <inertial><origin xyz=\"{} {} {}\"/><mass value=\"{mass}\"/><inertia \
             ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>",
            com.x,
            com.y,
            com.z,
            i[(0, 0)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 1)],
            i[(1, 2)],
            i[(2, 2)]
        )?;
    }
    let colour = material(body).map(|material| {
        let name = escaped(&material.name);
        format!("<material name=\"{name}\"/>")
    });
    let colour = colour.unwrap_or_default();
    for (pose, shape) in shapes(body) {
        let geometry = format!("{}<geometry>{shape}</geometry>", origin(&pose));
        writeln!(out, "    <visual>{geometry}{colour}</visual>")?;
        writeln!(out, "    <collision>{geometry}</collision>")?;
    }
    writeln!(out, "  </link>")
}

fn write_ends(
    out: &mut String,
    parent: &str,
    child: &str,
    parent_from_child: &Isometry3<f64>,
) -> fmt::Result {
    writeln!(out, "    {}", origin(parent_from_child))?;
    writeln!(
        out,
        "    <parent link=\"{parent}\"/><child link=\"{child}\"/>"
    )
}

/// The colliding shapes with their poses in the body.
fn shapes(body: &Body) -> impl Iterator<Item = (Isometry3<f64>, String)> + '_ {
    let simple = body.collision.iter().filter_map(|part| {
        let text = match &part.shape {
            Shape::Cylinder {
                radius,
                half_height,
            } => {
                let length = 2.0 * half_height;
                format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>")
            }
            Shape::Sphere { radius } => format!("<sphere radius=\"{radius}\"/>"),
            other => {
                let (centre, half) = geometry::bounds(other)?;
                return Some((part.pose * Translation3::from(centre), cuboid(&half)));
            }
        };
        Some((part.pose, text))
    });
    let hulls = body.hull_boxes();
    simple.chain(hulls.map(|(pose, half)| (pose, cuboid(&half))))
}

fn cuboid(half: &Vector3<f64>) -> String {
    let size = half * 2.0;
    format!("<box size=\"{} {} {}\"/>", size.x, size.y, size.z)
}

/// Material of what is first rendered.
fn material(body: &Body) -> Option<&geometry::Material> {
    body.visual.first().map(|visual| &visual.material)
}

/// Name of a body's link: no other one has the name of the root.
fn link_name(body: &Body) -> String {
    if body.name == ROOT {
        return format!("{ROOT}_furniture");
    }
    escaped(&body.name)
}

fn origin(pose: &Isometry3<f64>) -> String {
    let (at, [roll, pitch, yaw]) = (pose.translation.vector, fixed_angles(&pose.rotation));
    format!(
        "<origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>",
        at.x, at.y, at.z
    )
}

/// Roll, pitch and yaw about the fixed axes x, y and z in this order, radians.
fn fixed_angles(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let m = rotation.to_rotation_matrix();
    let shadow = exact::hypot(m[(0, 0)], m[(1, 0)]);
    let pitch = exact::atan2(-m[(2, 0)], shadow);
    if shadow < UPRIGHT {
        return [0.0, pitch, exact::atan2(-m[(0, 1)], m[(1, 1)])];
    }
    let roll = exact::atan2(m[(2, 1)], m[(2, 2)]);
    [roll, pitch, exact::atan2(m[(1, 0)], m[(0, 0)])]
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotation(angles: [f64; 3]) -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2])
    }

    #[test]
    fn fixed_angles_give_the_rotation_back() {
        let quarter = std::f64::consts::FRAC_PI_2;
        for angles in [
            [0.3, -0.7, 2.9],
            [-3.0, 1.2, 0.1],
            [0.4, quarter, -1.1],
            [0.4, -quarter, 2.0],
            [quarter, 0.0, -quarter],
        ] {
            let wanted = rotation(angles);
            let found = rotation(fixed_angles(&wanted));
            assert!(found.angle_to(&wanted) < 1e-7, "{angles:?}");
        }
    }

    #[test]
    fn every_piece_of_the_home_is_a_link_and_drawers_are_prismatic() {
        let scene = super::super::tests::home();
        let robot = urdf_rs::read_from_string(&scene.furniture_urdf()).expect("a URDF");
        assert_eq!(robot.links.len(), 1 + scene.furniture.len());
        assert_eq!(robot.joints.len(), scene.furniture.len());
        for joint in &scene.joints {
            let mut found = robot.joints.iter().filter(|j| j.name == joint.name);
            let found = found.next().expect("a joint of the name");
            assert!(matches!(found.joint_type, urdf_rs::JointType::Prismatic));
            assert_eq!((found.limit.lower, found.limit.upper), (0.0, joint.travel));
            let body = &scene.furniture[joint.furniture];
            assert_eq!(found.child.link, body.name);
            let link = robot.links.iter().find(|link| link.name == body.name);
            let link = link.expect("its link");
            assert_eq!(link.visual.len(), body.collision.len() + body.hulls.len());
            assert_eq!(link.inertial.mass.value, joint.mass.mass);
        }
        assert!(!scene.joints.is_empty());
    }

    #[test]
    fn furniture_named_as_the_world_and_odd_names_stay_readable() {
        let mut scene = super::super::tests::home();
        scene.furniture.truncate(3);
        (scene.joints, scene.surfaces) = (Vec::new(), Vec::new());
        scene.furniture[1].name = "house".into();
        scene.furniture[2].name = "a<b & \"c\"".into();
        let robot = urdf_rs::read_from_string(&scene.furniture_urdf()).expect("a URDF");
        let names: Vec<&str> = robot.links.iter().map(|link| link.name.as_str()).collect();
        assert_eq!(names[2..], ["house_furniture", "a<b & \"c\""]);
    }
}
