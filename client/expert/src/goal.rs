//! Goal of a task, from the reply of the `scene` query.

use nalgebra::Point3;
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::geometry::normalized;
use wheelarm_proto::v1;

use super::scene::SceneModel;
use wheelarm_planning::obb::Obb;

/// Goal of a task.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// Lift an object and hold it.
    Lift {
        /// Index of the object.
        item: usize,
    },
    /// Put an object into a region and leave it there.
    Put {
        /// Index of the object.
        item: usize,
        /// The region in `house`.
        region: Obb,
    },
    /// Put an object into the lap and leave it there.
    Give {
        /// Index of the object.
        item: usize,
        /// The lap in `wheelchair_root`.
        lap: Obb,
    },
    /// Bring the tip of an object to the mouth and hold it there.
    Bring {
        /// Index of the object.
        item: usize,
        /// Its tip in its own frame.
        tip: Point3<f64>,
    },
    /// Furniture on a joint is to be pulled open.
    Open {
        /// Index of the sliding furniture.
        item: usize,
        /// Index of the slide.
        slide: usize,
        /// Wanted joint position, metres or radians.
        position: f64,
    },
    /// Furniture on a joint is to be pushed shut.
    Close {
        /// Index of the sliding furniture.
        item: usize,
        /// Index of the slide.
        slide: usize,
        /// Wanted joint position, metres or radians.
        position: f64,
    },
}

/// A joint is moved beyond the goal by this much, metres or, of what turns, radians.
const MORE: f64 = 0.02;
const MORE_TURN: f64 = 0.06;

impl Goal {
    /// The furniture on a joint to move, by its index among the slides.
    #[must_use]
    pub fn slide(&self) -> Option<usize> {
        match *self {
            Self::Lift { .. } | Self::Put { .. } | Self::Give { .. } | Self::Bring { .. } => None,
            Self::Open { slide, .. } | Self::Close { slide, .. } => Some(slide),
        }
    }

    /// The furniture on a joint to move and the position at which the hand aims, metres
    /// or radians: a little beyond the goal.
    #[must_use]
    pub fn aim(&self, scene: &SceneModel) -> Option<(usize, f64)> {
        let more = match scene.slides.get(self.slide()?)?.motion {
            JointMotion::Slides => MORE,
            JointMotion::Turns => MORE_TURN,
        };
        match *self {
            Self::Lift { .. } | Self::Put { .. } | Self::Give { .. } | Self::Bring { .. } => None,
            Self::Open {
                slide, position, ..
            } => Some((slide, position + more)),
            Self::Close {
                slide, position, ..
            } => Some((slide, (position - more).max(0.0))),
        }
    }

    /// The region in `house` into which an object is put.
    #[must_use]
    pub fn region(&self) -> Option<Obb> {
        match self {
            Self::Put { region, .. } => Some(*region),
            Self::Lift { .. }
            | Self::Give { .. }
            | Self::Bring { .. }
            | Self::Open { .. }
            | Self::Close { .. } => None,
        }
    }

    /// The object that the hand grasps.
    #[must_use]
    pub fn item(&self) -> usize {
        match self {
            Self::Lift { item }
            | Self::Put { item, .. }
            | Self::Give { item, .. }
            | Self::Bring { item, .. }
            | Self::Open { item, .. }
            | Self::Close { item, .. } => *item,
        }
    }

    /// Reads the goal of the scene; `None` without a task.
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
            v1::GoalKind::Bring => {
                let tip = check::vector("tip of the goal", goal.tip.as_ref())?;
                Some(Self::Bring {
                    item,
                    tip: tip.into(),
                })
            }
            kind @ (v1::GoalKind::Put | v1::GoalKind::Give) => {
                let region = goal.region.unwrap_or_default();
                let region = Obb {
                    pose: normalized("pose of the region", region.pose.as_ref())?,
                    half: check::vector("half extents of the region", region.half.as_ref())?.into(),
                    round: false,
                };
                Some(match kind {
                    v1::GoalKind::Give => Self::Give { item, lap: region },
                    _ => Self::Put { item, region },
                })
            }
            kind @ (v1::GoalKind::Open | v1::GoalKind::Close) => {
                let slide = scene
                    .slides
                    .iter()
                    .position(|slide| slide.name == goal.joint)
                    .ok_or_else(|| {
                        unknown("joint of the goal", &goal.joint, "a joint of the scene")
                    })?;
                let position = check::within("position of the goal", goal.position, 0.0, 3.2)?;
                Some(match kind {
                    v1::GoalKind::Close => Self::Close {
                        item,
                        slide,
                        position,
                    },
                    _ => Self::Open {
                        item,
                        slide,
                        position,
                    },
                })
            }
        })
    }
}
