//! The plan of a goal: which skills reach it, in their order.

use crate::goal::Goal;
use crate::skill::Skill;
use crate::skill::bring::Bring;
use crate::skill::carry::Carry;
use crate::skill::grasp::Grasp;
use crate::skill::lift::Lift;
use crate::skill::navigate::{Navigate, Purpose};
use crate::skill::place::Place;
use crate::skill::pull::Pull;
use crate::skill::reach::Reach;
use crate::skill::release::Release;
use crate::skill::watch::Watch;

/// Extent of the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Extent {
    /// All of it, until the task's conditions hold.
    #[default]
    Task,
    /// Until the hand is in front of the object.
    Near,
    /// Until the object is held and lifted.
    Take,
    /// From there on: what the hand holds is put into the region.
    Put,
}

/// One step of the plan: the skill to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    Navigate(Purpose),
    Before,
    Reach,
    Grasp,
    Lift,
    Carry,
    Place,
    Bring,
    Pull,
    LetGo,
    Watch,
}

impl Stage {
    /// Its skill, at its beginning.
    pub fn begin(self) -> Box<dyn Skill> {
        match self {
            Self::Navigate(purpose) => Box::new(Navigate::new(purpose)),
            Self::Before => Box::new(Reach::before()),
            Self::Reach => Box::new(Reach::new()),
            Self::Grasp => Box::new(Grasp::default()),
            Self::Lift => Box::new(Lift::default()),
            Self::Carry => Box::new(Carry::default()),
            Self::Place => Box::new(Place::new()),
            Self::Bring => Box::new(Bring::new()),
            Self::Pull => Box::new(Pull::new()),
            Self::LetGo => Box::new(Release::let_go()),
            Self::Watch => Box::new(Watch::default()),
        }
    }
}

/// The skills that reach a goal, in their order.
pub fn plan(goal: &Goal, extent: Extent) -> &'static [Stage] {
    const TAKE: Stage = Stage::Navigate(Purpose::Take);
    match extent {
        Extent::Task => {}
        Extent::Near => return &[TAKE, Stage::Before],
        Extent::Take => return &[TAKE, Stage::Reach, Stage::Grasp, Stage::Lift],
        Extent::Put => return &[Stage::Navigate(Purpose::Put), Stage::Place],
    }
    match goal {
        Goal::Lift { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Carry,
            Stage::Watch,
        ],
        Goal::Put { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Place,
            Stage::Watch,
        ],
        Goal::Give { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Bring,
            Stage::LetGo,
            Stage::Watch,
        ],
        Goal::Bring { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Carry,
            Stage::Bring,
        ],
        Goal::Open { .. } | Goal::Close { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Pull,
            Stage::LetGo,
            Stage::Watch,
        ],
    }
}
