//! Carry: brings what is in the hand back towards the chair; the chair may back off with it.

use nalgebra::{Isometry3, Translation3, Vector3};
use wheelarm_proto::v1::Phase;

use super::lift;
use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step};
use crate::base_placement::PLACEMENT_MARGIN;

/// Peak speed of a chair that backs off, m/s, for a drive at this speed, m/s.
const BACK: [f64; 2] = [0.12, 0.45];
/// Spacing at which the way back is checked, metres.
const SPACING: f64 = 0.05;
/// Room behind the chair beyond where it backs off to, metres.
const BEHIND: f64 = 0.10;
/// A chair that backs off starts and stops within this share of the time.
const RAMP: f64 = 0.3;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Carry {
    motion: Option<Motion>,
    /// Since when the chair backs off, for how long and at what peak speed, seconds, m/s.
    back_off: Option<(f64, f64, f64)>,
}

impl Carry {
    /// Speed of the chair, m/s; `None` when it need not move.
    fn chair(&self, time: f64) -> Option<f64> {
        let (since, seconds, peak) = self.back_off?;
        let share = (time - since) / seconds;
        let ramp = (share.min(1.0 - share) / RAMP).clamp(0.0, 1.0);
        Some(-peak * ramp)
    }
}

impl Skill for Carry {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        if let Some(why) = now.slipped() {
            return Step::Missed(why);
        }
        let time = now.seen.time;
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
            let speed = now.profile.carry_speed;
            self.motion = Some(lift::carried(now, &[(stop, speed)]));
            self.back_off = back_off(now, &at).map(|by| {
                let peak = BACK[0] * (now.profile.drive.speed / BACK[1]).min(1.0);
                (time, by / (peak * (1.0 - RAMP)), peak)
            });
        }
        let (base, name) = match self.chair(time) {
            Some(speed) => (Some([speed, 0.0]), "carrying and backing off"),
            None => (None, "carrying"),
        };
        let backs = self
            .back_off
            .is_some_and(|(since, seconds, _)| time < since + seconds);
        match self.motion.as_ref().map(|motion| motion.step(now)) {
            Some(Progress::Moving(tool)) => Step::Going(Act {
                tool,
                base,
                ..Act::named(Phase::Retracting, name)
            }),
            Some(_) if backs => Step::Going(Act {
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

/// How far the chair backs off with the object, metres, where the habit wants it and the way
/// back is free for chair and hand.
fn back_off(now: &Now<'_>, house_from_tool: &Isometry3<f64>) -> Option<f64> {
    let by = now.profile.habits?.back_off?;
    let footprint = now.scene.footprint_check(now.poses);
    let chair = now.seen.chair();
    let steps = ((by + BEHIND) / SPACING).ceil() as usize;
    let free = (1..=steps)
        .all(|i| footprint.is_free(&chair.rolled(-SPACING * i as f64, 0.0), PLACEMENT_MARGIN));
    let back = now.seen.house_from_chair.rotation * Vector3::x() * -by;
    let line = [*house_from_tool, Translation3::from(back) * house_from_tool];
    let item = now.goal.item();
    let taken = now.memory.candidate;
    let width = taken.map_or(0.0, |candidate| candidate.width);
    let around = now.scene.around(&line, now.poses, Some(item));
    (free && around.hand_is_free(&now.scene.hand, width, &line, 0.0)).then_some(by)
}
