//! Grasp: closes the gripper until both pads press and the fingers stall.

use wheelarm_proto::v1::Phase;

use super::play::{Play, Played};
use super::{Act, Now, Skill, Step};

/// A pad touches from this force, N.
const TOUCH: f64 = 2.0;
/// The knuckle has stalled within this, radians. Its angle counts and not its
/// speed, which a stiff contact shakes.
const STILL: f64 = 0.006;
/// The same for what is soft: the cap on the force moves the fingers there.
const SOFT_STILL: f64 = 0.03;
/// A grip is firm after the knuckle has stalled this long, seconds.
const FIRM: f64 = 0.3;
/// Longest time to close, seconds.
const LONGEST: f64 = 5.0;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Grasp {
    begun: Option<f64>,
    /// Knuckle angle and time of its last movement.
    still: Option<(f64, f64)>,
    /// As it was shown.
    play: Option<Play>,
}

impl Skill for Grasp {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let observation = now.observation;
        // Closed fingers push.
        if now.memory.candidate.is_some_and(|one| one.push.is_some()) {
            return Step::Done;
        }
        let begun = *self.begun.get_or_insert(observation.time);
        let mut act = Act::named(Phase::Grasping, "closing");
        if self.play.is_none()
            && let Some((one, _)) = now.taken_as()
            && let Some((frame, wander)) = now.memory.playing.clone()
        {
            let play = Play::new(now, &one.closing, &frame).off(wander);
            self.play = Some(play);
        }
        let shown = self.play.as_mut().map(|play| {
            let played = play.step(now);
            (played, play.time(now) < play.duration(), play.duration())
        });
        let begun = match shown {
            Some((Played::Moving(tool, opening), true, _)) => {
                return Step::Going(Act {
                    tool,
                    opening,
                    ..act
                });
            }
            // The held object may keep the hand a little off.
            Some((played, _, seconds)) => {
                if let Played::Moving(_, opening) = played {
                    act.opening = opening;
                }
                begun + seconds
            }
            None => {
                // The force cap stops the fingers at the object.
                if observation.time - begun < 0.05 {
                    act.opening = Some(0.0);
                }
                begun
            }
        };
        let touching = observation.pad_force.iter().all(|force| *force > TOUCH);
        let (knuckle, since) = *self
            .still
            .get_or_insert((observation.knuckle, observation.time));
        let soft = now
            .memory
            .candidate
            .is_some_and(|candidate| candidate.force.is_some());
        let still = if soft { SOFT_STILL } else { STILL };
        if !touching || (observation.knuckle - knuckle).abs() > still {
            self.still = Some((observation.knuckle, observation.time));
        } else if observation.time - since > FIRM {
            now.memory.held = Some(now.object_in_hand());
            return Step::Done;
        }
        if now.scene.hand.is_empty(observation.knuckle) {
            now.refuse_candidate();
            return Step::Missed("the fingers closed on nothing".to_owned());
        }
        if observation.time - begun > LONGEST {
            now.refuse_candidate();
            return Step::Missed("the fingers found no firm grip".to_owned());
        }
        Step::Going(act)
    }
}
