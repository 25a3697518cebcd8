//! Carry: brings what is in the hand back towards the chair; the chair may back off with it.

use nalgebra::{Translation3, Vector3};
use wheelarm_proto::v1::Phase;

use super::back_off::{BACKING_OFF, BackOff};
use super::lift;
use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step};
use crate::goal::Goal;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Carry {
    motion: Option<Motion>,
    back_off: Option<BackOff>,
}

impl Skill for Carry {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        if let Some(why) = now.slipped() {
            return Step::Missed(why);
        }
        let time = now.observation.time;
        if self.motion.is_none() {
            let at = now.house_from_desired();
            // Back along the hand, level; a hand from above moves towards the chair.
            let back = at.rotation * -Vector3::z();
            let chair = now.observation.house_from_chair.rotation * -Vector3::x();
            let level = Vector3::new(back.x, back.y, 0.0);
            let direction = if level.norm() > 0.5 { level } else { chair };
            let stop = Translation3::from(direction.normalize() * now.profile.retract) * at;
            if !now.reaches(&[stop]) {
                return Step::Done;
            }
            let speed = now.profile.carry_speed;
            self.motion = Some(lift::carried(now, &[(stop, speed)]));
            // The way to the person is longer, and the chair backs off on it.
            self.back_off = match now.goal {
                Goal::Bring { .. } | Goal::Give { .. } => None,
                _ => BackOff::plan(now, &[at], 0.0),
            };
        }
        let backs = self.back_off.filter(|back_off| !back_off.is_over(time));
        let base = self.back_off.map(|back_off| back_off.command(time));
        let name = match backs {
            Some(_) => BACKING_OFF,
            None => "carrying",
        };
        match self.motion.as_ref().map(|motion| motion.step(now)) {
            Some(Progress::Moving(tool)) => Step::Going(Act {
                tool,
                base,
                ..Act::named(Phase::Retracting, name)
            }),
            Some(_) if backs.is_some() => Step::Going(Act {
                base,
                ..Act::named(Phase::Retracting, name)
            }),
            Some(Progress::Late(why)) => {
                now.note(format!("carrying: {why}"));
                Step::Done
            }
            Some(Progress::Arrived) | None => Step::Done,
        }
    }
}
