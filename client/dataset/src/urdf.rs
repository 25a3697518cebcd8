//! The robot description of a recording: poses of the links for
//! given joint positions, joint by joint, and a drawing of it without meshes.
//!
//! Forward only, for viewers and for frames that a recording does not hold;
//! the server moves the arm.

use urdf_rs::{Geometry, JointType, Visual};
use wheelarm_proto::v1;

use crate::pose::{self, Pose};

/// A robot description.
#[derive(Clone, Debug)]
pub struct Robot {
    joints: Vec<Joint>,
}

/// One joint: its child's frame in its parent's.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Name of the joint.
    pub name: String,
    /// Link that carries it.
    pub parent: String,
    /// Link that it carries.
    pub child: String,
    origin: Pose,
    axis: [f64; 3],
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Fixed,
    Turns,
    Slides,
}

impl Joint {
    /// Whether its position changes anything.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.kind != Kind::Fixed
    }

    /// The child's frame in the parent's at a position, radians or metres.
    #[must_use]
    pub fn pose(&self, position: f64) -> Pose {
        let [x, y, z] = self.axis;
        let moved = match self.kind {
            Kind::Fixed => return self.origin,
            Kind::Turns => {
                let [qx, qy, qz, qw] = pose::about(self.axis, position);
                [0.0, 0.0, 0.0, qx, qy, qz, qw]
            }
            Kind::Slides => {
                let [x, y, z] = [x, y, z].map(|a| a * position);
                [x, y, z, 0.0, 0.0, 0.0, 1.0]
            }
        };
        pose::compose(&self.origin, &moved)
    }
}

/// Text of the robot description among a recording's asset files.
#[must_use]
pub fn text(assets: &[v1::AssetText]) -> Option<&str> {
    let urdf = assets.iter().find(|a| a.path.ends_with(".urdf"))?;
    Some(&urdf.text)
}

impl Robot {
    /// The description in a recording; `None` when it is absent or is not
    /// readable.
    #[must_use]
    pub fn from_assets(assets: &[v1::AssetText]) -> Option<Self> {
        Self::parse(text(assets)?).ok()
    }

    /// Reads a URDF.
    ///
    /// # Errors
    /// When it is malformed, with the position.
    pub fn parse(urdf: &str) -> Result<Self, String> {
        let robot = urdf_rs::read_from_string(urdf).map_err(|e| e.to_string())?;
        let joint = |j: urdf_rs::Joint| {
            let norm = j.axis.xyz.iter().map(|v| v * v).sum::<f64>().sqrt();
            Joint {
                name: j.name,
                parent: j.parent.link,
                child: j.child.link,
                origin: pose::from_rpy(*j.origin.xyz, *j.origin.rpy),
                axis: j.axis.xyz.map(|v| v / norm),
                kind: match j.joint_type {
                    JointType::Revolute | JointType::Continuous => Kind::Turns,
                    JointType::Prismatic => Kind::Slides,
                    _ => Kind::Fixed,
                },
            }
        };
        Ok(Self {
            joints: robot.joints.into_iter().map(joint).collect(),
        })
    }

    /// The joints from the link `base` to the link `tip`; `None` where none lead
    /// there.
    #[must_use]
    pub fn chain(&self, base: &str, tip: &str) -> Option<Chain<'_>> {
        let mut joints = Vec::new();
        let mut link = tip;
        while link != base {
            let joint = self.joints.iter().find(|joint| joint.child == link)?;
            // A description that hangs in a loop has no way to the base.
            if joints.len() == self.joints.len() {
                return None;
            }
            joints.push(joint);
            link = &joint.parent;
        }
        joints.reverse();
        Some(Chain { joints })
    }

    /// All joints in the order of the file.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }
}

/// Joints that hang from each other.
#[derive(Clone, Debug)]
pub struct Chain<'a> {
    joints: Vec<&'a Joint>,
}

