//! Single URDF elements: link, inertial, geometry, material, joint.

use std::path::Path;

use nalgebra::{Cholesky, Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use super::{Reader, RobotError};
use crate::geometry::{Material, Part, Shape, Texture, Visual};
use crate::robot::{Collider, Inertial, Joint, JointKind, Limits, Link};

impl Reader<'_> {
    pub(super) fn link(&self, link: &urdf_rs::Link) -> Result<Link, RobotError> {
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
        // A physical inertia also obeys the triangle inequality: the matrix trace/2 - I
        // (the second moments) is positive definite too.
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
        let surface = self.file.material.get(name);
        Ok(Material {
            name: name.to_owned(),
            color: [red as f32, green as f32, blue as f32],
            roughness: surface.map_or(0.6, |surface| surface.roughness),
            metallic: surface.map_or(0.0, |surface| surface.metallic),
            emission: 0.0,
            family: None,
            transmission: 0.0,
            texture: surface
                .and_then(|surface| surface.texture.as_ref())
                .map(|texture| Texture {
                    pattern: texture.pattern.clone(),
                    metres: texture.metres,
                    file: None,
                }),
        })
    }

    pub(super) fn joint(
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
}

/// parent_from_origin of a URDF origin element: R = Rz(yaw) Ry(pitch) Rx(roll).
fn isometry(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(pose.xyz.0)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}
