//! Pull: pulls furniture on a joint open by its handle, or pushes it shut: with the arm as
//! far as it reaches, then with the chair. What turns takes the hand along its arc.

use nalgebra::Point3;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step};
use crate::goal::Goal;

/// The joint may stay short of the hand's aim by this much, metres or, of what turns,
/// radians.
const SHORT: f64 = 0.01;
const SHORT_TURN: f64 = 0.03;
/// Shares of the distance that are tried with the arm alone.
const SHARES: [f64; 6] = [1.0, 0.8, 0.6, 0.4, 0.2, 0.1];
/// The handle has slipped when it moved this far in the hand, metres.
const SLIP: f64 = 0.02;
/// Speed of the chair while it pulls, m/s.
const BACK: f64 = 0.08;
/// Longest time for the chair to pull, seconds.
const LONGEST: f64 = 12.0;

#[derive(Clone, Debug)]
enum State {
    Choose,
    Arm(Motion),
    Chair { since: f64 },
    Stop { since: f64 },
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Pull {
    state: State,
}

impl Pull {
    /// Begins.
    #[must_use]
    pub fn new() -> Self {
        Self {
            state: State::Choose,
        }
    }
}

impl Default for Pull {
    fn default() -> Self {
        Self::new()
    }
}

impl Skill for Pull {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let Some((slide, aim)) = now.goal.aim(now.scene) else {
            return Step::Impossible("there is nothing to pull".to_owned());
        };
        let opens = !matches!(now.goal, Goal::Close { .. });
        let open = now.observation.slides.get(slide).copied().unwrap_or(0.0);
        // Along the axis, still to go; past the aim is as good.
        let way = aim - open;
        let left = if opens { way } else { -way };
        let joint = &now.scene.slides[slide];
        let (short, at) = match joint.motion {
            JointMotion::Slides => (SHORT, format!("{open:.3} m")),
            JointMotion::Turns => (SHORT_TURN, format!("{:.0}°", open.to_degrees())),
        };
        let act = Act::named(Phase::Retracting, if opens { "pulling" } else { "pushing" });
        // At the handle: the hand may turn about a bar.
        let grip = Point3::new(0.0, 0.0, now.scene.tool_length);
        let slipped = now.memory.held.is_some_and(|held| {
            let moved = now.object_in_hand() * held.inverse_transform_point(&grip) - grip;
            moved.norm() > SLIP
        });
        if slipped && left > short {
            return Step::Missed(format!("the handle slipped at {at}"));
        }
        match self.state.clone() {
            State::Choose => {
                let start = now.house_from_desired();
                let way = if left > 0.0 { way } else { 0.0 };
                let tool = now.scene.tool_length;
                let pulled = |[share, lag]: [f64; 2]| {
                    joint.carried_about_bar(&start, way * share, (lag, tool))
                };
                let lags = joint.lags();
                let tries = SHARES.into_iter();
                let tries = tries.flat_map(|share| lags.iter().map(move |lag| [share, *lag]));
                // A handle slips out of a hand that is late.
                let whole = tries
                    .clone()
                    .find(|tried| now.reaches_gently(&pulled(*tried)));
                let found = whole.or_else(|| {
                    let mut tries = tries;
                    tries.find(|tried| now.reaches(&pulled(*tried)))
                });
                self.state = match found {
                    Some(found) => {
                        let speed = 0.7 * now.profile.carry_speed;
                        let stops: Vec<_> = (pulled(found).into_iter())
                            .map(|pose| (pose, speed))
                            .collect();
                        State::Arm(Motion::new(now, &stops))
                    }
                    None => State::Chair {
                        since: now.observation.time,
                    },
                };
                Step::Going(act)
            }
            State::Arm(motion) => match motion.step(now) {
                Progress::Moving(tool) => Step::Going(Act { tool, ..act }),
                Progress::Late(_) | Progress::Arrived => {
                    if left <= short {
                        return Step::Done;
                    }
                    self.state = State::Chair {
                        since: now.observation.time,
                    };
                    Step::Going(act)
                }
            },
            State::Chair { since } => {
                if left <= short {
                    self.state = State::Stop {
                        since: now.observation.time,
                    };
                } else if now.observation.time - since > LONGEST {
                    return Step::Missed(format!("the furniture stays at {at}"));
                }
                Step::Going(Act {
                    base: Some([if opens { -BACK } else { BACK }, 0.0]),
                    ..act
                })
            }
            State::Stop { since } => {
                if now.observation.time - since > 0.5 {
                    return Step::Done;
                }
                Step::Going(Act {
                    base: Some([0.0, 0.0]),
                    ..act
                })
            }
        }
    }
}
