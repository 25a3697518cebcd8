//! What a task asks for, as the server tells it.

use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::v1;

use super::obb::Obb;
use super::pose::read_pose;
use super::scene::SceneModel;

/// What a task asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// A thing is to be lifted and held.
    Lift {
        /// Index of the thing.
        item: usize,
    },
    /// A thing is to be put into a region and left there.
    Put {
        /// Index of the thing.
        item: usize,
        /// The region in `house`.
        region: Obb,
    },
    /// A slide is to be pulled open.
    Open {
        /// Index of the thing that slides.
        item: usize,
        /// Index of the slide.
        slide: usize,
        /// Wanted joint position, metres.
        position: f64,
    },
}

impl Goal {
    /// The thing that the hand takes.
    #[must_use]
    pub fn item(&self) -> usize {
        match self {
            Self::Lift { item } | Self::Put { item, .. } | Self::Open { item, .. } => *item,
        }
    }

    /// Reads what the scene's answer says; `None` without a task.
    ///
    /// # Errors
    /// [`Invalid`] when it names what is not there.
    pub fn read(reply: &v1::SceneReply, scene: &SceneModel) -> Result<Option<Self>, Invalid> {
        let Some(goal) = &reply.goal else {
            return Ok(None);
        };
        let unknown = |what: &'static str, value: &str, expected: &'static str| Invalid::Word {
            what,
            value: value.to_owned(),
            expected,
        };
        let item = scene
            .items
            .iter()
            .position(|item| item.name == goal.target)
            .ok_or_else(|| unknown("target of the goal", &goal.target, "a body that moves"))?;
        Ok(match goal.kind() {
            v1::GoalKind::Unspecified => None,
            v1::GoalKind::Lift => Some(Self::Lift { item }),
            v1::GoalKind::Put => {
                let region = goal.region.unwrap_or_default();
                Some(Self::Put {
                    item,
                    region: Obb {
                        pose: read_pose("pose of the region", region.pose.as_ref())?,
                        half: check::vector("half extents of the region", region.half.as_ref())?
                            .into(),
                        round: false,
                    },
                })
            }
            v1::GoalKind::Open => {
                let slide = scene
                    .slides
                    .iter()
                    .position(|slide| slide.name == goal.joint)
                    .ok_or_else(|| {
                        unknown("joint of the goal", &goal.joint, "a joint of the scene")
                    })?;
                Some(Self::Open {
                    item,
                    slide,
                    position: check::within("position of the goal", goal.position, 0.0, 2.0)?,
                })
            }
        })
    }
}
