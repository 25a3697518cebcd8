//! The milestones of an episode by kind of goal, and the progress that they measure.

use serde::{Deserialize, Serialize};
use wheelarm_proto::v1;

/// A step towards a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Milestone {
    /// The chair was at rest with the target in the arm's range.
    InReach,
    /// The hand touched the target.
    Touched,
    /// Both pads pressed the target.
    Gripped,
    /// The gripped target was lifted.
    Lifted,
    /// The object to place was above its region.
    OverRegion,
    /// The slide moved in the required direction.
    Moved,
    /// The slide moved half the way.
    HalfWay,
    /// The task's conditions held at its end.
    Done,
}

impl Milestone {
    /// Name for reports.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::InReach => "stopped in reach",
            Self::Touched => "touched",
            Self::Gripped => "both pads",
            Self::Lifted => "lifted",
            Self::OverRegion => "over the region",
            Self::Moved => "moved",
            Self::HalfWay => "half way",
            Self::Done => "done",
        }
    }
}

/// The steps to a kind of goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// No task.
    #[default]
    None,
    /// An object is lifted and held.
    Lift,
    /// An object is placed in a region.
    Put,
    /// A slide is opened or closed.
    Slide,
}

impl Way {
    /// The steps for a kind of goal.
    #[must_use]
    pub fn for_goal(goal: v1::GoalKind) -> Self {
        match goal {
            v1::GoalKind::Unspecified => Self::None,
            // A given object is lifted; its destination moves with the chair.
            v1::GoalKind::Lift | v1::GoalKind::Give | v1::GoalKind::Bring => Self::Lift,
            v1::GoalKind::Put => Self::Put,
            v1::GoalKind::Open | v1::GoalKind::Close => Self::Slide,
        }
    }

    /// The steps in order, each with its share of the way, percent.
    #[must_use]
    pub fn steps(self) -> &'static [(Milestone, u8)] {
        use Milestone as M;
        match self {
            Self::None => &[(M::Done, 100)],
            Self::Lift => &[
                (M::InReach, 20),
                (M::Touched, 40),
                (M::Gripped, 60),
                (M::Lifted, 80),
                (M::Done, 100),
            ],
            Self::Put => &[
                (M::InReach, 15),
                (M::Touched, 30),
                (M::Gripped, 45),
                (M::Lifted, 60),
                (M::OverRegion, 80),
                (M::Done, 100),
            ],
            Self::Slide => &[
                (M::InReach, 20),
                (M::Touched, 40),
                (M::Moved, 60),
                (M::HalfWay, 80),
                (M::Done, 100),
            ],
        }
    }
}

/// Progress of an episode.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// The steps of its goal.
    pub way: Way,
    /// The furthest step that was reached, percent of the way.
    pub percent: u8,
    /// Reached steps with simulated seconds into the episode, in the order of the way.
    pub reached: Vec<(Milestone, f64)>,
    /// The step after the furthest reached one; absent at the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing: Option<Milestone>,
    /// Pairs of bodies in hard contacts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hard_contacts: Vec<String>,
}
