//! A made-up episode that looks like one: a chair drives a curve, an arm
//! reaches, two cameras see a room of flat colours.

use std::path::Path;

use bytes::Bytes;
use wheelarm_dataset::log::Closing;
use wheelarm_dataset::writer::{EpisodeWriter, WriteError, WriterOptions};
use wheelarm_proto::{Message, v1};

/// A ray into a room of 8 x 6 x 2.7 m with a table and a bottle on it:
/// colour, depth along the optical axis, instance id.
fn room(eye: [f64; 3], direction: [f64; 3], forward: f64) -> ([u8; 3], f32, u8) {
    type Solid = ([f64; 3], [f64; 3], [f64; 3], u8);
    const BOXES: [Solid; 5] = [
        ([2.0, -0.4, 0.70], [2.8, 1.8, 0.81], [150.0, 104.0, 66.0], 2),
        ([2.1, -0.3, 0.0], [2.2, -0.2, 0.7], [90.0, 62.0, 40.0], 2),
        (
            [2.30, 0.50, 0.81],
            [2.36, 0.57, 1.0],
            [232.0, 190.0, 30.0],
            3,
        ),
        (
            [2.40, 0.85, 0.81],
            [2.47, 0.92, 0.91],
            [190.0, 40.0, 40.0],
            4,
        ),
        ([3.2, -2.2, 0.0], [3.7, 2.4, 0.9], [92.0, 104.0, 122.0], 5),
    ];
    let mut best = (f64::INFINITY, [0.0; 3], 0, 0);
    for (axis, low, high) in [(0, -4.0, 4.0), (1, -3.0, 3.0), (2, 0.0, 2.7)] {
        let wall = if direction[axis] > 0.0 { high } else { low };
        let t = (wall - eye[axis]) / direction[axis];
        if t > 1e-6 && t < best.0 {
            let floor = axis == 2 && direction[axis] < 0.0;
            let colour = if floor {
                [168.0, 132.0, 96.0]
            } else {
                [214.0, 208.0, 196.0]
            };
            best = (t, colour, axis, 1);
        }
    }
    for (low, high, colour, id) in BOXES {
        let (mut enter, mut leave, mut face) = (0.0, f64::INFINITY, 0);
        for k in 0..3 {
            let (a, b) = (
                (low[k] - eye[k]) / direction[k],
                (high[k] - eye[k]) / direction[k],
            );
            if a.min(b) > enter {
                (enter, face) = (a.min(b), k);
            }
            leave = leave.min(a.max(b));
        }
        if enter > 1e-3 && enter < leave && enter < best.0 {
            best = (enter, colour, face, id);
        }
    }
    let (t, colour, face, id) = best;
    if !t.is_finite() || t > 6.5 {
        return ([186, 214, 240], f32::INFINITY, 0);
    }
    let p: Vec<f64> = (0..3).map(|k| eye[k] + t * direction[k]).collect();
    let light = [0.78, 0.88, 1.0][face] * (1.0 - 0.04 * t);
    let grain = ((p[0] * 37.0).sin() * (p[1] * 41.0).cos() * (p[2] * 29.0 + 1.0).cos()) * 6.0;
    let plank = if face == 2 && (p[1] * 5.0).fract().abs() < 0.05 {
        -18.0
    } else {
        0.0
    };
    let rgb = colour.map(|c: f64| (c * light + grain + plank).clamp(0.0, 255.0) as u8);
    (rgb, (t * forward) as f32, id)
}

/// An image from `eye`, looking along `yaw` and down by `pitch`.
pub fn image(
    camera: &str,
    header: v1::Header,
    size: (u32, u32),
    (eye, yaw, pitch): ([f64; 3], f64, f64),
) -> v1::CameraFrame {
    let (w, h) = (f64::from(size.0), f64::from(size.1));
    let focal = 0.6 * w;
    let ((sy, cy), (sp, cp)) = (yaw.sin_cos(), pitch.sin_cos());
    super::frame(camera, header, size, |x, y| {
        let (u, v) = (
            (f64::from(x) - w / 2.0) / focal,
            (h / 2.0 - f64::from(y)) / focal,
        );
        let norm = (1.0 + u * u + v * v).sqrt();
        let (ahead, left, up) = (cp + v * sp, -u, v * cp - sp);
        let direction = [
            (ahead * cy - left * sy) / norm,
            (ahead * sy + left * cy) / norm,
            up / norm,
        ];
        room(eye, direction, 1.0 / norm)
    })
}

