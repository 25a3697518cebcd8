//! The tree of frames of a recording, for formats with one.

use wheelarm_proto::{TopicId, v1};

use super::Recording;
use crate::read::ReadError;
use crate::urdf::{Joint, Robot};

/// The descriptions of a recording whose links are in the tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Descriptions {
    /// Absent where the recording has none that can be read.
    pub robot: Option<Robot>,
    /// The furniture; absent in recordings of earlier servers.
    pub furniture: Option<Robot>,
}

impl Descriptions {
    /// Reads those of the start of an episode.
    pub fn read(start: &v1::SnapshotReply) -> Self {
        Self {
            robot: Robot::from_assets(&start.assets),
            furniture: Robot::parse(&start.furniture_urdf).ok(),
        }
    }

    /// Joints of both whose child never moves in its parent.
    ///
    /// # Errors
    /// When the names of the recorded joints cannot be read.
    pub fn still(&self, recording: &Recording) -> Result<Vec<&Joint>, ReadError> {
        let episode = &recording.episode;
        let mut all = Vec::new();
        for (described, topic) in [
            (&self.robot, TopicId::JointState),
            (&self.furniture, TopicId::FurnitureJoint),
        ] {
            let recorded = match episode.has(topic.name()) {
                true => episode.names(topic.name(), "position")?,
                false => Vec::new(),
            };
            all.extend(described.iter().flat_map(|d| still(d, &recorded)));
        }
        Ok(all)
    }
}

/// Joints whose child never moves in its parent: fixed ones, and those that are not
/// recorded and stay at zero.
fn still<'a>(robot: &'a Robot, recorded: &[String]) -> Vec<&'a Joint> {
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
