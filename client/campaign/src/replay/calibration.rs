//! Calibration of recorded cameras: lens and pose of their images, so that an old recording
//! is rendered with its own cameras.

use anyhow::Context;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::geometry::{self, from_columns, normalized};
use wheelarm_proto::v1;

/// Sets lens and pose of each recorded camera of the robot to those of its first image.
/// Others keep the values of the robot's description.
///
/// # Errors
/// When the file cannot be read.
pub(super) fn as_recorded(
    cameras: &mut [v1::CameraSetting],
    episode: &Episode,
) -> anyhow::Result<()> {
    let (robot, roles) = episode.roles()?;
    let chair_from_base = normalized("arm mount", robot.arm_mount.as_ref())?;
    let poses = episode.f64s("pose", "pose")?;
    let stamps = episode.u64s("pose", "stamp_nanos")?;
    for setting in cameras {
        let mount = robot.cameras.iter().find(|c| c.name == setting.name);
        let (Some(mount), Ok(camera)) = (mount, episode.camera(&setting.name)) else {
            continue;
        };
        let first = camera.stamps().first();
        let Some(row) = first.and_then(|first| stamps.iter().position(|stamp| stamp == first))
        else {
            continue;
        };
        let pose = |frame: usize| from_columns(std::array::from_fn(|k| poses[[row, frame, k]]));
        let house_from_chair = pose(roles.chair);
        let (frame, house_from_frame) = match mount.mount() {
            v1::CameraMount::Arm => (
                roles.end_effector,
                house_from_chair * chair_from_base * pose(roles.end_effector),
            ),
            _ => (roles.chair, house_from_chair),
        };
        let name = robot
            .frames
            .get(frame)
            .context("the file has no names of frames")?;
        let optical = house_from_frame.inverse() * from_columns(camera.pose(0));
        let [width, height, fx, fy, cx, cy] = camera.intrinsics(0);
        setting.lens = Some(v1::Intrinsics {
            width: width as u32,
            height: height as u32,
            fx,
            fy,
            cx,
            cy,
        });
        setting.place = Some(v1::CameraPlace {
            frame: name.name.clone(),
            pose: Some(geometry::pose(&optical)),
        });
    }
    Ok(())
}