fn quaternion(yaw: f64) -> v1::Quaternion {
    let (z, w) = (0.5 * yaw).sin_cos();
    v1::Quaternion {
        x: 0.0,
        y: 0.0,
        z,
        w,
    }
}

fn pose(x: f64, y: f64, z: f64, yaw: f64) -> Option<v1::Pose> {
    Some(v1::Pose {
        position: Some(v1::Vector3 { x, y, z }),
        orientation: Some(quaternion(yaw)),
    })
}

/// 0 before `from`, 1 after `to`, smooth between.
fn rise(t: f64, from: f64, to: f64) -> f64 {
    let s = ((t - from) / (to - from)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// Everything that one control tick publishes, as (stream, message).
pub fn tick(index: u64, seconds: f64, sequence: u64) -> Vec<(&'static str, Vec<u8>)> {
    let t = seconds;
    let head = || Some(super::header(sequence, index));
    let drive = rise(t, 0.5, 9.0);
    let yaw = -1.57 + 1.57 * rise(t, 0.5, 5.0);
    let (cx, cy) = (-2.2 + 3.0 * drive * drive, 2.2 - 1.9 * drive);
    let reach = rise(t, 9.0, 14.0) - 0.5 * rise(t, 17.0, 20.0);
    let knuckle = 0.6 * rise(t, 14.0, 16.0);
    let phase = match t {
        t if t < 9.0 => v1::Phase::Navigating,
        t if t < 14.0 => v1::Phase::Reaching,
        t if t < 17.0 => v1::Phase::Grasping,
        _ => v1::Phase::Retracting,
    };
    let mut position = vec![0.0; 16];
    let home = [0.0, -0.35, 3.1, -2.55, 0.0, -0.87, 1.57];
    for (j, p) in position[4..10].iter_mut().enumerate() {
        *p = home[j] + reach * (0.9 - 0.35 * j as f64);
    }
    position[13] = knuckle;
    let zero = || Some(v1::Vector3::default());
    let twist = |x, w| {
        Some(v1::Twist {
            linear: Some(v1::Vector3 { x, y: 0.0, z: 0.0 }),
            angular: Some(v1::Vector3 {
                x: 0.0,
                y: 0.0,
                z: w,
            }),
        })
    };
    let frames = (0..7)
        .map(|i| v1::FramePose {
            pose: if i == 0 {
                pose(cx, cy, 0.0, yaw)
            } else {
                let out = 0.12 * i as f64 * (0.6 + 0.5 * reach);
                pose(-out, 0.05 * i as f64, 0.3, 0.0)
            },
            twist: twist(0.0, 0.0),
        })
        .collect();
    let speed = (rise(t + 0.05, 0.5, 9.0) - rise(t - 0.05, 0.5, 9.0)) * 30.0;
    let turn = (rise(t + 0.05, 0.5, 5.0) - rise(t - 0.05, 0.5, 5.0)) * 15.7;
    let grip = 30.0 * rise(t, 14.8, 15.6);
    vec![
        (
            "joint_state",
            v1::JointState {
                header: head(),
                positions: position,
                velocities: vec![0.0; 16],
                efforts: vec![0.0; 16],
                opening: None,
            }
            .encode_to_vec(),
        ),
        (
            "pose",
            v1::PoseSet {
                header: head(),
                frames,
            }
            .encode_to_vec(),
        ),
        (
            "imu",
            v1::Imu {
                header: head(),
                orientation: Some(quaternion(yaw)),
                angular_velocity: zero(),
                linear_acceleration: Some(v1::Vector3 {
                    x: 0.0,
                    y: 0.0,
                    z: 9.81,
                }),
            }
            .encode_to_vec(),
        ),
        (
            "odometry",
            v1::Odometry {
                header: head(),
                pose: pose(cx, cy, 0.0, yaw),
                twist: twist(0.12 * speed, 0.06 * turn),
            }
            .encode_to_vec(),
        ),
        (
            "object_pose",
            v1::ObjectPoses {
                header: head(),
                poses: [(2.33, 0.53), (2.43, 0.88), (2.5, 0.2)]
                    .map(|(x, y)| pose(x, y, 0.81, 0.0).unwrap_or_default())
                    .to_vec(),
                twists: vec![v1::Twist::default(); 3],
            }
            .encode_to_vec(),
        ),
        (
            "furniture_joint",
            v1::FurnitureJoints {
                header: head(),
                positions: vec![0.0; 2],
                velocities: vec![0.0; 2],
            }
            .encode_to_vec(),
        ),
        (
            "deformable",
            v1::Deformable {
                header: head(),
                object: "teddy_bear".to_owned(),
                vertices: vec![0.5; 12],
                elastic_energy: 0.0,
                kinetic_energy: 0.0,
            }
            .encode_to_vec(),
        ),
        (
            "contact",
            v1::Contacts {
                header: head(),
                pad_forces: vec![grip, 0.97 * grip],
                contacts: Vec::new(),
                contact_count: 0,
            }
            .encode_to_vec(),
        ),
        (
            "phase",
            v1::PhaseSample {
                header: head(),
                phase: phase.into(),
                name: String::new(),
            }
            .encode_to_vec(),
        ),
        (
            "clock",
            v1::Clock {
                header: head(),
                real_time_factor: 1.0,
            }
            .encode_to_vec(),
        ),
    ]
}

/// Records `seconds` of it at 60 Hz with images of `size` at 5 Hz and
/// returns the log.
///
/// # Errors
/// Those of the writer.
pub fn record(
    dir: &Path,
    label: &str,
    seconds: u64,
    size: (u32, u32),
) -> Result<std::path::PathBuf, WriteError> {
    const URDF: &str = r#"<robot name="r"><link name="wheelchair_root"/>
        <link name="base_link"/><joint name="m" type="fixed"><parent link="wheelchair_root"/>
        <child link="base_link"/><origin xyz="0.42 0.36 0.55" rpy="0 0 3.14159265"/></joint></robot>"#;
    let mut snapshot = super::snapshot();
    snapshot.assets.push(v1::AssetText {
        path: "robots/r/robot.urdf".into(),
        text: URDF.into(),
    });
    let started = super::started(label);
    let mut writer = EpisodeWriter::open(dir, &started, &snapshot, &WriterOptions::default())?;
    let mut counts = std::collections::BTreeMap::new();
    let mut offer = |writer: &mut EpisodeWriter, stream: &str, payload: Vec<u8>| {
        *counts.entry(stream.to_owned()).or_insert(0) += 1;
        writer.offer(stream, Bytes::from(payload)).map(drop)
    };
    for i in 0..60 * seconds {
        let t = i as f64 / 60.0;
        for (stream, payload) in tick(4 * i, t, i) {
            offer(&mut writer, stream, payload)?;
        }
        if i % 12 == 0 {
            let header = || super::header(i / 12, 4 * i);
            let drive = rise(t, 0.5, 9.0);
            let yaw = -1.57 + 1.57 * rise(t, 0.5, 5.0);
            let eye = [-2.4 + 3.0 * drive * drive, 2.2 - 1.9 * drive, 1.5];
            let view = (eye, yaw, 0.35);
            let chair = image("wheelchair", header(), size, view);
            offer(&mut writer, "camera/wheelchair", chair.encode_to_vec())?;
            let near = [eye[0] + 0.7 + 0.4 * rise(t, 9.0, 14.0), eye[1] + 0.2, 1.15];
            let wrist = image("gen3", header(), size, (near, yaw + 0.1, 0.2));
            offer(&mut writer, "camera/gen3", wrist.encode_to_vec())?;
        }
    }
    let counts: Vec<_> = counts
        .into_iter()
        .map(|(stream, n)| (stream, 0, n))
        .collect();
    let closing = Closing {
        stopped: Some(super::stopped(240 * seconds, &counts)),
        ..Default::default()
    };
    writer.close(closing)
}
