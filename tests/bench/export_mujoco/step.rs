//! Robot, furniture and objects to be simulated: the same masses, joints, gains,
//! collision shapes and pairs as in our world. Front wheels are frictionless
//! balls and inner knuckles ride on the hand, as ours do.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use wheelarm_server::geometry::{Part, Shape};
use wheelarm_server::robot::control::GripperMap;
use wheelarm_server::robot::{ArmSettings, JointKind, PAD, RobotModel};

use super::course::{CONTROL_TICKS, Course};
use super::{numbers, place, write_numbers};

/// Bits of who collides with whom: chair, arm links by depth, floor, rest.
const CHAIR: u32 = 1;
const FLOOR: u32 = 1 << 20;
const REST: u32 = 1 << 21;
const DEEPEST: u32 = 15;

pub fn export(out: &Path, assets: &Path) -> Result<()> {
    let course = Course::load(assets)?;
    let mut mjcf = Mjcf::default();
    mjcf.furniture(&course)?;
    mjcf.objects(&course)?;
    mjcf.link(&course.robot, 0, &course.start, None)?;
    std::fs::write(out.join("step.xml"), mjcf.document(&course.robot)?)?;
    write_numbers(&out.join("targets.f64"), &targets(&course)?)
}

/// Arm, wheels, left and right crank for each tick.
fn targets(course: &Course) -> Result<Vec<f64>> {
    let (mut world, mut control) = (course.world()?, course.control());
    let mut all = Vec::new();
    for control_tick in 0..CONTROL_TICKS {
        for target in &control.update(&course.input(control_tick), &world.snapshot()) {
            world.apply(target);
            world.step();
            all.extend(target.arm_position);
            all.extend(target.wheel_velocity);
            all.extend([target.knuckle_position, -target.knuckle_position]);
        }
    }
    Ok(all)
}

#[derive(Default)]
struct Mjcf {
    assets: String,
    bodies: String,
    meshes: usize,
}

impl Mjcf {
    fn furniture(&mut self, course: &Course) -> Result<()> {
        for (index, body) in course.scene.furniture.iter().enumerate() {
            let own = if index == 0 { FLOOR } else { REST };
            writeln!(
                self.bodies,
                "<body name=\"{}\" {}>",
                body.name,
                place(&body.pose)
            )?;
            let look = format!(
                "contype=\"{own}\" conaffinity=\"2147483647\" friction=\"{} 0.005 0.0001\"",
                body.friction
            );
            for part in &body.collision {
                self.solid(part, &look)?;
            }
            for hull in &body.hulls {
                self.hull(hull, &look)?;
            }
            self.bodies.push_str("</body>\n");
        }
        Ok(())
    }

    fn objects(&mut self, course: &Course) -> Result<()> {
        for (body, placement) in course.scene.objects.iter().zip(&course.placements) {
            let mass = body.mass.context("objects have a mass")?;
            writeln!(
                self.bodies,
                "<body name=\"{}\" {}><freejoint/>\n{}",
                body.name,
                place(&placement.pose),
                inertial(
                    placement.mass,
                    &mass.com,
                    &(mass.inertia * (placement.mass / mass.mass))
                )
            )?;
            let look = format!(
                "contype=\"{REST}\" conaffinity=\"2147483647\" friction=\"{} 0.005 0.0001\"",
                placement.friction
            );
            for part in &body.collision {
                self.solid(part, &look)?;
            }
            for hull in &body.hulls {
                self.hull(hull, &look)?;
            }
            self.bodies.push_str("</body>\n");
        }
        Ok(())
    }

