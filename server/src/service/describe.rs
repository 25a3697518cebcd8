//! The robot as a message, from the model in the robot's folder, so that clients
//! contain no numbers of a robot.

use nalgebra::{Isometry3, Vector3};
use wheelarm_proto::{exact, v1};

use super::convert;
use crate::geometry::Shape;
use crate::robot::control::GripperMap;
use crate::robot::{
    FrameRole, Joint, JointKind, JointRole, OutlineSettings, PAD, RecordedJoint, RobotModel,
    ScannerSettings, Settings,
};
use crate::scene::RoomCamera;

/// Outlines by height, bottom up.
fn outlines(outlines: &[OutlineSettings]) -> Vec<v1::Outline> {
    let outline = |outline: &OutlineSettings| v1::Outline {
        top: outline.top,
        footprint: Some(footprint(&outline.footprint)),
    };
    outlines.iter().map(outline).collect()
}

/// Describes a robot with the arm mount exactly as simulated; plans depend on every
/// bit.
#[must_use]
pub fn robot(model: &RobotModel, chair_from_base: &Isometry3<f64>) -> v1::RobotDescription {
    let (settings, roles) = (&model.settings, &model.roles);
    let name = |link: usize| model.links[link].name.clone();
    v1::RobotDescription {
        name: model.name.clone(),
        urdf: model.urdf.clone(),
        urdf_text: model.urdf_text.clone(),
        joints: roles.joints.iter().map(|r| joint(model, r)).collect(),
        frames: roles
            .frames
            .iter()
            .map(|frame| v1::RobotFrame {
                name: frame.name.clone(),
                parent: frame.parent.map_or_else(|| HOUSE.to_owned(), name),
                link: name(frame.link),
                role: frame_role(frame.role).into(),
            })
            .collect(),
        root_link: name(0),
        arm_base_link: name(roles.arm_base),
        end_effector_link: name(roles.end_effector),
        imu_link: name(roles.imu),
        arm_mount: Some(convert::pose(chair_from_base)),
        tool_length: settings.tool_length,
        home_positions: settings.home.to_vec(),
        footprint: Some(footprint(&settings.footprint)),
        outlines: outlines(&settings.outlines),
        travel: settings.travel.as_ref().map(|travel| v1::TravelPosture {
            positions: travel.joints.to_vec(),
            outlines: outlines(&travel.outlines),
        }),
        scanner: settings.scanner.as_ref().map(scanner),
        reach: Some(v1::ReachShell {
            centre: Some(convert::vector(&settings.reach.centre.into())),
            inner_radius: settings.reach.inner_radius,
            outer_radius: settings.reach.outer_radius,
            nearest: settings.reach.nearest,
            furthest: settings.reach.furthest,
        }),
        arm: Some(v1::ArmDescription {
            joint_acceleration: settings.arm.acceleration,
            tool_speed: settings.arm.tool_speed,
            tool_turn_rate: settings.arm.tool_turn_rate,
            tool_acceleration: settings.arm.tool_acceleration,
            tool_turn_acceleration: settings.arm.tool_turn_acceleration,
        }),
        gripper: Some(gripper(model)),
        drive: Some(drive(settings)),
        cameras: settings
            .cameras
            .iter()
            .map(|camera| v1::RobotCamera {
                name: camera.name.clone(),
                link: camera.link.clone(),
                pose: Some(convert::pose(&camera.pose)),
                intrinsics: Some(v1::Intrinsics {
                    width: camera.size[0],
                    height: camera.size[1],
                    fx: camera.focal[0],
                    fy: camera.focal[1],
                    cx: camera.principal[0],
                    cy: camera.principal[1],
                }),
                near: camera.range[0],
                far: camera.range[1],
                mount: mount(model, &camera.link).into(),
            })
            .collect(),
    }
}

fn scanner(settings: &ScannerSettings) -> v1::ScannerDescription {
    let [x, y, z] = settings.at;
    let [least_range, greatest_range] = settings.range;
    v1::ScannerDescription {
        frame: settings.frame.clone(),
        link: settings.link.clone(),
        pose: Some(convert::pose(&Isometry3::translation(x, y, z))),
        first_angle: settings.first_deg.to_radians(),
        angle_step: settings.step_deg.to_radians(),
        rays: settings.rays,
        least_range,
        greatest_range,
    }
}

