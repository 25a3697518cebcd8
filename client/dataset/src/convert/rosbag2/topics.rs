//! Which topics a recording becomes. Names and frames are those of the bridge to
//! ROS 2 where it has the topic too; commands are below `/applied`,
//! where a played bag does not move a robot.

use std::sync::Arc;

use wheelarm_proto::{TopicId, v1};

use super::channel::{Channel, posed, transform};
use super::furniture;
use super::words::Words;
use crate::convert::Recording;
use crate::convert::links::{self, Descriptions};
use crate::convert::ros2::{
    CameraInfo, Clock, Image, Imu, JointState, LaserScan, Odometry, PointCloud2, PoseStamped,
    TFMessage, Text, TwistStamped,
};
use crate::pose::{self, Pose};
use crate::read::{Camera, Samples};
use crate::urdf::{self, Robot};
use crate::{depth, ids};

/// The world frame, root of all poses.
const WORLD: &str = "house";
/// Frame in which wheel odometry counts.
const ODOMETRY: &str = "odom";

/// Topic of a camera's colour.
pub(super) fn colour(camera: &str) -> String {
    format!("/camera/{}/color/image_raw", word(camera))
}

/// A name as a part of a topic: letters, digits and underscores, and an `n`
/// before a digit that would be the first.
fn word(name: &str) -> String {
    let digit = name.starts_with(|c: char| c.is_ascii_digit());
    let letters = name.chars().map(|c| match c {
        c if c.is_ascii_alphanumeric() => c,
        _ => '_',
    });
    let start = if digit { "n" } else { "" };
    start.chars().chain(letters).collect()
}

fn optical_frame(name: &str) -> String {
    format!("{name}_optical_frame")
}

/// Every channel of a recording that has a message.
pub(super) fn channels<'a>(
    recording: &'a Recording,
    described: &'a Descriptions,
    start: &v1::SnapshotReply,
) -> anyhow::Result<Vec<Channel<'a>>> {
    // At one stamp the clock is first, for readers that use it.
    let mut out = Vec::new();
    let clock = recording.episode.stamps(TopicId::Clock.name())?;
    out.push(Channel::of("/clock", &clock, |_, stamp| Ok(Clock(stamp))));
    once(&mut out, recording, described, start)?;
    for topic in TopicId::ALL {
        if topic == TopicId::Event || recording.episode.has(topic.name()) {
            of_topic(&mut out, topic, recording, described)?;
        }
    }
    for (name, camera) in &recording.cameras {
        images(&mut out, recording, name, camera);
    }
    for (name, sensor) in &recording.sensors {
        images(&mut out, recording, name, sensor);
    }
    out.retain(|channel| !channel.stamps.is_empty());
    Ok(out)
}

/// Messages for the whole episode.
fn once(
    out: &mut Vec<Channel<'_>>,
    recording: &Recording,
    described: &Descriptions,
    start: &v1::SnapshotReply,
) -> anyhow::Result<()> {
    let stamp = recording.summary.span_nanos.0;
    let joints = described.still(recording)?.into_iter();
    let joints = joints.map(|j| transform(stamp, &j.parent, &j.child, j.pose(0.0)));
    let mut still: Vec<_> = joints.collect();
    if let Some(pose) = odometry_in_world(recording)? {
        still.push(transform(stamp, WORLD, ODOMETRY, pose));
    }
    if let Some(scanner) = recording.scanner() {
        let pose = pose::of_message(scanner.pose.as_ref());
        still.push(transform(stamp, &scanner.link, &scanner.frame, pose));
    }
    if !still.is_empty() {
        out.push(Channel::latched("/tf_static", stamp, &TFMessage(still)));
    }
    if let Some(drawn) = urdf::text(&start.assets).and_then(|t| urdf::without_meshes(t).ok()) {
        out.push(Channel::latched("/robot_description", stamp, &Text(drawn)));
    }
    if described.furniture.is_some() {
        let text = Text(start.furniture_urdf.clone());
        out.push(Channel::latched("/furniture_description", stamp, &text));
    }
    let instruction = Text(recording.summary.instruction.clone());
    out.push(Channel::latched("/instruction", stamp, &instruction));
    let legend = start.instances.iter();
    let legend = legend.map(|i| (i.id.to_string(), i.name.clone().into()));
    let legend = serde_json::Value::Object(legend.collect());
    out.push(Channel::latched(
        "/instance_ids",
        stamp,
        &Text(legend.to_string()),
    ));
    Ok(())
}

