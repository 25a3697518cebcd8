//! Loads URDF and `robot.toml` into a validated [`RobotModel`].
//!
//! A loaded model has every joint and link that the rest of the server uses, sane
//! limits and physical inertias.

mod elements;

use std::path::{Path, PathBuf};

use wheelarm_proto::exact;

use super::control::GripperMap;
use super::roles::{ARM_JOINTS, RecordedFrame, RecordedJoint, Roles};
use super::settings::{File, FrameRole, Settings};
use super::{Joint, JointKind, Link, PAD, RobotModel};
use crate::geometry::Shape;

/// Users of a joint or a link, for messages.
const RECORDED: &str = "robot.toml records";
const NAMED: &str = "robot.toml names";
/// Tolerance between the stroke and the linkage's opening, metres.
const STROKE_TOLERANCE: f64 = 1e-3;
/// Tolerance between the track and that of the driven wheels, metres.
const TRACK_TOLERANCE: f64 = 1e-3;

/// Why a robot cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}; is the assets folder complete?")]
    Read {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// Unknown robot.
    #[error("unknown robot {name:?}: available: {known}")]
    Unknown {
        /// Name.
        name: String,
        /// Folders below `robots` with a `robot.toml`.
        known: String,
    },
    /// `robot.toml` is malformed.
    #[error("cannot read {path}: {source}{fix}")]
    Toml {
        /// File.
        path: PathBuf,
        /// Cause, with line and column.
        source: Box<toml::de::Error>,
        /// The key that was probably meant, or empty.
        fix: String,
    },
    /// The URDF is malformed.
    #[error("{path}: {source}")]
    Urdf {
        /// File.
        path: PathBuf,
        /// Cause.
        source: Box<urdf_rs::UrdfError>,
    },
    /// A name that does not exist.
    #[error("{path} has no {kind} `{name}`, which {user}; add it")]
    Missing {
        /// File.
        path: PathBuf,
        /// `link`, `joint`, `collision element`, ….
        kind: &'static str,
        /// Name.
        name: String,
        /// Where the name is used.
        user: &'static str,
    },
    /// An invalid value.
    #[error("{path}: {object}: {found}, expected {expected}")]
    Invalid {
        /// File.
        path: PathBuf,
        /// Link, joint or setting.
        object: String,
        /// What was found.
        found: String,
        /// Allowed values.
        expected: String,
    },
}

impl RobotModel {
    /// Reads and checks `robots/NAME/robot.toml` below the assets folder and
    /// the URDF beside it.
    ///
    /// # Errors
    /// A [`RobotError`] that names the file, the object, the value found and the
    /// allowed values.
    pub fn load(assets_dir: &Path, name: &str) -> Result<RobotModel, RobotError> {
        let folder = format!("robots/{name}");
        let toml_path = assets_dir.join(&folder).join("robot.toml");
        if !toml_path.is_file() {
            return Err(unknown(assets_dir, name));
        }
        let text = read(&toml_path)?;
        let file: File = toml::from_str(&text).map_err(|source| RobotError::Toml {
            path: toml_path.clone(),
            fix: nearest_key(source.message()),
            source: Box::new(source),
        })?;
        if file.name != name {
            return Err(RobotError::Invalid {
                path: toml_path,
                object: "name".to_owned(),
                found: file.name,
                expected: format!("the folder's name, {name}"),
            });
        }
        let urdf_path = assets_dir.join(&folder).join(&file.urdf);
        let text = read(&urdf_path)?;
        let robot = urdf_rs::read_from_string(&text).map_err(|source| RobotError::Urdf {
            path: urdf_path.clone(),
            source: Box::new(source),
        })?;
        let reader = Reader {
            assets_dir,
            folder: &folder,
            urdf: &urdf_path,
            text: &text,
            toml: &toml_path,
            file: &file,
            robot: &robot,
        };
        reader.model()
    }
}