/// Name of the world frame.
const HOUSE: &str = "house";

fn joint(model: &RobotModel, recorded: &RecordedJoint) -> v1::RobotJoint {
    let joint: &Joint = &model.joints[recorded.joint];
    let limit = |limit: f64| limit.is_finite().then_some(limit);
    let kind = match joint.kind {
        JointKind::Fixed => v1::JointType::Unspecified,
        JointKind::Revolute => v1::JointType::Revolute,
        JointKind::Continuous => v1::JointType::Continuous,
        JointKind::Prismatic => v1::JointType::Prismatic,
    };
    let place = model.roles.arm_index(recorded.joint).unwrap_or_default();
    v1::RobotJoint {
        name: joint.name.clone(),
        role: joint_role(recorded.role).into(),
        arm_index: u32::try_from(place).unwrap_or_default(),
        r#type: kind.into(),
        lower: limit(joint.limits.lower),
        upper: limit(joint.limits.upper),
        max_velocity: joint.limits.velocity,
        max_effort: joint.limits.effort,
        axis: Some(convert::vector(&joint.axis)),
        parent_link: model.links[joint.parent].name.clone(),
        child_link: model.links[joint.child].name.clone(),
        mimic: joint
            .mimic
            .map(|(leader, multiplier, offset)| v1::JointMimic {
                joint: model.joints[leader].name.clone(),
                multiplier,
                offset,
            }),
        origin: Some(convert::pose(&joint.origin)),
    }
}

/// The room camera, at 1280 x 720 pixels.
pub fn room_camera(camera: &RoomCamera) -> v1::RobotCamera {
    let (width, height) = (1280.0, 720.0);
    let focal = width / 2.0 / exact::tan(camera.horizontal_fov / 2.0);
    v1::RobotCamera {
        name: "room".to_owned(),
        link: HOUSE.to_owned(),
        pose: Some(convert::pose(&camera.pose)),
        intrinsics: Some(v1::Intrinsics {
            width: width as u32,
            height: height as u32,
            fx: focal,
            fy: focal,
            cx: width / 2.0,
            cy: height / 2.0,
        }),
        near: 0.05,
        far: 100.0,
        mount: v1::CameraMount::Unspecified.into(),
    }
}

fn gripper(model: &RobotModel) -> v1::GripperDescription {
    let gripper = &model.settings.gripper;
    let map = GripperMap::new(model);
    let poses = model.link_poses(&vec![0.0; model.joints.len()]);
    let along = |joint: usize| {
        let link = model.joints[joint].child;
        poses[model.roles.end_effector]
            .inv_mul(&poses[link])
            .translation
            .z
    };
    let pin_z = along(model.roles.knuckles[0]);
    let tip = model.joints[model.roles.finger_tips[0]].child;
    let pad = model.links[tip].collision.iter().find(|c| c.name == PAD);
    let (pad_z, pad_half) = pad.map_or((0.0, 0.0), |pad| match pad.part.shape {
        Shape::Cuboid { half } => (pad.part.pose.translation.z, half[2]),
        _ => (pad.part.pose.translation.z, 0.0),
    });
    let [crank_x, crank_z] = map.crank();
    let ball = |&[x, y, z, radius]: &[f64; 4]| v1::Ball {
        centre: Some(convert::vector(&Vector3::new(x, y, z))),
        radius,
    };
    v1::GripperDescription {
        stroke: gripper.stroke,
        closed: gripper.closed,
        max_knuckle: map.max_knuckle(),
        max_velocity: gripper.speed,
        usual_force: gripper.force,
        max_force: gripper.max_force,
        linkage: Some(v1::GripperLinkage {
            pin_x: map.pin(),
            pin_z,
            crank_x,
            crank_z,
            pad_x: map.pad(),
            pad_z,
            pad_half,
        }),
        hand_balls: gripper.hand_balls.iter().map(ball).collect(),
        crank_balls: gripper.crank_balls.iter().map(ball).collect(),
        tip_balls: gripper.tip_balls.iter().map(ball).collect(),
    }
}

