//! The tree of frames of a recording, for formats with one.

use super::Recording;
use crate::urdf::{Joint, Robot};

/// Joints whose child never moves in its parent: fixed ones, and those that are not
/// recorded and stay at zero.
pub(super) fn still<'a>(robot: &'a Robot, recorded: &[String]) -> Vec<&'a Joint> {
    let all = robot.joints().iter();
    all.filter(|joint| !joint.moves() || !recorded.contains(&joint.name))
        .collect()
}

/// Joints that move, each with its place among those that are recorded.
pub(super) fn moving<'a>(robot: &'a Robot, recorded: &[String]) -> Vec<(usize, &'a Joint)> {
    let all = robot.joints().iter().filter(|joint| joint.moves());
    let place = |joint: &Joint| recorded.iter().position(|name| *name == joint.name);
    all.filter_map(|joint| Some((place(joint)?, joint)))
        .collect()
}

/// Frames whose recorded poses are in the tree, as parent, link and place among
/// the frames: the chair, or all of them where the recording has no links.
pub(super) fn posed<'a>(
    recording: &'a Recording,
    robot: Option<&Robot>,
) -> Vec<(&'a str, &'a str, usize)> {
    let (described, roles) = (&recording.robot, &recording.roles);
    if robot.is_some() {
        return vec![("house", &described.root_link, roles.chair)];
    }
    let frames = described.frames.iter().enumerate();
    frames
        .map(|(place, f)| (f.parent.as_str(), f.link.as_str(), place))
        .collect()
}
