//! A made-up episode for tests, the benchmark and the contact sheet: every
//! stream, two cameras, numbers from a seeded generator. No simulation.

#![allow(dead_code, reason = "each user takes what it needs")]

pub mod smooth;

use bytes::Bytes;
use wheelarm_proto::random::{SPLITMIX64_STEP, splitmix64};
use wheelarm_proto::{Message, TopicId, stamp_nanos, v1};

/// A generator of numbers that need not be good, only repeatable.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        let bits = splitmix64(self.0);
        self.0 = self.0.wrapping_add(SPLITMIX64_STEP);
        bits
    }

    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// Any f64, among them NaN with payloads, infinities, -0.
    pub fn wild(&mut self) -> f64 {
        match self.below(8) {
            0 => f64::from_bits(self.bits()),
            1 => -0.0,
            2 => f64::NAN,
            3 => f64::INFINITY,
            _ => (self.bits() >> 11) as f64 / (1_u64 << 53) as f64 * 20.0 - 10.0,
        }
    }

    pub fn list(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.wild()).collect()
    }

    fn vector(&mut self) -> v1::Vector3 {
        let [x, y, z] = [self.wild(), self.wild(), self.wild()];
        v1::Vector3 { x, y, z }
    }

    fn quaternion(&mut self) -> v1::Quaternion {
        let [x, y, z, w] = [self.wild(), self.wild(), self.wild(), self.wild()];
        v1::Quaternion { x, y, z, w }
    }

    pub fn pose(&mut self) -> v1::Pose {
        v1::Pose {
            position: (self.below(9) > 0).then(|| self.vector()),
            orientation: (self.below(9) > 0).then(|| self.quaternion()),
        }
    }

    pub fn twist(&mut self) -> v1::Twist {
        v1::Twist {
            linear: Some(self.vector()),
            angular: Some(self.vector()),
        }
    }

    pub fn word(&mut self) -> String {
        const WORDS: [&str; 6] = [
            "",
            "mustard",
            "zeiß µ 灰色",
            "a/b",
            "line\nbreak",
            "pad left",
        ];
        WORDS[self.below(6) as usize].to_owned()
    }

    fn arm(&mut self) -> v1::ArmCommand {
        use v1::arm_command::Target;
        let frame = self.below(5) as i32;
        let target = match self.below(6) {
            0 => Some(Target::Joints(v1::JointTarget {
                positions: self.list(6),
            })),
            1 => Some(Target::Pose(v1::CartesianTarget {
                frame,
                pose: Some(self.pose()),
            })),
            2 => Some(Target::Twist(v1::CartesianTwist {
                frame,
                twist: Some(self.twist()),
            })),
            3 => Some(Target::Step(v1::CartesianStep {
                frame,
                translation: Some(self.vector()),
                rotation: Some(self.vector()),
            })),
            4 => Some(Target::Hold(true)),
            _ => None,
        };
        v1::ArmCommand { target }
    }

    fn gripper(&mut self) -> v1::GripperCommand {
        use v1::gripper_command::Target;
        let target = match self.below(3) {
            0 => Some(Target::Opening(self.wild())),
            1 => Some(Target::Knuckle(self.wild())),
            _ => None,
        };
        v1::GripperCommand {
            target,
            max_force: Some(self.wild()),
        }
    }

    fn base(&mut self) -> v1::BaseCommand {
        v1::BaseCommand {
            linear: self.wild(),
            angular: self.wild(),
        }
    }

    /// A message of `stream` with wild numbers.
    pub fn message(&mut self, stream: &str, header: v1::Header, objects: usize) -> Vec<u8> {
        let header = Some(header);
        let topic = TopicId::from_name(stream).expect("the name of a stream");
        // Names every topic: a new stream does not compile until its numbers are made up here.
        match topic {
            TopicId::JointState => v1::JointState {
                header,
                positions: self.list(16),
                velocities: self.list(16),
                efforts: self.list(16),
                opening: None,
            }
            .encode_to_vec(),
            TopicId::Pose => v1::PoseSet {
                header,
                frames: (0..7)
                    .map(|_| v1::FramePose {
                        pose: (self.below(9) > 0).then(|| self.pose()),
                        twist: (self.below(9) > 0).then(|| self.twist()),
                    })
                    .collect(),
            }
            .encode_to_vec(),
            TopicId::Imu => v1::Imu {
                header,
                orientation: Some(self.quaternion()),
                angular_velocity: Some(self.vector()),
                linear_acceleration: Some(self.vector()),
            }
            .encode_to_vec(),
            TopicId::Clock => v1::Clock {
                header,
                real_time_factor: self.wild(),
            }
            .encode_to_vec(),
            TopicId::Odometry => v1::Odometry {
                header,
                pose: Some(self.pose()),
                twist: Some(self.twist()),
            }
            .encode_to_vec(),
            TopicId::Command => v1::CommandLog {
                loop_age_ticks: Some(4),
                header,
                command: (self.below(9) > 0).then(|| v1::Command {
                    over_ticks: 6,
                    device: 9,
                    mode: 5,
                    assistance: 1,
                    header: Some(v1::Header {
                        sequence: self.bits(),
                        ..Default::default()
                    }),
                    commander: self.word(),
                    answers_tick: Some(self.bits()),
                    arm: (self.below(3) > 0).then(|| self.arm()),
                    base: (self.below(3) > 0).then(|| self.base()),
                    gripper: (self.below(3) > 0).then(|| self.gripper()),
                    phase: self.below(6) as i32,
                    phase_name: self.word(),
                    incident: self.below(3) as i32,
                    seal: Vec::new(),
                }),
            }
            .encode_to_vec(),
            TopicId::Applied => v1::Applied {
                header,
                arm: (self.below(3) > 0).then(|| self.arm()),
                base: (self.below(3) > 0).then(|| self.base()),
                gripper: (self.below(3) > 0).then(|| self.gripper()),
                joint_positions: self.list(6),
                joint_velocities: self.list(6),
                wheel_velocities: self.list(2),
                knuckle: self.wild(),
                desired_pose: (self.below(4) > 0).then(|| self.pose()),
                stale: self.below(2) == 0,
                arm_problem: self.word(),
                arm_problem_code: 2,
            }
            .encode_to_vec(),
            TopicId::ObjectPose => v1::ObjectPoses {
                header,
                poses: (0..objects).map(|_| self.pose()).collect(),
                twists: (0..objects).map(|_| self.twist()).collect(),
            }
            .encode_to_vec(),
            TopicId::FurnitureJoint => v1::FurnitureJoints {
                header,
                positions: self.list(2),
                velocities: self.list(2),
            }
            .encode_to_vec(),
            TopicId::Deformable => v1::Deformable {
                header,
                object: self.word(),
                vertices: (0..12).map(|i| i as f32 * 0.125).collect(),
                elastic_energy: self.wild(),
                kinetic_energy: self.wild(),
            }
            .encode_to_vec(),
            TopicId::Contact => v1::Contacts {
                header,
                pad_forces: self.list(2),
                contacts: (0..self.below(18))
                    .map(|_| v1::Contact {
                        first: self.word(),
                        second: self.word(),
                        point: Some(self.vector()),
                        force: Some(self.vector()),
                    })
                    .collect(),
                contact_count: self.below(30) as u32,
            }
            .encode_to_vec(),
            TopicId::Evaluation => v1::Evaluation {
                failure_reason: 0,
                header,
                success: self.below(2) == 0,
                done: self.below(2) == 0,
                failure: self.word(),
                conditions: (0..self.below(4))
                    .map(|i| v1::Condition {
                        predicate: String::new(),
                        name: format!("condition {i}, 0.{i} m"),
                        holds: self.below(2) == 0,
                        value: self.wild(),
                        required: self.below(2) == 0,
                    })
                    .collect(),
                elapsed_seconds: self.wild(),
            }
            .encode_to_vec(),
            TopicId::Phase => v1::PhaseSample {
                header,
                phase: self.below(5) as i32,
                name: self.word(),
            }
            .encode_to_vec(),
            TopicId::StateHash => v1::StateHash {
                header,
                hash: self.bits(),
            }
            .encode_to_vec(),
            TopicId::SensedJoint => v1::SensedJoints {
                header,
                positions: self.list(6),
                velocities: self.list(6),
                efforts: self.list(6),
                opening: self.wild(),
            }
            .encode_to_vec(),
            TopicId::SensedOdometry => v1::SensedOdometry {
                header,
                pose: Some(self.pose()),
                twist: Some(self.twist()),
            }
            .encode_to_vec(),
            TopicId::Scan => v1::Scan {
                header,
                ranges: self
                    .list(RAYS as usize)
                    .into_iter()
                    .map(|x| x as f32)
                    .collect(),
            }
            .encode_to_vec(),
            TopicId::SensedScan => v1::SensedScan {
                header,
                ranges: self
                    .list(RAYS as usize)
                    .into_iter()
                    .map(|x| x as f32)
                    .collect(),
            }
            .encode_to_vec(),
            TopicId::SensedImu => v1::SensedImu {
                header,
                angular_velocity: Some(self.vector()),
                linear_acceleration: Some(self.vector()),
            }
            .encode_to_vec(),
            TopicId::Disturbance => v1::Disturbance {
                header,
                joint_offsets: self.list(6),
                wheel_factors: self.list(2),
                pushed: self.word(),
                push_force: (self.below(3) > 0).then(|| self.vector()),
                grip_factor: self.wild(),
            }
            .encode_to_vec(),
            TopicId::Person => v1::PersonState {
                header,
                head_angles: self.list(3),
                jaw: self.wild(),
                mouth: Some(self.pose()),
                forces: self.list(8),
                robot_force: self.wild(),
                contacts: (0..self.below(5))
                    .map(|_| v1::PersonContact {
                        part: self.below(9) as i32,
                        partner: self.word(),
                        force: self.wild(),
                    })
                    .collect(),
                contact_count: self.below(30) as u32,
            }
            .encode_to_vec(),
            TopicId::Event => v1::Event {
                header,
                kind: 6,
                text: self.word(),
                ..v1::Event::default()
            }
            .encode_to_vec(),
            TopicId::Camera
            | TopicId::CompressedCamera
            | TopicId::Sensor
            | TopicId::Preview
            | TopicId::EpisodeStart
            | TopicId::EpisodeStop
            | TopicId::SentCommand
            | TopicId::Refusal
            | TopicId::Recorder => panic!("{topic} has no columns"),
        }
    }
}