/// Pose of the odometry's frame in the world: it counts from a place that is
/// not recorded, which follows from the first sample. `None` without one.
fn odometry_in_world(recording: &Recording) -> anyhow::Result<Option<Pose>> {
    let episode = &recording.episode;
    let [odometry, poses] = [TopicId::Odometry, TopicId::Pose].map(TopicId::name);
    if !episode.has(odometry) || !episode.has(poses) {
        return Ok(None);
    }
    let (odometry, poses) = (episode.samples(odometry)?, episode.samples(poses)?);
    let mut stamps = odometry.stamps().iter().enumerate();
    let common = stamps.find_map(|(i, stamp)| Some((i, poses.stamps().binary_search(stamp).ok()?)));
    let Some((i, k)) = common else {
        return Ok(None);
    };
    let counted: v1::Odometry = odometry.message(i)?;
    let true_poses: v1::PoseSet = poses.message(k)?;
    let chair = true_poses.frames.get(recording.roles.chair);
    let house_from_chair = pose::of_message(chair.and_then(|frame| frame.pose.as_ref()));
    let odometry_from_chair = pose::of_message(counted.pose.as_ref());
    let found = pose::compose(&house_from_chair, &pose::inverse(&odometry_from_chair));
    Ok(found.iter().all(|v| v.is_finite()).then_some(found))
}

/// Messages of a camera, or of a sensor in its place. An image is stamped with its
/// exposure, and is logged at its arrival.
fn images<'a>(
    out: &mut Vec<Channel<'a>>,
    recording: &'a Recording,
    name: &'a str,
    camera: &'a Camera,
) {
    let (episode, frame) = (&recording.episode, optical_frame(name));
    let Some((width, height)) = camera.size() else {
        return;
    };
    let size = (width as u32, height as u32);
    let place = |what: &str| match camera.made_from() {
        None => format!("/camera/{}/{what}", word(name)),
        Some(_) => format!("/sensor/{}", word(name)),
    };
    let exposed = move |i: usize, stamp| camera.exposures().get(i).copied().unwrap_or(stamp);
    let header = frame.clone();
    let image = move |i, stamp, encoding, data| Image {
        stamp: exposed(i, stamp),
        frame: header.clone(),
        width: size.0,
        height: size.1,
        encoding,
        data,
    };
    let mut planes = Vec::new();
    if camera.has_rgb() {
        let (image, place) = (image.clone(), place("color"));
        let make = move |i, stamp| Ok(image(i, stamp, "rgb8", camera.rgb(episode, i)?));
        let topic = format!("{place}/image_raw");
        out.push(Channel::of(topic, camera.stamps(), make));
        planes.push(place);
    }
    if camera.has_depth() {
        let (image, place) = (image.clone(), place("depth"));
        let millimetres = camera.millimetres();
        let make = move |i, stamp| {
            let metres = camera.depth(episode, i)?.into_iter();
            Ok(if millimetres {
                let data = metres.flat_map(|m| depth::millimetres(m).to_le_bytes());
                image(i, stamp, "16UC1", data.collect())
            } else {
                let data = metres.flat_map(f32::to_le_bytes);
                image(i, stamp, "32FC1", data.collect())
            })
        };
        let topic = format!("{place}/image_raw");
        out.push(Channel::of(topic, camera.stamps(), make));
        planes.push(place);
    }
    if camera.made_from().is_none() {
        let bytes = camera.id_bytes();
        let encoding = if bytes == 2 { "16UC1" } else { "8UC1" };
        let make = move |i, stamp| {
            let data = ids::write(&camera.ids(episode, i)?, bytes);
            Ok(image(i, stamp, encoding, data))
        };
        let topic = format!("{}/image_raw", place("instances"));
        out.push(Channel::of(topic, camera.stamps(), make));
    }
    planes.dedup();
    for place in planes {
        let frame = frame.clone();
        let make = move |i, stamp| {
            Ok(CameraInfo {
                stamp: exposed(i, stamp),
                frame: frame.clone(),
                intrinsics: camera.intrinsics(i),
            })
        };
        let topic = format!("{place}/camera_info");
        out.push(Channel::of(topic, camera.stamps(), make));
    }
    out.push(Channel::of("/tf", camera.stamps(), move |i, stamp| {
        let stamp = exposed(i, stamp);
        let at = transform(stamp, WORLD, &frame, camera.pose(i));
        Ok(TFMessage(vec![at]))
    }));
}

