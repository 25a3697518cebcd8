//! Fumble: raises what is in the hand a little and lets it go, on purpose.

use nalgebra::Translation3;
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step};
use crate::goal::Goal;

/// Height from which an object is dropped, metres: it mostly stays upright, and no task
/// counts it as lifted.
const HEIGHT: f64 = 0.02;
/// The same of what is soft, which falls over from higher.
const SOFT_HEIGHT: f64 = 0.004;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Fumble {
    motion: Option<Motion>,
}

impl Skill for Fumble {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let over = || Step::Missed("let go of it on purpose".to_owned());
        if matches!(now.goal, Goal::Open { .. } | Goal::Close { .. }) {
            return over();
        }
        if self.motion.is_none() {
            let taken = now.memory.candidate;
            let height = match taken.is_some_and(|candidate| candidate.force.is_some()) {
                true => SOFT_HEIGHT,
                false => HEIGHT,
            };
            let up = Translation3::new(0.0, 0.0, height) * now.house_from_desired();
            self.motion = Some(Motion::new(now, &[(up, now.profile.carry_speed)]));
        }
        match self.motion.as_ref().map(|motion| motion.step(now)) {
            Some(Progress::Moving(tool)) => Step::Going(Act {
                tool,
                ..Act::named(Phase::Retracting, "lifting")
            }),
            Some(Progress::Late(_) | Progress::Arrived) | None => over(),
        }
    }
}