/// Opens an episode `label` with all streams, cameras `gen3` and `wheelchair`.
pub fn started(label: &str) -> v1::EpisodeStarted {
    let camera = |name: &str| v1::CameraSetting {
        name: name.into(),
        width: 1280,
        height: 720,
        rate_hz: Some(10.0),
        ..v1::CameraSetting::default()
    };
    v1::EpisodeStarted {
        as_recorded: false,
        compressed_cameras: false,
        sensors: Vec::new(),
        physics_version: wheelarm_proto::PHYSICS_VERSION,
        header: Some(header(0, 0)),
        label: label.into(),
        instruction: "Turn right, go to the coffee table, and pick up the mustard".into(),
        scenario: Some(v1::Scenario {
            scene: "home".into(),
            task: Some("pick_mustard".into()),
            seed: Some(7),
            imu_noise: Some(false),
            instruction: Some(String::new()),
            target: Some(String::new()),
            robot: "whill_gen3".into(),
            cameras: vec![camera("gen3"), camera("wheelchair")],
            state_rate_hz: Some(60.0),
            deformable_rate_hz: Some(10.0),
            imu_rate_hz: Some(240.0),
            scan_rate_hz: Some(10.0),
            pacing: v1::Pacing::LockStep.into(),
            quality: v1::RenderQuality::Standard.into(),
            objects: vec![v1::ObjectPlacement {
                name: "mustard".into(),
                pose: Some(v1::Pose {
                    position: Some(v1::Vector3 {
                        x: -8.95,
                        y: 1.9,
                        z: 0.81,
                    }),
                    orientation: Some(v1::Quaternion {
                        x: 0.0,
                        y: 0.0,
                        z: 0.0,
                        w: 1.0,
                    }),
                }),
                mass: Some(0.6),
                friction: Some(0.8),
            }],
            ..Default::default()
        }),
        activity: "pick up".into(),
        area: "coffee_table".into(),
        streams: TopicId::STATES.map(|s| s.name().to_owned()).to_vec(),
        cameras: vec!["gen3".into(), "wheelchair".into()],
        adapter: "made up".into(),
        version: "0.1.0".into(),
        objects: ["mustard", "tomato_soup", "crackers"]
            .map(String::from)
            .to_vec(),
        joints: ["drawer_1_joint", "drawer_2_joint"]
            .map(String::from)
            .to_vec(),
        robot: wheelarm_dataset::read::first_robot()
            .ok()
            .map(|robot| v1::RobotDescription {
                scanner: Some(v1::ScannerDescription {
                    frame: "scanner_link".into(),
                    link: robot.root_link.clone(),
                    angle_step: 0.25,
                    rays: RAYS,
                    least_range: 0.06,
                    greatest_range: 12.0,
                    ..v1::ScannerDescription::default()
                }),
                ..robot
            }),
        ..v1::EpisodeStarted::default()
    }
}