fn unknown(assets_dir: &Path, name: &str) -> RobotError {
    let folder = assets_dir.join("robots");
    let entries = match std::fs::read_dir(&folder) {
        Ok(entries) => entries,
        Err(source) => {
            return RobotError::Read {
                path: folder,
                source,
            };
        }
    };
    let mut known: Vec<String> = entries
        .flatten()
        .filter(|entry| entry.path().join("robot.toml").is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    known.sort();
    RobotError::Unknown {
        name: name.to_owned(),
        known: known.join(", "),
    }
}

/// The fix for an unknown key or role: the nearest of those that the message of the parser
/// lists after the unknown one, all in backticks. Empty for other messages.
fn nearest_key(message: &str) -> String {
    let mut names = message.split('`').skip(1).step_by(2);
    let unknown = names
        .next()
        .filter(|_| message.starts_with("unknown "))
        .unwrap_or_default();
    let alike = |name: &&str| strsim::jaro_winkler(unknown, name);
    let nearest = names.max_by(|one, other| alike(one).total_cmp(&alike(other)));
    nearest
        .filter(|_| !unknown.is_empty())
        .map_or_else(String::new, |nearest| {
            format!("\nwrite `{nearest}` in place of `{unknown}`, or remove it")
        })
}

fn read(path: &Path) -> Result<String, RobotError> {
    std::fs::read_to_string(path).map_err(|source| RobotError::Read {
        path: path.to_owned(),
        source,
    })
}

/// The two files during loading.
struct Reader<'a> {
    assets_dir: &'a Path,
    folder: &'a str,
    urdf: &'a Path,
    text: &'a str,
    toml: &'a Path,
    file: &'a File,
    robot: &'a urdf_rs::Robot,
}

