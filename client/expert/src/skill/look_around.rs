//! Appearance around: turns the chair on the spot until the robot faces the target, half of
//! the operators to the wrong side first, so that images before the drive show the target.

use wheelarm_proto::exact;
use wheelarm_proto::v1::Phase;

use super::stow::Stow;
use super::{Act, Now, Skill, Step};
use crate::drive::Drive;
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2, wrap};
use wheelarm_planning::hybrid_a_star::Segment;

/// Turn to the side where the target is not, radians.
const WRONG_SIDE: f64 = 0.7;
/// Room that the chair keeps while it turns, metres.
const ROOM: f64 = 0.02;
/// Step of the headings that are checked, radians.
const STEP: f64 = 0.1;
/// Time for which the chair faces the target, seconds.
const FACES: f64 = 0.6;

/// A turn smaller than this is left out, radians.
const LEAST: f64 = 0.05;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct LookAround {
    stow: Stow,
    planned: bool,
    /// Turns that are left, the next one last, radians.
    turns: Vec<f64>,
    turning: Option<(Drive, f64)>,
}

/// Turns, the last one first: to the wrong side where `wrong_side` holds and there is
/// room, and to the target at `bearing`. `None` where the chair has no room.
fn turns(
    footprint: &FootprintCheck,
    chair: &Pose2,
    bearing: f64,
    wrong_side: bool,
) -> Option<Vec<f64>> {
    let is_free = |to: f64| {
        let steps = (to.abs() / STEP).ceil();
        (0..=steps as u32).all(|i| {
            let turned = chair.turned(to * f64::from(i) / steps.max(1.0));
            footprint.is_free(&turned, ROOM)
        })
    };
    let aside = -WRONG_SIDE.copysign(bearing);
    if !is_free(bearing) {
        return None;
    }
    Some(match wrong_side && is_free(aside) {
        true => vec![bearing - aside, aside],
        false => vec![bearing],
    })
}

impl LookAround {
    fn plan(&mut self, now: &mut Now<'_>) {
        self.planned = true;
        let chair = now.observation.chair();
        let target = now.poses[now.goal.item()].translation;
        let bearing = exact::atan2(target.y - chair.y, target.x - chair.x);
        let bearing = wrap(bearing - chair.heading);
        let footprint = now.scene.footprint_check(now.poses);
        // Half of the profiles retract further than this, m.
        let wrong_side = now.profile.retract > 0.105;
        match turns(&footprint, &chair, bearing, wrong_side) {
            Some(turns) => {
                now.note(format!("looks around, {:.0}°", bearing.to_degrees()));
                self.turns = turns;
            }
            None => now.note("has no room to look around".to_owned()),
        }
    }
}

impl Skill for LookAround {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        match self.stow.step(now) {
            Step::Done => {}
            other => return other,
        }
        if !self.planned {
            self.plan(now);
        }
        let act = |base| {
            Step::Going(Act {
                base: Some(base),
                ..Act::named(Phase::Navigating, "looking around")
            })
        };
        if let Some((drive, begun)) = &self.turning {
            let time = now.observation.time - begun;
            if time <= drive.duration() {
                return act(drive.command(time, &now.observation.chair()));
            }
            if time <= drive.duration() + FACES {
                return act([0.0, 0.0]);
            }
            self.turning = None;
        }
        match self.turns.pop() {
            None => Step::Done,
            Some(turn) if turn.abs() < LEAST => act([0.0, 0.0]),
            Some(turn) => {
                let turn = [Segment::Turn(turn)];
                let drive = Drive::new(now.observation.chair(), &turn, &now.profile.drive);
                self.turning = Some((drive, now.observation.time));
                act([0.0, 0.0])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_planning::footprint_check::{Outline, Rectangle};

    #[test]
    fn chair_turns_to_the_target_when_there_is_room() {
        let outline = Outline {
            sides: [-0.4, 0.8, -0.3, 0.3],
        };
        let mut footprint = FootprintCheck::from_outlines([(1.0, outline)]);
        let chair = Pose2 {
            x: 0.0,
            y: 0.0,
            heading: 0.0,
        };
        assert_eq!(turns(&footprint, &chair, 0.5, false), Some(vec![0.5]));
        assert_eq!(turns(&footprint, &chair, 0.5, true), Some(vec![1.2, -0.7]));
        let post = Rectangle {
            centre: [0.6, 0.5],
            half: [0.05, 0.05],
            along: [1.0, 0.0],
        };
        footprint.put(post, [0.0, 1.0]);
        assert_eq!(turns(&footprint, &chair, 1.0, false), None);
    }
}