/// The channel of one topic's samples.
fn of_topic<'a>(
    out: &mut Vec<Channel<'a>>,
    topic: TopicId,
    recording: &'a Recording,
    described: &'a Descriptions,
) -> anyhow::Result<()> {
    let (episode, robot) = (&recording.episode, described.robot.as_ref());
    let (imu_link, root_link) = (&recording.robot.imu_link, &recording.robot.root_link);
    let samples = || Ok::<_, anyhow::Error>(Arc::new(episode.samples(topic.name())?));
    let imu = |m: (
        Option<v1::Quaternion>,
        Option<v1::Vector3>,
        Option<v1::Vector3>,
    ),
               stamp| Imu {
        stamp,
        frame: imu_link.clone(),
        orientation: m.0.map(|q| [q.x, q.y, q.z, q.w]),
        angular_velocity: vector(m.1.as_ref()),
        linear_acceleration: vector(m.2.as_ref()),
    };
    let odometry = |pose: Option<v1::Pose>, twist: Option<v1::Twist>, stamp| Odometry {
        stamp,
        frame: ODOMETRY.to_owned(),
        child: root_link.clone(),
        pose: pose::of_message(pose.as_ref()),
        twist: twist_of(twist.as_ref()),
    };
    match topic {
        TopicId::JointState => joint_state(out, &samples()?, robot),
        TopicId::Pose => poses(out, &samples()?, recording, robot),
        TopicId::Applied => applied(out, &samples()?, recording),
        TopicId::Imu => out.push(Channel::per_sample(
            "/imu/data",
            &samples()?,
            move |m: v1::Imu, stamp| {
                let parts = (m.orientation, m.angular_velocity, m.linear_acceleration);
                imu(parts, stamp)
            },
        )),
        TopicId::SensedImu => out.push(Channel::per_sample(
            "/sensed/imu/data",
            &samples()?,
            move |m: v1::SensedImu, stamp| {
                imu((None, m.angular_velocity, m.linear_acceleration), stamp)
            },
        )),
        TopicId::Scan => {
            let make = scan(recording);
            let topic = Channel::per_sample("/scan", &samples()?, move |m: v1::Scan, stamp| {
                make(m.ranges, stamp)
            });
            out.push(topic);
        }
        TopicId::SensedScan => {
            let make = scan(recording);
            let topic = Channel::per_sample(
                "/sensed/scan",
                &samples()?,
                move |m: v1::SensedScan, stamp| make(m.ranges, stamp),
            );
            out.push(topic);
        }
        TopicId::Odometry => out.push(Channel::per_sample(
            "/odom",
            &samples()?,
            move |m: v1::Odometry, stamp| odometry(m.pose, m.twist, stamp),
        )),
        TopicId::SensedOdometry => out.push(Channel::per_sample(
            "/sensed/odom",
            &samples()?,
            move |m: v1::SensedOdometry, stamp| odometry(m.pose, m.twist, stamp),
        )),
        TopicId::SensedJoint => {
            let samples = samples()?;
            let names = samples.context().arm_joints.clone();
            out.push(Channel::per_sample(
                "/sensed/joint_states",
                &samples,
                move |m: v1::SensedJoints, stamp| JointState {
                    stamp,
                    names: names.clone(),
                    positions: m.positions,
                    velocities: m.velocities,
                    efforts: m.efforts,
                },
            ));
        }
        TopicId::FurnitureJoint => furniture::joints(out, &samples()?, described),
        TopicId::ObjectPose => {
            let samples = samples()?;
            let names = samples.context().objects.clone();
            out.push(Channel::per_sample(
                "/tf",
                &samples,
                move |m: v1::ObjectPoses, stamp| {
                    let each = names.iter().zip(&m.poses);
                    let each = each.map(|(name, pose)| {
                        transform(stamp, WORLD, name, pose::of_message(Some(pose)))
                    });
                    TFMessage(each.collect())
                },
            ));
        }
        TopicId::Deformable => out.push(Channel::per_sample(
            "/deformable/points",
            &samples()?,
            |m: v1::Deformable, stamp| {
                let (points, _) = m.vertices.as_chunks::<3>();
                PointCloud2 {
                    stamp,
                    frame: WORLD.to_owned(),
                    points: points.to_vec(),
                }
            },
        )),
        TopicId::Event => words(out, recording, topic, "/events")?,
        TopicId::Evaluation => words(out, recording, topic, "/evaluation")?,
        TopicId::Phase => words(out, recording, topic, "/phase")?,
        TopicId::Contact => words(out, recording, topic, "/contact")?,
        TopicId::Command => words(out, recording, topic, "/command")?,
        TopicId::Disturbance => words(out, recording, topic, "/disturbance")?,
        TopicId::Person => words(out, recording, topic, "/person")?,
        TopicId::StateHash => words(out, recording, topic, "/state_hash")?,
        // The clock precedes all; images are converted by camera; the rest is not
        // recorded.
        TopicId::Clock
        | TopicId::Camera
        | TopicId::CompressedCamera
        | TopicId::Sensor
        | TopicId::Preview
        | TopicId::SentCommand
        | TopicId::Refusal
        | TopicId::EpisodeStart
        | TopicId::EpisodeStop
        | TopicId::Recorder => {}
    }
    Ok(())
}

