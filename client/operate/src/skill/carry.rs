//! Carry: brings what is in the hand back towards the chair.

use nalgebra::{Translation3, Vector3};
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step};

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Carry {
    motion: Option<Motion>,
}

impl Skill for Carry {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        if let Some(why) = now.slipped() {
            return Step::Missed(why);
        }
        if self.motion.is_none() {
            let at = now.house_from_desired();
            // Back along the hand, level; a hand from above goes towards the chair.
            let back = at.rotation * -Vector3::z();
            let chair = now.seen.house_from_chair.rotation * -Vector3::x();
            let level = Vector3::new(back.x, back.y, 0.0);
            let direction = if level.norm() > 0.5 { level } else { chair };
            let stop = Translation3::from(direction.normalize() * now.profile.retract) * at;
            if !now.reaches(&[stop]) {
                return Step::Done;
            }
            self.motion = Some(Motion::new(now, &[(stop, now.profile.carry_speed)]));
        }
        match self.motion.as_ref().map(|motion| motion.step(now)) {
            Some(Progress::Moving(tool)) => Step::Going(Act {
                tool,
                ..Act::named(Phase::Retracting, "carrying")
            }),
            Some(Progress::Late(why)) => {
                now.note(format!("carrying: {why}"));
                Step::Done
            }
            Some(Progress::Arrived) | None => Step::Done,
        }
    }
}
