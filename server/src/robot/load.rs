//! URDF and `robot.toml` become a validated [`RobotModel`].
//!
//! All doubt ends here: what loads has every joint and link that the rest of
//! the server names, sane limits and possible inertias.

use std::path::{Path, PathBuf};

use nalgebra::{Cholesky, Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use wheelarm_proto::names::{FRAMES, JOINT_NAMES};

use super::settings::{File, Settings};
use super::{Collider, Inertial, Joint, JointKind, Limits, Link, PAD, RobotModel};
use crate::geometry::{Material, Part, Shape, Visual};

/// Why a robot did not load.
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
    /// `robot.toml` is malformed.
    #[error("{path}: {source}")]
    Toml {
        /// File.
        path: PathBuf,
        /// Cause, with line and column.
        source: Box<toml::de::Error>,
    },
    /// The URDF is malformed.
    #[error("{path}: {source}")]
    Urdf {
        /// File.
        path: PathBuf,
        /// Cause.
        source: Box<urdf_rs::UrdfError>,
    },
    /// Something that the server names is not there.
    #[error("{path} has no {kind} `{name}`, which {user}; add it")]
    Missing {
        /// File.
        path: PathBuf,
        /// `link`, `joint`, `collision element`, ….
        kind: &'static str,
        /// Name.
        name: String,
        /// Who needs it.
        user: &'static str,
    },
    /// Something is there that cannot be.
    #[error("{path}: {object}: {found}, expected {expected}")]
    Invalid {
        /// File.
        path: PathBuf,
        /// Link, joint or setting.
        object: String,
        /// What was found.
        found: String,
        /// What would be right.
        expected: String,
    },
}