fn mount(model: &RobotModel, link: &str) -> v1::CameraMount {
    let link = model.link(link).unwrap_or_default();
    match model.chain(model.roles.arm_base, link) {
        Some(_) => v1::CameraMount::Arm,
        None => v1::CameraMount::Chair,
    }
}

fn drive(settings: &Settings) -> v1::DriveDescription {
    let drive = &settings.drive;
    v1::DriveDescription {
        track: drive.track,
        wheel_radius: drive.wheel_radius,
        forward_speed: drive.forward_speed.min(drive.hard_forward_speed),
        backward_speed: drive.backward_speed.min(drive.hard_backward_speed),
        turn_rate: drive.turn_speed.min(drive.hard_turn_speed),
        forward_acceleration: drive.forward_acceleration,
        forward_deceleration: drive.forward_deceleration,
        backward_acceleration: drive.backward_acceleration,
        backward_deceleration: drive.backward_deceleration,
        turn_acceleration: drive.turn_acceleration,
        turn_deceleration: drive.turn_deceleration,
    }
}

fn footprint(&[x_min, x_max, y_min, y_max]: &[f64; 4]) -> v1::Footprint {
    v1::Footprint {
        x_min,
        x_max,
        y_min,
        y_max,
    }
}

fn joint_role(role: JointRole) -> v1::JointRole {
    match role {
        JointRole::WheelLeft => v1::JointRole::WheelLeft,
        JointRole::WheelRight => v1::JointRole::WheelRight,
        JointRole::CasterLeft => v1::JointRole::CasterLeft,
        JointRole::CasterRight => v1::JointRole::CasterRight,
        JointRole::Arm => v1::JointRole::Arm,
        JointRole::Knuckle => v1::JointRole::Knuckle,
        JointRole::KnuckleRight => v1::JointRole::KnuckleRight,
        JointRole::FingerTipLeft => v1::JointRole::FingerTipLeft,
        JointRole::FingerTipRight => v1::JointRole::FingerTipRight,
        JointRole::InnerKnuckleLeft => v1::JointRole::InnerKnuckleLeft,
        JointRole::InnerKnuckleRight => v1::JointRole::InnerKnuckleRight,
        JointRole::Other => v1::JointRole::Unspecified,
    }
}

fn frame_role(role: FrameRole) -> v1::FrameRole {
    match role {
        FrameRole::Chair => v1::FrameRole::Chair,
        FrameRole::ArmLink => v1::FrameRole::ArmLink,
        FrameRole::EndEffector => v1::FrameRole::EndEffector,
        FrameRole::Other => v1::FrameRole::Unspecified,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use wheelarm_proto::robot::Roles;

    #[test]
    fn the_description_matches_the_simulated_robot() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = RobotModel::load(&assets, "wheelarm").unwrap();
        let described = robot(&model, &model.arm_mount());
        let roles = Roles::find(&described).unwrap();
        for (place, &index) in roles.arm.iter().enumerate() {
            let joint = &model.joints[model.roles.arm[place]];
            assert_eq!(described.joints[index].name, joint.name);
            assert_eq!(described.joints[index].max_velocity, joint.limits.velocity);
        }
        assert_eq!(described.frames[roles.chair].parent, HOUSE);
        assert_eq!(
            described.frames[roles.end_effector].parent,
            described.arm_base_link
        );
        // Server and clients map openings identically.
        let map = GripperMap::new(&model);
        for step in 0..=16 {
            let knuckle = 0.05 * f64::from(step);
            let opening = described.opening(knuckle).unwrap();
            assert!((opening - map.opening(knuckle)).abs() < 1e-15, "{knuckle}");
            let linkage = described.gripper_or_default().linkage.unwrap();
            assert!((linkage.knuckle(opening) - map.knuckle(opening)).abs() < 1e-12);
        }
    }
}