impl Chain<'_> {
    /// base_from_tip; `position` returns the position of a moving joint by its name, rad or m.
    pub fn pose(&self, position: impl Fn(&str) -> f64) -> Pose {
        self.joints.iter().fold(pose::IDENTITY, |base, joint| {
            let position = if joint.moves() {
                position(&joint.name)
            } else {
                0.0
            };
            pose::compose(&base, &joint.pose(position))
        })
    }
}

/// The description without mesh files, which a recording does not contain: a link with meshes gets
/// its collision solids as visuals, in the color of its first mesh.
///
/// # Errors
/// When the text is not a URDF.
pub fn without_meshes(urdf: &str) -> Result<String, String> {
    let mut robot = urdf_rs::read_from_string(urdf).map_err(|e| e.to_string())?;
    for link in &mut robot.links {
        let is_mesh = |v: &Visual| matches!(v.geometry, Geometry::Mesh { .. });
        let Some(mesh) = link.visual.iter().find(|v| is_mesh(v)) else {
            continue;
        };
        let material = mesh.material.clone();
        // A pad that is drawn as a solid already keeps its own colour.
        let own: Vec<Visual> = link
            .visual
            .iter()
            .filter(|v| !is_mesh(v))
            .cloned()
            .collect();
        let solids = link.collision.iter().filter(|c| {
            !matches!(c.geometry, Geometry::Mesh { .. }) && own.iter().all(|v| v.name != c.name)
        });
        let solids = solids.map(|c| Visual {
            name: c.name.clone(),
            origin: c.origin.clone(),
            geometry: c.geometry.clone(),
            material: material.clone(),
        });
        link.visual = solids.chain(own.iter().cloned()).collect();
    }
    urdf_rs::write_to_string(&robot).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn description() -> String {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../assets/robots/wheelarm/wheelarm.urdf"
        );
        std::fs::read_to_string(path).unwrap()
    }

    #[test]
    fn every_link_hangs_from_the_chair() {
        let robot = Robot::parse(&description()).unwrap();
        for joint in robot.joints() {
            let mut link = joint.child.as_str();
            let mut steps = 0;
            while let Some(up) = robot.joints().iter().find(|j| j.child == link) {
                link = &up.parent;
                steps += 1;
                assert!(steps < 40, "{} hangs in a loop", joint.child);
            }
            assert_eq!(link, "wheelchair_root", "{}", joint.child);
        }
        let chain = robot.chain("base_link", "end_effector_link").unwrap();
        let moving = chain.joints.iter().filter(|joint| joint.moves());
        assert_eq!(moving.count(), 6);
        assert!(robot.chain("end_effector_link", "base_link").is_none());
        assert!(Robot::parse("<robot").is_err());
    }

    #[test]
    fn the_drawing_without_meshes_keeps_links_joints_and_colours() {
        let text = without_meshes(&description()).unwrap();
        assert!(!text.contains("<mesh") && !text.contains(".obj"));
        let (before, after) = (
            urdf_rs::read_from_string(&description()).unwrap(),
            urdf_rs::read_from_string(&text).unwrap(),
        );
        assert_eq!(before.joints.len(), after.joints.len());
        for (a, b) in before.joints.iter().zip(&after.joints) {
            assert_eq!(
                (&a.name, a.origin.xyz, a.origin.rpy),
                (&b.name, b.origin.xyz, b.origin.rpy)
            );
        }
        assert_eq!(before.materials.len(), after.materials.len());
        for (a, b) in before.links.iter().zip(&after.links) {
            assert_eq!(a.name, b.name);
            assert_eq!(a.visual.is_empty(), b.visual.is_empty(), "{}", a.name);
            assert!(b.visual.iter().all(|v| v.material.is_some()), "{}", a.name);
        }
        let tip = after
            .links
            .iter()
            .find(|l| l.name == "robotiq_85_left_finger_tip_link");
        let names: Vec<_> = tip
            .unwrap()
            .visual
            .iter()
            .map(|v| v.name.as_deref())
            .collect();
        assert_eq!(names, [Some("holder"), Some("pivot"), Some("pad")]);
    }
}