/// Initial state of a replay.
pub fn snapshot() -> v1::SnapshotReply {
    v1::SnapshotReply {
        header: Some(header(0, 0)),
        snapshot: Bytes::from(
            (0..75_000_u32)
                .map(|i| (i.wrapping_mul(i) >> 7) as u8)
                .collect::<Vec<_>>(),
        ),
        assets: vec![
            v1::AssetText {
                path: "scenes/home.toml".into(),
                text: "# a home\n".into(),
            },
            v1::AssetText {
                path: "tasks/pick_mustard.toml".into(),
                text: "# a task µ\n".into(),
            },
        ],
        instances: vec![
            v1::Instance {
                kind: 2,
                part: 0,
                id: 1,
                name: "floor".into(),
            },
            v1::Instance {
                kind: 2,
                part: 0,
                id: 2,
                name: "mustard".into(),
            },
        ],
        packs: Vec::new(),
        furniture_urdf: FURNITURE.into(),
    }
}

/// A cupboard with a drawer and a door.
/// Rays of the laser scanner.
const RAYS: u32 = 24;

const FURNITURE: &str = r#"<robot name="home">
  <link name="house"/>
  <link name="cupboard"/>
  <joint name="cupboard_fixed" type="fixed">
    <origin xyz="1 2 0" rpy="0 0 1"/><parent link="house"/><child link="cupboard"/>
  </joint>
  <link name="drawer_1"/>
  <joint name="drawer_1_joint" type="prismatic">
    <origin xyz="0.1 0 0.5"/><parent link="cupboard"/><child link="drawer_1"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.4" effort="0" velocity="100"/>
  </joint>
  <link name="drawer_2"/>
  <joint name="drawer_2_joint" type="revolute">
    <origin xyz="0.1 0.2 1"/><parent link="cupboard"/><child link="drawer_2"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="1.7" effort="0" velocity="100"/>
  </joint>