    /// A link with everything that hangs on it.
    fn link(
        &mut self,
        robot: &RobotModel,
        index: usize,
        origin: &Isometry3<f64>,
        depth: Option<u32>,
    ) -> Result<()> {
        let link = &robot.links[index];
        let depth = if link.name == robot.settings.arm_base_link {
            Some(0)
        } else {
            depth
        };
        let lift = if depth.is_some() {
            "gravcomp=\"1\""
        } else {
            ""
        };
        writeln!(
            self.bodies,
            "<body name=\"{}\" {} {lift}>",
            link.name,
            place(origin)
        )?;
        let roles = &robot.roles;
        let number = index.checked_sub(1);
        let joint = number.map(|j| &robot.joints[j]);
        let is_of = |list: &[usize]| number.is_some_and(|j| list.contains(&j));
        let wheel = number.and_then(|j| {
            let wheels = roles.wheels.iter().chain(&roles.casters);
            wheels.copied().position(|wheel| wheel == j)
        });
        let mut touches = true;
        match joint {
            None => self.bodies.push_str("<freejoint/>\n"),
            Some(_) if is_of(&roles.inner_knuckles) => touches = false,
            Some(joint) if joint.kind == JointKind::Fixed || wheel.is_some_and(|w| w >= 2) => {}
            Some(joint) => {
                let range = if joint.kind == JointKind::Revolute && joint.mimic.is_none() {
                    format!(
                        "limited=\"true\" range=\"{} {}\"",
                        joint.limits.lower, joint.limits.upper
                    )
                } else {
                    String::new()
                };
                let armature = if is_of(&roles.knuckles) {
                    robot.settings.gripper.knuckle_armature
                } else {
                    0.0
                };
                writeln!(
                    self.bodies,
                    "<joint name=\"{}\" type=\"hinge\" axis=\"{}\" armature=\"{armature}\" {range}/>",
                    joint.name,
                    numbers(joint.axis.iter())
                )?;
            }
        }
        if let Some(own) = &link.inertial {
            writeln!(
                self.bodies,
                "{}",
                inertial(own.mass, &own.com, &own.inertia)
            )?;
        }
        let settings = &robot.settings;
        let (own, others) = groups(depth, &settings.arm);
        let shell = format!("friction=\"{} 0.005 0.0001\"", settings.shell_friction);
        for collider in link.collision.iter().filter(|_| touches) {
            let bits = |others: u32| format!("contype=\"{own}\" conaffinity=\"{others}\"");
            if let (Some(wheel), Shape::Cylinder { radius, .. }) = (wheel, &collider.part.shape) {
                let ball = Part {
                    pose: collider.part.pose,
                    shape: Shape::Sphere { radius: *radius },
                };
                let tread = if wheel < 2 {
                    format!("friction=\"{} 0.005 0.0001\"", settings.drive.tyre_friction)
                } else {
                    format!(
                        "friction=\"{} 0 0\" condim=\"1\" priority=\"1\"",
                        settings.drive.caster_friction
                    )
                };
                // Collides with the floor alone: no other geometry has its bit.
                self.solid(
                    &ball,
                    &format!("contype=\"0\" conaffinity=\"{FLOOR}\" {tread}"),
                )?;
                self.solid(
                    &collider.part,
                    &format!("{} {shell}", bits(others & !FLOOR)),
                )?;
            } else if collider.name == PAD {
                self.solid(
                    &collider.part,
                    &format!(
                        "{} friction=\"0.6 0.005 0.0001\" priority=\"1\"",
                        bits(others)
                    ),
                )?;
            } else {
                self.solid(&collider.part, &format!("{} {shell}", bits(others)))?;
            }
        }
        for joint in robot.joints.iter().filter(|j| j.parent == index) {
            let moves = u32::from(joint.kind != JointKind::Fixed);
            self.link(robot, joint.child, &joint.origin, depth.map(|d| d + moves))?;
        }
        self.bodies.push_str("</body>\n");
        Ok(())
    }

    fn solid(&mut self, part: &Part, look: &str) -> Result<()> {
        let (kind, size) = match &part.shape {
            Shape::Cuboid { half } | Shape::RoundedCuboid { half, .. } => ("box", numbers(half)),
            Shape::Cylinder {
                radius,
                half_height,
            } => ("cylinder", numbers([radius, half_height])),
            Shape::Capsule {
                radius,
                half_height,
            } => ("capsule", numbers([radius, half_height])),
            Shape::Sphere { radius } => ("sphere", numbers([radius])),
            Shape::Frustum {
                bottom_radius,
                top_radius,
                half_height,
            } => {
                let mut points = ring(24, *bottom_radius, -half_height);
                points.extend(ring(24, *top_radius, *half_height));
                return self.mesh(&points, &part.pose, look);
            }
            Shape::Cup {
                bottom_radius,
                top_radius,
                height,
                wall,
            } => {
                let radius = |z: f64| bottom_radius + (top_radius - bottom_radius) * z / height;
                let mut floor = ring(16, *bottom_radius, 0.0);
                floor.extend(ring(16, radius(*wall), *wall));
                self.mesh(&floor, &part.pose, look)?;
                let foot = wall.min(0.002);
                let rings = [
                    (radius(foot), foot),
                    (radius(foot) - wall, foot),
                    (*top_radius, *height),
                    (top_radius - wall, *height),
                ]
                .map(|(r, z)| ring(16, r, z));
                for i in 0..16 {
                    let corners: Vec<_> =
                        rings.iter().flat_map(|r| [r[i], r[(i + 1) % 16]]).collect();
                    self.mesh(&corners, &part.pose, look)?;
                }
                return Ok(());
            }
            Shape::Lathe { .. }
            | Shape::Prism { .. }
            | Shape::PackedMesh { .. }
            | Shape::Mesh { .. } => {
                anyhow::bail!("{:?} does not collide", part.shape)
            }
        };
        writeln!(
            self.bodies,
            "<geom type=\"{kind}\" size=\"{size}\" {} {look}/>",
            place(&part.pose)
        )?;
        Ok(())
    }

    fn hull(&mut self, points: &[Point3<f64>], look: &str) -> Result<()> {
        let points: Vec<_> = points.iter().map(|p| p.coords).collect();
        self.mesh(&points, &Isometry3::identity(), look)
    }