impl RobotModel {
    /// Reads and checks `robots/NAME/robot.toml` below the assets folder and
    /// the URDF beside it.
    ///
    /// # Errors
    /// A [`RobotError`] that names the file, the object, what was found and
    /// what would be right.
    pub fn load(assets_dir: &Path, name: &str) -> Result<RobotModel, RobotError> {
        let folder = format!("robots/{name}");
        let toml_path = assets_dir.join(&folder).join("robot.toml");
        let text = read(&toml_path)?;
        let file: File = toml::from_str(&text).map_err(|source| RobotError::Toml {
            path: toml_path.clone(),
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
            toml: &toml_path,
            file: &file,
            robot: &robot,
        };
        reader.model()
    }
}

fn read(path: &Path) -> Result<String, RobotError> {
    std::fs::read_to_string(path).map_err(|source| RobotError::Read {
        path: path.to_owned(),
        source,
    })
}

/// The two files while they are turned into a model.
struct Reader<'a> {
    assets_dir: &'a Path,
    folder: &'a str,
    urdf: &'a Path,
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
        let mut model = RobotModel {
            links,
            joints,
            settings,
        };
        self.resolve_mimics(&mut model)?;
        self.check_names(&model)?;
        self.check_masses(&model)?;
        Ok(model)
    }

    /// Links and joints with parents before children, in the order of the file.
    fn tree(&self) -> Result<(Vec<Link>, Vec<Joint>), RobotError> {
        let robot = self.robot;
        let is_child = |name: &str| robot.joints.iter().any(|joint| joint.child.link == name);
        let roots: Vec<&str> = robot
            .links
            .iter()
            .map(|link| link.name.as_str())
            .filter(|name| !is_child(name))
            .collect();
        let root_name = FRAMES[0].link;
        if roots != [root_name] {
            return Err(self.invalid(
                "root link".to_owned(),
                roots.join(", "),
                &format!("exactly one, {root_name}"),
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
        // Depth first: the stack holds (parent index, joint).
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

    fn link(&self, link: &urdf_rs::Link) -> Result<Link, RobotError> {
        let object = || format!("link {}", link.name);
        let mut collision: Vec<Collider> = Vec::new();
        for element in &link.collision {
            let name = element.name.clone().unwrap_or_else(|| {
                if collision.is_empty() {
                    "body".to_owned()
                } else {
                    format!("body_{}", collision.len())
                }
            });
            if collision.iter().any(|other| other.name == name) {
                return Err(self.invalid(
                    object(),
                    format!("two collision elements named {name}"),
                    "names that differ",
                ));
            }
            collision.push(Collider {
                name,
                part: self.part(&object(), &element.origin, &element.geometry)?,
            });
        }
        let visual = link
            .visual
            .iter()
            .map(|element| {
                Ok(Visual {
                    part: self.part(&object(), &element.origin, &element.geometry)?,
                    material: self.material(&object(), element.material.as_ref())?,
                })
            })
            .collect::<Result<_, RobotError>>()?;
        Ok(Link {
            name: link.name.clone(),
            inertial: self.inertial(&object(), &link.inertial)?,
            collision,
            visual,
        })
    }

    fn inertial(
        &self,
        object: &str,
        inertial: &urdf_rs::Inertial,
    ) -> Result<Option<Inertial>, RobotError> {
        let mass = inertial.mass.value;
        if mass == 0.0 {
            return Ok(None);
        }
        if !(mass.is_finite() && mass > 0.0) {
            return Err(self.invalid(
                object.to_owned(),
                format!("mass {mass} kg"),
                "a positive mass, or no inertial element for a frame",
            ));
        }
        let i = &inertial.inertia;
        let about_axes = Matrix3::new(
            i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz,
        );
        let pose = isometry(&inertial.origin);
        let turn = pose.rotation.to_rotation_matrix();
        let inertia = turn * about_axes * turn.transpose();
        // A body of positive mass also obeys the triangle inequality: the
        // matrix trace/2 - I (the second moments) is positive definite too.
        let moments = Matrix3::identity() * (inertia.trace() / 2.0) - inertia;
        if Cholesky::new(inertia).is_none() || Cholesky::new(moments).is_none() {
            return Err(self.invalid(
                object.to_owned(),
                format!("inertia {about_axes:?} kg·m²"),
                "a positive definite inertia whose moments obey the triangle inequality",
            ));
        }
        Ok(Some(Inertial {
            mass,
            com: Point3::from(pose.translation.vector),
            inertia,
        }))
    }

    fn part(
        &self,
        object: &str,
        origin: &urdf_rs::Pose,
        geometry: &urdf_rs::Geometry,
    ) -> Result<Part, RobotError> {
        let shape = match geometry {
            urdf_rs::Geometry::Box { size } => Shape::Cuboid {
                half: size.0.map(|edge| edge / 2.0),
            },
            urdf_rs::Geometry::Cylinder { radius, length } => Shape::Cylinder {
                radius: *radius,
                half_height: length / 2.0,
            },
            urdf_rs::Geometry::Capsule { radius, length } => Shape::Capsule {
                radius: *radius,
                half_height: length / 2.0,
            },
            urdf_rs::Geometry::Sphere { radius } => Shape::Sphere { radius: *radius },
            urdf_rs::Geometry::Mesh { filename, scale } => self.mesh(object, filename, scale)?,
        };
        let sizes = match &shape {
            Shape::Cuboid { half } => half.to_vec(),
            Shape::Cylinder {
                radius,
                half_height,
            }
            | Shape::Capsule {
                radius,
                half_height,
            } => vec![*radius, *half_height],
            Shape::Sphere { radius } => vec![*radius],
            Shape::Mesh { scale, .. } => vec![*scale],
            _ => Vec::new(),
        };
        if sizes.iter().any(|size| !(size.is_finite() && *size > 0.0)) {
            return Err(self.invalid(
                object.to_owned(),
                format!("geometry {geometry:?}"),
                "positive sizes",
            ));
        }
        Ok(Part {
            pose: isometry(origin),
            shape,
        })
    }

    fn mesh(
        &self,
        object: &str,
        filename: &str,
        scale: &Option<urdf_rs::Vec3>,
    ) -> Result<Shape, RobotError> {
        let [x, y, z] = scale.map_or([1.0; 3], |scale| scale.0);
        if x != y || y != z {
            return Err(self.invalid(
                object.to_owned(),
                format!("mesh scale {x} {y} {z}"),
                "the same scale along all axes",
            ));
        }
        if filename.contains("://") || Path::new(filename).is_absolute() {
            return Err(self.invalid(
                object.to_owned(),
                format!("mesh {filename}"),
                "a path relative to the URDF",
            ));
        }
        let path = format!("{}/{filename}", self.folder);
        if !self.assets_dir.join(&path).is_file() {
            return Err(self.invalid(
                object.to_owned(),
                format!("mesh {filename}, which is not there"),
                "a file below the robot's folder",
            ));
        }
        Ok(Shape::Mesh { path, scale: x })
    }

    fn material(
        &self,
        object: &str,
        material: Option<&urdf_rs::Material>,
    ) -> Result<Material, RobotError> {
        let name = material.map_or("default", |material| material.name.as_str());
        let color = material
            .and_then(|material| material.color.as_ref())
            .or_else(|| {
                self.robot
                    .materials
                    .iter()
                    .find(|material| material.name == name)
                    .and_then(|material| material.color.as_ref())
            });
        let [red, green, blue, _] = match color {
            Some(color) => color.rgba.0,
            None if material.is_none() => [0.6, 0.6, 0.6, 1.0],
            None => {
                return Err(self.invalid(
                    object.to_owned(),
                    format!("material {name} without colour"),
                    "a material element with a colour",
                ));
            }
        };
        let (roughness, metallic) = self
            .file
            .material
            .get(name)
            .map_or((0.6, 0.0), |surface| (surface.roughness, surface.metallic));
        Ok(Material {
            name: name.to_owned(),
            color: [red as f32, green as f32, blue as f32],
            roughness,
            metallic,
            emission: 0.0,
            texture: None,
        })
    }

    fn joint(
        &self,
        joint: &urdf_rs::Joint,
        parent: usize,
        child: usize,
    ) -> Result<Joint, RobotError> {
        let object = || format!("joint {}", joint.name);
        let kind = match joint.joint_type {
            urdf_rs::JointType::Fixed => JointKind::Fixed,
            urdf_rs::JointType::Revolute => JointKind::Revolute,
            urdf_rs::JointType::Continuous => JointKind::Continuous,
            urdf_rs::JointType::Prismatic => JointKind::Prismatic,
            ref other => {
                return Err(self.invalid(
                    object(),
                    format!("type {other:?}"),
                    "fixed, revolute, continuous or prismatic",
                ));
            }
        };
        let axis = Vector3::from(joint.axis.xyz.0);
        let axis = Unit::try_new(axis, 1e-9)
            .ok_or_else(|| self.invalid(object(), format!("axis {axis:?}"), "a non-zero axis"))?;
        let limit = &joint.limit;
        let limits = match kind {
            JointKind::Fixed => Limits {
                lower: 0.0,
                upper: 0.0,
                velocity: 0.0,
                effort: 0.0,
            },
            JointKind::Continuous => Limits {
                lower: f64::NEG_INFINITY,
                upper: f64::INFINITY,
                velocity: limit.velocity,
                effort: limit.effort,
            },
            JointKind::Revolute | JointKind::Prismatic => Limits {
                lower: limit.lower,
                upper: limit.upper,
                velocity: limit.velocity,
                effort: limit.effort,
            },
        };
        let sane = kind == JointKind::Fixed
            || (limits.lower < limits.upper && limits.velocity > 0.0 && limits.effort >= 0.0);
        if !sane {
            return Err(self.invalid(
                object(),
                format!("limits {limits:?}"),
                "lower below upper, a positive velocity and an effort of 0 or more",
            ));
        }
        Ok(Joint {
            name: joint.name.clone(),
            kind,
            parent,
            child,
            origin: isometry(&joint.origin),
            axis,
            limits,
            mimic: None,
        })
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

    /// Everything that the server names by name is there, once.
    fn check_names(&self, model: &RobotModel) -> Result<(), RobotError> {
        for name in JOINT_NAMES {
            let Some(joint) = model.joint(name) else {
                return Err(self.missing("joint", name, "is recorded"));
            };
            if model.joints[joint].kind == JointKind::Fixed {
                return Err(self.invalid(
                    format!("joint {name}"),
                    "type fixed".to_owned(),
                    "a joint that moves",
                ));
            }
        }
        for frame in FRAMES {
            for link in [frame.parent, frame.link] {
                if link != "house" && model.link(link).is_none() {
                    return Err(self.missing("link", link, "is recorded"));
                }
            }
        }
        let Settings {
            cameras,
            imu_link,
            end_effector_link,
            arm_base_link,
            ..
        } = &model.settings;
        let named = cameras.iter().map(|camera| &camera.link).chain([
            imu_link,
            end_effector_link,
            arm_base_link,
        ]);
        for link in named {
            if model.link(link).is_none() {
                return Err(self.missing("link", link, "robot.toml names"));
            }
        }
        for side in ["left", "right"] {
            let name = format!("robotiq_85_{side}_finger_tip_joint");
            let has_pad = model.joint(&name).is_some_and(|joint| {
                let tip = &model.links[model.joints[joint].child];
                tip.collision.iter().any(|collider| {
                    collider.name == PAD && matches!(collider.part.shape, Shape::Cuboid { .. })
                })
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
        let twice = repeated(model.joints.iter().map(|joint| &joint.name).collect())
            .or_else(|| repeated(model.links.iter().map(|link| &link.name).collect()));
        match twice {
            Some(name) => Err(self.invalid(name, "two of this name".to_owned(), "one")),
            None => Ok(()),
        }
    }

    /// What hangs below a moving joint weighs something.
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
            // Mass behind a fixed joint belongs to the parent.
            if joint.kind == JointKind::Fixed {
                mass[joint.parent] += below;
            }
        }
        Ok(())
    }
}

/// parent_from_origin of a URDF origin element: R = Rz(yaw) Ry(pitch) Rx(roll).
fn isometry(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(pose.xyz.0)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

#[cfg(test)]
mod tests;