impl Reader<'_> {
    fn invalid(&self, object: String, found: String, expected: &str) -> RobotError {
        RobotError::Invalid {
            path: self.urdf.to_owned(),
            object,
            found,
            expected: expected.to_owned(),
        }
    }

    fn model(&self) -> Result<RobotModel, RobotError> {
        let settings = self.file.settings();
        if let Some((object, found, expected)) = settings.fault() {
            return Err(RobotError::Invalid {
                path: self.toml.to_owned(),
                object,
                found: found.to_string(),
                expected: expected.to_owned(),
            });
        }
        let (links, joints) = self.tree()?;
        let roles = self.roles(&links, &joints, &settings)?;
        let mut model = RobotModel {
            name: self.file.name.clone(),
            urdf: format!("{}/{}", self.folder, self.file.urdf),
            urdf_text: self.text.to_owned(),
            links,
            joints,
            settings,
            roles,
        };
        self.resolve_mimics(&mut model)?;
        self.check_names(&model)?;
        self.check_arm(&model)?;
        self.check_numbers(&model)?;
        self.check_masses(&model)?;
        Ok(model)
    }

    /// Links and joints with parents before children, in file order.
    fn tree(&self) -> Result<(Vec<Link>, Vec<Joint>), RobotError> {
        let robot = self.robot;
        let is_child = |name: &str| robot.joints.iter().any(|joint| joint.child.link == name);
        let roots: Vec<&str> = robot
            .links
            .iter()
            .map(|link| link.name.as_str())
            .filter(|name| !is_child(name))
            .collect();
        let chair = self.file.frames.iter().find(|f| f.role == FrameRole::Chair);
        let root_name = chair.map_or("", |frame| frame.link.as_str());
        if roots != [root_name] {
            return Err(self.invalid(
                "root link".to_owned(),
                roots.join(", "),
                &format!(
                    "exactly one, {root_name:?}: the link of the frame of role chair in robot.toml"
                ),
            ));
        }
        let find = |name: &str| {
            robot
                .links
                .iter()
                .find(|link| link.name == name)
                .ok_or_else(|| self.missing("link", name, "a joint names"))
        };
        let mut links = vec![self.link(find(root_name)?)?];
        let mut joints = Vec::new();
        // Depth first: the stack contains (parent index, joint).
        let below = |parent: usize, name: &str| {
            robot
                .joints
                .iter()
                .rev()
                .filter(|joint| joint.parent.link == name)
                .map(|joint| (parent, joint))
                .collect::<Vec<_>>()
        };
        let mut stack = below(0, root_name);
        while let Some((parent, joint)) = stack.pop() {
            let child = links.len();
            links.push(self.link(find(&joint.child.link)?)?);
            joints.push(self.joint(joint, parent, child)?);
            if links.len() > robot.links.len() {
                return Err(self.invalid(
                    format!("link {}", joint.child.link),
                    "two parent joints".to_owned(),
                    "one",
                ));
            }
            stack.extend(below(child, &joint.child.link));
        }
        if links.len() != robot.links.len() {
            return Err(self.invalid(
                "joints".to_owned(),
                format!(
                    "{} of {} links hang from {root_name}",
                    links.len(),
                    robot.links.len()
                ),
                "all, without a loop",
            ));
        }
        Ok((links, joints))
    }

    fn missing(&self, kind: &'static str, name: &str, user: &'static str) -> RobotError {
        RobotError::Missing {
            path: self.urdf.to_owned(),
            kind,
            name: name.to_owned(),
            user,
        }
    }

    fn resolve_mimics(&self, model: &mut RobotModel) -> Result<(), RobotError> {
        for joint in &self.robot.joints {
            let Some(mimic) = &joint.mimic else { continue };
            let index = |name: &str| {
                model
                    .joint(name)
                    .ok_or_else(|| self.missing("joint", name, "a mimic element names"))
            };
            let (follower, leader) = (index(&joint.name)?, index(&mimic.joint)?);
            model.joints[follower].mimic = Some((
                leader,
                mimic.multiplier.unwrap_or(1.0),
                mimic.offset.unwrap_or(0.0),
            ));
        }
        for joint in &model.joints {
            let chained = joint
                .mimic
                .is_some_and(|(leader, ..)| model.joints[leader].mimic.is_some());
            if chained {
                return Err(self.invalid(
                    format!("joint {}", joint.name),
                    "a mimic of a mimic".to_owned(),
                    "a mimic of a joint that moves by itself",
                ));
            }
        }
        Ok(())
    }

    /// The joints and links named in `robot.toml`, by their roles.
    fn roles(
        &self,
        links: &[Link],
        joints: &[Joint],
        settings: &Settings,
    ) -> Result<Roles, RobotError> {
        let link = |name: &str, user: &'static str| {
            let found = links.iter().position(|link| link.name == name);
            found.ok_or_else(|| self.missing("link", name, user))
        };
        let recorded = self
            .file
            .joints
            .iter()
            .map(|table| {
                let joint = joints.iter().position(|joint| joint.name == table.name);
                let joint = joint.ok_or_else(|| self.missing("joint", &table.name, RECORDED))?;
                if joints[joint].kind == JointKind::Fixed {
                    return Err(self.invalid(
                        format!("joint {}", table.name),
                        "type fixed".to_owned(),
                        "a joint that moves",
                    ));
                }
                Ok(RecordedJoint {
                    joint,
                    role: table.role,
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let arm_base = link(&settings.arm_base_link, NAMED)?;
        let frames = self
            .file
            .frames
            .iter()
            .map(|table| {
                Ok(RecordedFrame {
                    name: table.name.clone(),
                    parent: (table.role != FrameRole::Chair).then_some(arm_base),
                    link: link(&table.link, RECORDED)?,
                    role: table.role,
                })
            })
            .collect::<Result<Vec<_>, RobotError>>()?;
        let named = [
            arm_base,
            link(&settings.end_effector_link, NAMED)?,
            link(&settings.imu.link, NAMED)?,
        ];
        Roles::find(recorded, frames, named).map_err(|found| RobotError::Invalid {
            path: self.toml.to_owned(),
            object: "joints and frames".to_owned(),
            found,
            expected: format!("one of each role, and {ARM_JOINTS} of the arm"),
        })
    }

    /// Checks that every name exists exactly once.
    fn check_names(&self, model: &RobotModel) -> Result<(), RobotError> {
        for camera in &model.settings.cameras {
            if model.link(&camera.link).is_none() {
                return Err(self.missing("link", &camera.link, NAMED));
            }
        }
        if let Some(scanner) = &model.settings.scanner
            && model.link(&scanner.link).is_none()
        {
            return Err(self.missing("link", &scanner.link, NAMED));
        }
        for joint in model.roles.finger_tips {
            let tip = &model.links[model.joints[joint].child];
            let has_pad = tip.collision.iter().any(|collider| {
                collider.name == PAD && matches!(collider.part.shape, Shape::Cuboid { .. })
            });
            if !has_pad {
                return Err(self.missing(
                    "box collision element",
                    PAD,
                    "grips, on both finger tips",
                ));
            }
        }
        let repeated = |names: Vec<&String>| {
            names
                .iter()
                .enumerate()
                .find(|(i, name)| names[..*i].contains(name))
                .map(|(_, name)| (*name).clone())
        };
        let recorded = &self.file.joints;
        let twice = repeated(model.joints.iter().map(|joint| &joint.name).collect())
            .or_else(|| repeated(model.links.iter().map(|link| &link.name).collect()))
            .or_else(|| repeated(recorded.iter().map(|joint| &joint.name).collect()))
            .or_else(|| repeated(self.file.frames.iter().map(|frame| &frame.name).collect()))
            .or_else(|| repeated(model.settings.cameras.iter().map(|c| &c.name).collect()));
        if let Some(name) = twice {
            return Err(RobotError::Invalid {
                path: self.toml.to_owned(),
                object: name,
                found: "two of this name, there or in the URDF".to_owned(),
                expected: "one".to_owned(),
            });
        }
        for camera in &model.settings.cameras {
            if camera.name == "room" || wheelarm_proto::keys::check_name(&camera.name).is_err() {
                return Err(self.wrong(
                    format!("camera {:?}", camera.name),
                    "this name",
                    "1 to 64 letters, digits, `-` or `_`, and not `room`, the camera of the scene",
                ));
            }
        }
        Ok(())
    }

    fn wrong(
        &self,
        object: impl Into<String>,
        found: impl std::fmt::Display,
        expected: impl Into<String>,
    ) -> RobotError {
        RobotError::Invalid {
            path: self.toml.to_owned(),
            object: object.into(),
            found: found.to_string(),
            expected: expected.into(),
        }
    }

    /// Checks that the wheels are at the configured positions, left and right, and the
    /// gripper closes within its joint's limits.
    fn check_numbers(&self, model: &RobotModel) -> Result<(), RobotError> {
        let (settings, roles) = (&model.settings, &model.roles);
        let poses = model.link_poses(&vec![0.0; model.joints.len()]);
        let y = roles
            .wheels
            .map(|joint| poses[model.joints[joint].child].translation.y);
        if y[0] <= y[1] {
            return Err(self.wrong(
                "roles wheel_left and wheel_right",
                format!("wheels at y {} and {} m", y[0], y[1]),
                "the left one on the left, at the greater y",
            ));
        }
        let track = y[0] - y[1];
        if (track - settings.drive.track).abs() > TRACK_TOLERANCE {
            return Err(self.wrong(
                "drive.track",
                format!("{} m", settings.drive.track),
                format!("{track:.4} m, the distance of the driven wheels in the URDF"),
            ));
        }
        let closed = settings.gripper.closed;
        let limits = model.joints[roles.knuckles[0]].limits;
        if closed > limits.upper {
            return Err(self.wrong(
                "gripper.closed",
                format!("{closed} rad"),
                format!(
                    "at most {} rad, the knuckle's limit in the URDF",
                    limits.upper
                ),
            ));
        }
        let [out, along] = GripperMap::new(model).crank();
        let (crank, lever) = (exact::hypot(out, along), settings.gripper.finger_lever);
        if lever < crank {
            return Err(self.wrong(
                "gripper.finger_lever",
                format!("{lever} m/rad"),
                format!("at least {crank:.4} m/rad, the length of the crank in the URDF"),
            ));
        }
        let (force, most) = (settings.gripper.force, settings.gripper.max_force);
        if force > most {
            return Err(self.wrong(
                "gripper.force",
                format!("{force} N"),
                format!("at most gripper.max_force, {most} N"),
            ));
        }
        Ok(())
    }

    /// Checks the chain from the arm's base to the end effector: only the joints of
    /// role arm move, in this order. Checks that the linkage's opening matches the
    /// stroke.
    fn check_arm(&self, model: &RobotModel) -> Result<(), RobotError> {
        let (settings, roles) = (&model.settings, &model.roles);
        let names = |joints: &[usize]| {
            let names = joints
                .iter()
                .map(|&joint| model.joints[joint].name.as_str());
            names.collect::<Vec<_>>().join(", ")
        };
        let mut moving = model
            .chain(roles.arm_base, roles.end_effector)
            .unwrap_or_default();
        moving.retain(|&joint| model.joints[joint].kind != JointKind::Fixed);
        let turning = roles
            .arm
            .iter()
            .all(|&joint| model.joints[joint].kind != JointKind::Prismatic);
        if moving != roles.arm || !turning {
            return Err(self.invalid(
                format!(
                    "chain from {} to {}",
                    settings.arm_base_link, settings.end_effector_link
                ),
                names(&moving),
                &format!("the turning joints {}", names(&roles.arm)),
            ));
        }
        let postures = settings.postures.iter().enumerate();
        let postures = postures.map(|(i, posture)| (format!("postures[{i}]"), posture));
        let home = ("home".to_owned(), &settings.home);
        let travel = settings.travel.iter();
        let travel = travel.map(|travel| ("travel.joints".to_owned(), &travel.joints));
        for (what, posture) in [home].into_iter().chain(postures).chain(travel) {
            for (&joint, position) in roles.arm.iter().zip(posture) {
                let limits = model.joints[joint].limits;
                if !(limits.lower <= *position && *position <= limits.upper) {
                    return Err(RobotError::Invalid {
                        path: self.toml.to_owned(),
                        object: format!("{what} of {}", model.joints[joint].name),
                        found: position.to_string(),
                        expected: format!("{} to {} rad", limits.lower, limits.upper),
                    });
                }
            }
        }
        for (i, posture) in settings.postures.iter().enumerate() {
            if !model.is_within_outlines(posture) {
                return Err(RobotError::Invalid {
                    path: self.toml.to_owned(),
                    object: format!("postures[{i}]"),
                    found: format!("{posture:?} rad, which reaches out of the outlines"),
                    expected: "an arm within the outlines, above the chair".to_owned(),
                });
            }
        }
        if let Some(travel) = &settings.travel
            && !model.is_within(&travel.outlines, &travel.joints)
        {
            return Err(RobotError::Invalid {
                path: self.toml.to_owned(),
                object: "travel.joints".to_owned(),
                found: format!(
                    "{:?} rad, which reaches out of travel.outline",
                    travel.joints
                ),
                expected: "an arm within the outlines of the travel posture".to_owned(),
            });
        }
        let opening = GripperMap::new(model).opening(0.0);
        if (opening - settings.gripper.stroke).abs() > STROKE_TOLERANCE {
            return Err(RobotError::Invalid {
                path: self.toml.to_owned(),
                object: "gripper.stroke".to_owned(),
                found: settings.gripper.stroke.to_string(),
                expected: format!("what the linkage of the URDF opens, {opening:.5} m"),
            });
        }
        Ok(())
    }

    /// Checks that all bodies below a moving joint have mass.
    fn check_masses(&self, model: &RobotModel) -> Result<(), RobotError> {
        let mut mass: Vec<f64> = model
            .links
            .iter()
            .map(|link| link.inertial.map_or(0.0, |inertial| inertial.mass))
            .collect();
        for joint in model.joints.iter().rev() {
            let below = mass[joint.child];
            if joint.kind != JointKind::Fixed && below == 0.0 {
                return Err(self.invalid(
                    format!("link {}", model.links[joint.child].name),
                    "no mass at or below a joint that moves".to_owned(),
                    "an inertial element",
                ));
            }
            // Mass behind a fixed joint is part of the parent.
            if joint.kind == JointKind::Fixed {
                mass[joint.parent] += below;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