/// Makes messages of a scan.
fn scan(recording: &Recording) -> impl Fn(Vec<f32>, u64) -> LaserScan + use<> {
    let scanner = recording.robot.scanner.clone().unwrap_or_default();
    let rate = recording.scan_rate_hz();
    let period = if rate > 0.0 { 1.0 / rate } else { 0.0 };
    move |ranges, stamp| LaserScan {
        stamp,
        scanner: scanner.clone(),
        period,
        ranges,
    }
}

/// A stream without a standard message.
fn words(
    out: &mut Vec<Channel<'_>>,
    recording: &Recording,
    topic: TopicId,
    name: &str,
) -> anyhow::Result<()> {
    let episode = &recording.episode;
    let words = Words::read(episode, topic.name())?;
    let stamps = episode.stamps(topic.name())?;
    out.push(Channel::of(name, &stamps, move |i, _| {
        Ok(Text(words.sample(i)))
    }));
    Ok(())
}

/// The joints, and the links below those that move.
fn joint_state<'a>(out: &mut Vec<Channel<'a>>, samples: &Arc<Samples>, robot: Option<&'a Robot>) {
    let names = samples.context().joints.clone();
    let moving = robot.map(|robot| links::moving(robot, &names));
    out.push(Channel::per_sample(
        "/joint_states",
        samples,
        move |m: v1::JointState, stamp| JointState {
            stamp,
            names: names.clone(),
            positions: m.positions,
            velocities: m.velocities,
            efforts: m.efforts,
        },
    ));
    if let Some(moving) = moving {
        out.push(Channel::per_sample(
            "/tf",
            samples,
            move |m: v1::JointState, stamp| posed(&moving, &m.positions, stamp),
        ));
    }
}