    /// The convex hull of points.
    fn mesh(&mut self, points: &[Vector3<f64>], pose: &Isometry3<f64>, look: &str) -> Result<()> {
        let name = self.meshes;
        self.meshes += 1;
        let vertices = numbers(points.iter().flat_map(|p| [p.x, p.y, p.z]));
        writeln!(
            self.assets,
            "<mesh name=\"h{name}\" vertex=\"{vertices}\"/>"
        )?;
        writeln!(
            self.bodies,
            "<geom type=\"mesh\" mesh=\"h{name}\" {} {look}/>",
            place(pose)
        )?;
        Ok(())
    }

    fn document(&self, robot: &RobotModel) -> Result<String> {
        let mut xml = format!(
            "<mujoco>\n<compiler angle=\"radian\" fusestatic=\"true\"/>\n\
             <option timestep=\"{}\" integrator=\"implicitfast\" cone=\"elliptic\" impratio=\"10\"/>\n\
             <default><geom mass=\"0\"/></default>\n\
             <asset>\n{}</asset>\n<worldbody>\n{}</worldbody>\n<equality>\n",
            1.0 / 240.0,
            self.assets,
            self.bodies
        );
        let roles = &robot.roles;
        let joints = robot.joints.iter().enumerate();
        for (_, joint) in joints.filter(|(j, _)| !roles.inner_knuckles.contains(j)) {
            if let Some((leader, multiplier, offset)) = joint.mimic {
                writeln!(
                    xml,
                    "<joint joint1=\"{}\" joint2=\"{}\" polycoef=\"{offset} {multiplier} 0 0 0\" \
                     solref=\"0.0084 1\" solimp=\"0.99 0.999 0.001\"/>",
                    joint.name, robot.joints[leader].name
                )?;
            }
        }
        xml.push_str("</equality>\n<actuator>\n");
        let settings = &robot.settings;
        for (i, &joint) in roles.arm.iter().enumerate() {
            let joint = &robot.joints[joint];
            let torque = joint.limits.effort;
            xml.push_str(&position(
                &joint.name,
                settings.arm.stiffness[i],
                settings.arm.damping[i],
                torque,
            ));
        }
        for &wheel in &roles.wheels {
            let name = &robot.joints[wheel].name;
            let (damping, torque) = (settings.drive.wheel_damping, settings.drive.wheel_torque);
            writeln!(
                xml,
                "<velocity joint=\"{name}\" kv=\"{damping}\" forcerange=\"-{torque} {torque}\"/>"
            )?;
        }
        let torque = settings.gripper.force * GripperMap::new(robot).lever(0.4);
        for &knuckle in &roles.knuckles {
            let name = &robot.joints[knuckle].name;
            let gripper = &settings.gripper;
            xml.push_str(&position(name, gripper.stiffness, gripper.damping, torque));
        }
        xml.push_str("</actuator>\n</mujoco>\n");
        Ok(xml)
    }
}

fn position(joint: &str, stiffness: f64, damping: f64, torque: f64) -> String {
    format!(
        "<position joint=\"{joint}\" kp=\"{stiffness}\" kv=\"{damping}\" forcerange=\"-{torque} {torque}\"/>\n"
    )
}

fn inertial(mass: f64, com: &Point3<f64>, m: &Matrix3<f64>) -> String {
    format!(
        "<inertial mass=\"{mass}\" pos=\"{}\" fullinertia=\"{}\"/>",
        numbers(com.iter()),
        numbers([
            m[(0, 0)],
            m[(1, 1)],
            m[(2, 2)],
            m[(0, 1)],
            m[(0, 2)],
            m[(1, 2)]
        ])
    )
}

/// Own bit and those of others: as the collision groups of our world.
fn groups(depth: Option<u32>, settings: &ArmSettings) -> (u32, u32) {
    let arm = |d: u32| CHAIR << (1 + d.min(DEEPEST));
    let (own, others) = match depth {
        None => (
            CHAIR,
            (settings.chair_contact_joints..=DEEPEST).map(arm).sum(),
        ),
        Some(depth) => {
            let touches_chair = depth >= settings.chair_contact_joints;
            let chair = if touches_chair { CHAIR } else { 0 };
            let far = (0..=DEEPEST)
                .filter(|d| d.abs_diff(depth) >= settings.self_contact_joints)
                .map(arm)
                .sum::<u32>();
            (arm(depth), chair | far)
        }
    };
    (own, others | FLOOR | REST)
}

/// Corners of a regular polygon whose area is that of the circle.
fn ring(sides: usize, radius: f64, z: f64) -> Vec<Vector3<f64>> {
    let step = TAU / sides as f64;
    let corner = radius * (step / step.sin()).sqrt();
    (0..sides)
        .map(|i| step * i as f64)
        .map(|a| Vector3::new(corner * a.cos(), corner * a.sin(), z))
        .collect()
}
