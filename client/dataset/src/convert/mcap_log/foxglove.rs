//! Foxglove's messages, and the conversion of ours into them.

use prost_types::Timestamp;
use wheelarm_proto::v1;

use crate::calibration::PIXEL_CENTRE;
use crate::ids;
use crate::pose::{self, Pose as Seven};
use crate::read::{Camera, Episode};

#[expect(clippy::doc_markdown, reason = "generated from the .proto file")]
mod messages {
    include!(concat!(env!("OUT_DIR"), "/foxglove.rs"));
}
pub(super) use messages::*;

const JPEG_QUALITY: u8 = 90;

fn timestamp(nanos: u64) -> Option<Timestamp> {
    Some(Timestamp {
        seconds: (nanos / 1_000_000_000) as i64,
        nanos: (nanos % 1_000_000_000) as i32,
    })
}

fn size(camera: &Camera) -> anyhow::Result<(usize, usize)> {
    let size = camera.size();
    size.ok_or_else(|| anyhow::anyhow!("{} has no images", camera.stream()))
}

/// The colours of an image, JPEG.
pub(super) fn colour(
    episode: &Episode,
    camera: &Camera,
    i: usize,
    stamp: u64,
) -> anyhow::Result<CompressedImage> {
    let (width, height) = size(camera)?;
    let mut data = Vec::new();
    jpeg_encoder::Encoder::new(&mut data, JPEG_QUALITY).encode(
        &camera.rgb(episode, i)?,
        u16::try_from(width)?,
        u16::try_from(height)?,
        jpeg_encoder::ColorType::Rgb,
    )?;
    Ok(CompressedImage {
        timestamp: timestamp(stamp),
        frame_id: camera.stream().to_owned(),
        data,
        format: "jpeg".into(),
    })
}

/// Depth of an image, millimetres.
pub(super) fn depth(
    episode: &Episode,
    camera: &Camera,
    i: usize,
    stamp: u64,
) -> anyhow::Result<RawImage> {
    let (width, height) = size(camera)?;
    let metres = camera.depth(episode, i)?;
    let millimetres = metres.iter().map(|&m| crate::depth::millimetres(m));
    Ok(RawImage {
        timestamp: timestamp(stamp),
        frame_id: camera.stream().to_owned(),
        width: u32::try_from(width)?,
        height: u32::try_from(height)?,
        encoding: "16UC1".into(),
        step: u32::try_from(2 * width)?,
        data: millimetres.flat_map(u16::to_le_bytes).collect(),
    })
}

/// Instance ids of an image.
pub(super) fn instances(
    episode: &Episode,
    camera: &Camera,
    i: usize,
    stamp: u64,
) -> anyhow::Result<RawImage> {
    let (width, height) = size(camera)?;
    Ok(RawImage {
        timestamp: timestamp(stamp),
        frame_id: camera.stream().to_owned(),
        width: u32::try_from(width)?,
        height: u32::try_from(height)?,
        encoding: match camera.id_bytes() {
            2 => "16UC1".into(),
            _ => "8UC1".into(),
        },
        step: u32::try_from(camera.id_bytes() * width)?,
        data: ids::write(&camera.ids(episode, i)?, camera.id_bytes()),
    })
}

/// Intrinsics of an image: readers of this message count from the centre of the
/// first pixel, recordings from the image's edge.
pub(super) fn calibration(camera: &Camera, i: usize, stamp: u64) -> CameraCalibration {
    let [width, height, fx, fy, cx, cy] = camera.intrinsics(i);
    let (cx, cy) = (cx - PIXEL_CENTRE, cy - PIXEL_CENTRE);
    CameraCalibration {
        timestamp: timestamp(stamp),
        frame_id: camera.stream().to_owned(),
        width: width as u32,
        height: height as u32,
        k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..Default::default()
    }
}

/// The pose of `child` in `parent`: x y z, qx qy qz qw.
pub(super) fn transform(stamp: u64, parent: &str, child: &str, at: &Seven) -> FrameTransform {
    let pose = placed(at);
    FrameTransform {
        timestamp: timestamp(stamp),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: pose.position,
        rotation: pose.orientation,
    }
}

fn placed([x, y, z, qx, qy, qz, qw]: &Seven) -> Pose {
    Pose {
        position: Some(Vector3 {
            x: *x,
            y: *y,
            z: *z,
        }),
        orientation: Some(Quaternion {
            x: *qx,
            y: *qy,
            z: *qz,
            w: *qw,
        }),
    }
}

/// A pose in a frame.
pub(super) fn pose_in(frame: &str, at: Option<&v1::Pose>, stamp: u64) -> PoseInFrame {
    PoseInFrame {
        timestamp: timestamp(stamp),
        frame_id: frame.to_owned(),
        pose: Some(placed(&pose::of_message(at))),
    }
}

/// Joints by name; unknown values are left out.
pub(super) fn joints(
    names: &[String],
    [positions, velocities, efforts]: [&[f64]; 3],
    stamp: u64,
) -> JointStates {
    let each = names.iter().enumerate().map(|(k, name)| JointState {
        name: name.clone(),
        position: positions.get(k).copied(),
        velocity: velocities.get(k).copied(),
        acceleration: None,
        effort: efforts.get(k).copied(),
    });
    JointStates {
        timestamp: timestamp(stamp),
        joints: each.collect(),
    }
}

/// A laser scan in the frame of its scanner.
pub(super) fn scan(
    scanner: Option<&v1::ScannerDescription>,
    ranges: &[f32],
    stamp: u64,
) -> LaserScan {
    let scanner = scanner.cloned().unwrap_or_default();
    LaserScan {
        timestamp: timestamp(stamp),
        pose: Some(placed(&pose::of_message(None))),
        start_angle: scanner.first_angle,
        end_angle: scanner.last_angle(),
        frame_id: scanner.frame,
        ranges: ranges.iter().map(|&range| f64::from(range)).collect(),
        intensities: Vec::new(),
    }
}

/// An event: serious ones are warnings.
pub(super) fn log(kind: &str, text: &str, stamp: u64) -> Log {
    let level = match v1::EventKind::from_word(kind).is_serious() {
        true => log::Level::Warning,
        false => log::Level::Info,
    };
    Log {
        timestamp: timestamp(stamp),
        level: level.into(),
        message: text.to_owned(),
        name: kind.to_owned(),
        ..Default::default()
    }
}