</robot>
"#;

/// Header of episode 3.
pub fn header(sequence: u64, tick: u64) -> v1::Header {
    v1::Header {
        run_id: "run".into(),
        episode: 3,
        sequence,
        stamp_nanos: stamp_nanos(tick),
        tick,
    }
}

/// A camera frame of any size; `image` fills in colour, depth and id by pixel.
pub fn frame(
    camera: &str,
    header: v1::Header,
    (width, height): (u32, u32),
    mut image: impl FnMut(u32, u32) -> ([u8; 3], f32, u8),
) -> v1::CameraFrame {
    let pixels = (width * height) as usize;
    let (mut rgb, mut depth, mut ids) = (
        Vec::with_capacity(3 * pixels),
        Vec::with_capacity(4 * pixels),
        Vec::with_capacity(2 * pixels),
    );
    for y in 0..height {
        for x in 0..width {
            let (colour, metres, id) = image(x, y);
            rgb.extend(colour);
            depth.extend(metres.to_le_bytes());
            ids.extend(u16::from(id).to_le_bytes());
        }
    }
    v1::CameraFrame {
        header: Some(header),
        camera: camera.into(),
        intrinsics: Some(v1::Intrinsics {
            width,
            height,
            fx: 1297.7,
            fy: 1297.7,
            cx: f64::from(width) / 2.0,
            cy: f64::from(height) / 2.0,
        }),
        pose: Some(v1::Pose {
            position: Some(v1::Vector3 {
                x: 1.0,
                y: 2.0,
                z: 3.0,
            }),
            orientation: Some(v1::Quaternion {
                x: 0.0,
                y: 0.0,
                z: 0.0,
                w: 1.0,
            }),
        }),
        color: rgb.into(),
        depth: depth.into(),
        segmentation: ids.into(),
        color_format: v1::PixelFormat::Rgb8.into(),
        depth_format: v1::PixelFormat::DepthMetresF32.into(),
        segmentation_format: v1::PixelFormat::IdU16.into(),
    }
}

/// Closes the episode with the manifest `counts` (stream, first, count).
pub fn stopped(tick: u64, counts: &[(String, u64, u64)]) -> v1::EpisodeStopped {
    v1::EpisodeStopped {
        header: Some(header(0, tick)),
        discard: false,
        evaluation: Some(v1::Evaluation {
            failure_reason: 0,
            header: Some(header(0, tick)),
            success: true,
            done: true,
            conditions: vec![
                v1::Condition {
                    predicate: String::new(),
                    name: "lifted(mustard, 0.10 m)".into(),
                    holds: true,
                    value: 0.13,
                    required: true,
                },
                v1::Condition {
                    predicate: String::new(),
                    name: "held(mustard)".into(),
                    holds: true,
                    value: 1.0,
                    required: true,
                },
            ],
            elapsed_seconds: stamp_nanos(tick) as f64 * 1e-9,
            failure: String::new(),
        }),
        manifest: counts
            .iter()
            .map(|(stream, first, count)| v1::StreamCount {
                stream: stream.clone(),
                first: *first,
                last: first + count.saturating_sub(1),
                count: *count,
                ..Default::default()
            })
            .collect(),
        cause: v1::EndCause::Requested.into(),
        anomalies: Vec::new(),
        anomaly_kinds: Vec::new(),
        unconfirmed_recorders: Vec::new(),
        wall_seconds: 12.5,
    }
}
