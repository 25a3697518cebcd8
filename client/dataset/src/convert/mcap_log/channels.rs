//! The channels of a recording. Messages are read by the
//! table of columns; this module holds only the viewer's names.

use std::sync::Arc;

use wheelarm_proto::{TopicId, v1};

use super::channel::Channel;
use super::foxglove::{self, FrameTransforms, transform};
use crate::convert::Recording;
use crate::convert::links::{self, Descriptions};
use crate::pose::{self, Pose};
use crate::read::{Camera, ReadError};
use crate::urdf::{self, Joint, Robot};

/// Every channel of a recording.
pub(super) fn channels<'a>(
    recording: &'a Recording,
    described: &'a Descriptions,
    start: &v1::SnapshotReply,
) -> anyhow::Result<Vec<Channel<'a>>> {
    let mut out = once(recording, described, start)?;
    for (name, camera) in &recording.cameras {
        let all = images(recording, &format!("/camera/{name}"), name, camera).into_iter();
        out.extend(all.filter(|channel| camera.has_depth() || !channel.topic.ends_with("/depth")));
    }
    for (name, sensor) in &recording.sensors {
        let all = images(recording, &format!("/sensor/{name}"), name, sensor);
        let has = |what: &str| match what {
            "rgb" => sensor.has_rgb(),
            "depth" => sensor.has_depth(),
            "ids" => false,
            _ => true,
        };
        out.extend(
            all.into_iter()
                .filter(|channel| has(channel.topic.rsplit('/').next().unwrap_or_default())),
        );
    }
    // Every topic of the table, so that every recorded stream is in the log.
    for topic in TopicId::ALL {
        if topic == TopicId::Event || recording.episode.has(topic.name()) {
            of_topic(&mut out, topic, recording, described)?;
        }
    }
    Ok(out)
}

/// Messages that a viewer needs once: static links, and the appearance of robot and
/// furniture.
fn once<'a>(
    recording: &'a Recording,
    described: &'a Descriptions,
    start: &v1::SnapshotReply,
) -> anyhow::Result<Vec<Channel<'a>>> {
    let stamp = recording.summary.span_nanos.0;
    let mut out = Vec::new();
    let still = described.still(recording)?;
    let scanner = recording.scanner();
    if !still.is_empty() || scanner.is_some() {
        out.push(Channel::foxglove(
            "/tf_static",
            &[stamp],
            move |_, stamp| {
                let each = still.iter();
                let each = each.map(|j| transform(stamp, &j.parent, &j.child, &j.pose(0.0)));
                let scanner = scanner.map(|s| {
                    let pose = pose::of_message(s.pose.as_ref());
                    transform(stamp, &s.link, &s.frame, &pose)
                });
                Ok(FrameTransforms {
                    transforms: each.chain(scanner).collect(),
                })
            },
        ));
    }
    if let Some(drawn) = urdf::text(&start.assets).and_then(|t| urdf::without_meshes(t).ok()) {
        out.push(Channel::text("/robot_description", stamp, drawn));
    }
    if described.furniture.is_some() {
        let text = start.furniture_urdf.clone();
        out.push(Channel::text("/furniture_description", stamp, text));
    }
    Ok(out)
}

fn images<'a>(
    recording: &'a Recording,
    place: &str,
    name: &str,
    camera: &'a Camera,
) -> [Channel<'a>; 5] {
    let (episode, stamps) = (&recording.episode, camera.stamps());
    let topic = |what: &str| format!("{place}/{what}");
    [
        Channel::foxglove(topic("rgb"), stamps, |i, stamp| {
            foxglove::colour(episode, camera, i, stamp)
        }),
        Channel::foxglove(topic("depth"), stamps, |i, stamp| {
            foxglove::depth(episode, camera, i, stamp)
        }),
        Channel::foxglove(topic("ids"), stamps, |i, stamp| {
            foxglove::instances(episode, camera, i, stamp)
        }),
        Channel::foxglove(topic("calibration"), stamps, |i, stamp| {
            Ok(foxglove::calibration(camera, i, stamp))
        }),
        Channel::foxglove(format!("/tf/{name}"), stamps, |i, stamp| {
            Ok(FrameTransforms {
                transforms: vec![transform(stamp, "house", camera.stream(), &camera.pose(i))],
            })
        }),
    ]
}