/// The tree's root, and every recorded frame by itself.
fn poses<'a>(
    out: &mut Vec<Channel<'a>>,
    samples: &Arc<Samples>,
    recording: &'a Recording,
    robot: Option<&Robot>,
) {
    fn pose_of(m: &v1::PoseSet, place: usize) -> Pose {
        let frame = m.frames.get(place);
        pose::of_message(frame.and_then(|frame| frame.pose.as_ref()))
    }
    let shown = links::posed(recording, robot);
    out.push(Channel::per_sample(
        "/tf",
        samples,
        move |m: v1::PoseSet, stamp| {
            let each = shown
                .iter()
                .map(|(parent, link, place)| transform(stamp, parent, link, pose_of(&m, *place)));
            TFMessage(each.collect())
        },
    ));
    for (place, frame) in recording.robot.frames.iter().enumerate() {
        out.push(Channel::per_sample(
            format!("/pose/{}", word(&frame.name)),
            samples,
            move |m: v1::PoseSet, stamp| PoseStamped {
                stamp,
                frame: frame.parent.clone(),
                pose: pose_of(&m, place),
            },
        ));
        out.push(Channel::per_sample(
            format!("/twist/{}", word(&frame.name)),
            samples,
            move |m: v1::PoseSet, stamp| {
                let frames = m.frames.get(place);
                TwistStamped {
                    stamp,
                    frame: frame.parent.clone(),
                    twist: twist_of(frames.and_then(|frame| frame.twist.as_ref())),
                }
            },
        ));
    }
}

/// Commands to the robot.
fn applied<'a>(out: &mut Vec<Channel<'a>>, samples: &Arc<Samples>, recording: &'a Recording) {
    let (robot, roles) = (&recording.robot, &recording.roles);
    let joint = |&place: &usize| robot.joints.get(place).map(|joint| joint.name.clone());
    let arm: Vec<String> = roles.arm.iter().filter_map(joint).collect();
    let wheels: Vec<String> = roles.wheels.iter().filter_map(joint).collect();
    let knuckle: Vec<String> = joint(&roles.knuckle).into_iter().collect();
    let joints = |stamp, names: &[String], positions, velocities| JointState {
        stamp,
        names: names.to_vec(),
        positions,
        velocities,
        efforts: Vec::new(),
    };
    out.push(Channel::per_sample(
        "/applied/arm",
        samples,
        move |m: v1::Applied, stamp| joints(stamp, &arm, m.joint_positions, m.joint_velocities),
    ));
    out.push(Channel::per_sample(
        "/applied/wheels",
        samples,
        move |m: v1::Applied, stamp| joints(stamp, &wheels, Vec::new(), m.wheel_velocities),
    ));
    out.push(Channel::per_sample(
        "/applied/gripper",
        samples,
        move |m: v1::Applied, stamp| joints(stamp, &knuckle, vec![m.knuckle], Vec::new()),
    ));
    out.push(Channel::per_sample(
        "/applied/desired_pose",
        samples,
        move |m: v1::Applied, stamp| PoseStamped {
            stamp,
            frame: robot.arm_base_link.clone(),
            pose: pose::of_message(m.desired_pose.as_ref()),
        },
    ));
}

/// NaN where a part is not set.
fn vector(v: Option<&v1::Vector3>) -> [f64; 3] {
    v.map_or([f64::NAN; 3], |v| [v.x, v.y, v.z])
}

fn twist_of(twist: Option<&v1::Twist>) -> [f64; 6] {
    let linear = vector(twist.and_then(|t| t.linear.as_ref()));
    let angular = vector(twist.and_then(|t| t.angular.as_ref()));
    let [[vx, vy, vz], [wx, wy, wz]] = [linear, angular];
    [vx, vy, vz, wx, wy, wz]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_parts_of_a_topic() {
        for (name, wanted) in [
            ("gen3", "gen3"),
            ("over head-2", "over_head_2"),
            ("3rd", "n3rd"),
            ("größe", "gr__e"),
        ] {
            assert_eq!(word(name), wanted);
        }
        assert_eq!(colour("gen3"), "/camera/gen3/color/image_raw");
    }
}