/// The channel of one topic's samples.
fn of_topic<'a>(
    out: &mut Vec<Channel<'a>>,
    topic: TopicId,
    recording: &'a Recording,
    described: &'a Descriptions,
) -> anyhow::Result<()> {
    let (episode, robot) = (&recording.episode, described.robot.as_ref());
    let samples = || Ok::<_, anyhow::Error>(Arc::new(episode.samples(topic.name())?));
    match topic {
        TopicId::JointState => joint_state(out, recording, robot)?,
        TopicId::Pose => poses(out, recording, robot)?,
        TopicId::FurnitureJoint => {
            let samples = samples()?;
            let stamps = samples.stamps().to_vec();
            let joints = samples.clone();
            out.push(Channel::foxglove(
                "/furniture_joints",
                &stamps,
                move |i, stamp| {
                    let m: v1::FurnitureJoints = joints.message(i)?;
                    let numbers = [&m.positions[..], &m.velocities, &[]];
                    let names = &joints.context().furniture_joints;
                    Ok(foxglove::joints(names, numbers, stamp))
                },
            ));
            if let Some(furniture) = &described.furniture {
                let moving = links::moving(furniture, &samples.context().furniture_joints);
                out.push(Channel::foxglove(
                    "/tf/furniture",
                    &stamps,
                    move |i, stamp| {
                        let m: v1::FurnitureJoints = samples.message(i)?;
                        Ok(posed(&moving, &m.positions, stamp))
                    },
                ));
            }
        }
        TopicId::ObjectPose => {
            let samples = samples()?;
            let stamps = samples.stamps().to_vec();
            out.push(Channel::foxglove(
                "/tf/objects",
                &stamps,
                move |i, stamp| {
                    let m: v1::ObjectPoses = samples.message(i)?;
                    let each = samples.context().objects.iter().zip(&m.poses);
                    let each = each.map(|(name, pose)| {
                        transform(stamp, "house", name, &pose::of_message(Some(pose)))
                    });
                    Ok(FrameTransforms {
                        transforms: each.collect(),
                    })
                },
            ));
        }
        TopicId::Event => {
            // Files without events have no such columns; damaged ones are refused.
            let texts = |column| match episode.texts("event", column) {
                Err(problem @ ReadError::Shape { .. }) => Err(problem),
                read => Ok(read.ok()),
            };
            if let (Some(kinds), Some(texts)) = (texts("kind")?, texts("text")?) {
                let stamps = episode.stamps("event")?;
                out.push(Channel::foxglove("/events", &stamps, move |i, stamp| {
                    let text = texts.get(i).map_or("", String::as_str);
                    Ok(foxglove::log(&kinds[i], text, stamp))
                }));
            }
        }
        TopicId::Contact => out.push(Channel::own("/contact", topic, samples()?)),
        TopicId::Disturbance => out.push(Channel::own("/disturbance", topic, samples()?)),
        TopicId::Person => out.push(Channel::own("/person", topic, samples()?)),
        TopicId::Imu => out.push(Channel::own("/imu", topic, samples()?)),
        TopicId::Scan => {
            let (samples, scanner) = (samples()?, recording.robot.scanner.clone());
            let stamps = samples.stamps().to_vec();
            out.push(Channel::foxglove("/scan", &stamps, move |i, stamp| {
                let m: v1::Scan = samples.message(i)?;
                Ok(foxglove::scan(scanner.as_ref(), &m.ranges, stamp))
            }));
        }
        TopicId::SensedScan => {
            let (samples, scanner) = (samples()?, recording.robot.scanner.clone());
            let stamps = samples.stamps().to_vec();
            out.push(Channel::foxglove(
                "/sensed/scan",
                &stamps,
                move |i, stamp| {
                    let m: v1::SensedScan = samples.message(i)?;
                    Ok(foxglove::scan(scanner.as_ref(), &m.ranges, stamp))
                },
            ));
        }
        TopicId::Odometry => out.push(Channel::own("/odometry", topic, samples()?)),
        TopicId::SensedJoint => out.push(Channel::own("/sensed/joints", topic, samples()?)),
        TopicId::SensedOdometry => out.push(Channel::own("/sensed/odometry", topic, samples()?)),
        TopicId::SensedImu => out.push(Channel::own("/sensed/imu", topic, samples()?)),
        TopicId::Evaluation => out.push(Channel::own("/evaluation", topic, samples()?)),
        TopicId::Phase => out.push(Channel::own("/phase", topic, samples()?)),
        TopicId::Applied => out.push(Channel::own("/applied", topic, samples()?)),
        TopicId::Command => out.push(Channel::own("/command", topic, samples()?)),
        // `clock` and `state_hash` are useless to a viewer; viewers have no message of a
        // skin. Images are converted by camera; the rest is not
        // recorded.
        TopicId::Clock
        | TopicId::StateHash
        | TopicId::Deformable
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

/// The joints, and the links below those that move; a joint whose position is
/// not recorded stays where it is at zero.
fn joint_state<'a>(
    out: &mut Vec<Channel<'a>>,
    recording: &'a Recording,
    robot: Option<&'a Robot>,
) -> anyhow::Result<()> {
    let samples = Arc::new(recording.episode.samples(TopicId::JointState.name())?);
    let stamps = samples.stamps().to_vec();
    let joints = samples.clone();
    out.push(Channel::foxglove(
        "/joint_states",
        &stamps,
        move |i, stamp| {
            let m: v1::JointState = joints.message(i)?;
            let numbers = [&m.positions[..], &m.velocities, &m.efforts];
            Ok(foxglove::joints(&joints.context().joints, numbers, stamp))
        },
    ));
    let Some(robot) = robot else {
        return Ok(());
    };
    let moving = links::moving(robot, &samples.context().joints);
    out.push(Channel::foxglove("/tf/links", &stamps, move |i, stamp| {
        let m: v1::JointState = samples.message(i)?;
        Ok(posed(&moving, &m.positions, stamp))
    }));
    Ok(())
}

/// The children of moving joints at their positions.
fn posed(moving: &[(usize, &Joint)], positions: &[f64], stamp: u64) -> FrameTransforms {
    let each = moving.iter().map(|(place, joint)| {
        let position = positions.get(*place).copied().unwrap_or(f64::NAN);
        transform(stamp, &joint.parent, &joint.child, &joint.pose(position))
    });
    FrameTransforms {
        transforms: each.collect(),
    }
}

/// The poses of the chair, or of every recorded frame of a recording without links, and of the
/// end effector.
fn poses<'a>(
    out: &mut Vec<Channel<'a>>,
    recording: &'a Recording,
    robot: Option<&'a Robot>,
) -> anyhow::Result<()> {
    fn pose_of(m: &v1::PoseSet, place: usize) -> Option<&v1::Pose> {
        m.frames.get(place)?.pose.as_ref()
    }
    let samples = Arc::new(recording.episode.samples(TopicId::Pose.name())?);
    let stamps = samples.stamps().to_vec();
    let (described, roles) = (&recording.robot, &recording.roles);
    let shown = links::posed(recording, robot);
    let tree = samples.clone();
    out.push(Channel::foxglove("/tf", &stamps, move |i, stamp| {
        let m: v1::PoseSet = tree.message(i)?;
        let each = shown.iter().map(|(parent, link, place)| {
            let at: Pose = pose::of_message(pose_of(&m, *place));
            transform(stamp, parent, link, &at)
        });
        Ok(FrameTransforms {
            transforms: each.collect(),
        })
    }));
    out.push(Channel::foxglove(
        "/end_effector",
        &stamps,
        move |i, stamp| {
            let m: v1::PoseSet = samples.message(i)?;
            let at = pose_of(&m, roles.end_effector);
            Ok(foxglove::pose_in(&described.arm_base_link, at, stamp))
        },
    ));
    Ok(())
}
