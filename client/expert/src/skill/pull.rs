//! Pull: pulls furniture on a joint open by its handle, or pushes it shut: with the arm as
//! far as it reaches, then with the chair. What turns takes the hand along its arc: a chair
//! that rolls straight would pull the handle out of the hand. Where the arm does not reach the
//! rest, the chair rolls first, while the hand stays.

use nalgebra::Point3;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::v1::Phase;

use super::base_search::opened;
use super::motion::{Motion, Progress};
use super::push::Push;
use super::shift::Shift;
use super::{Act, Now, Skill, Step};
use crate::goal::Goal;
use crate::tool_path::Shape;

/// The joint may stay short of the hand's aim by this much, metres or, of what turns,
/// radians.
const SHORT: f64 = 0.01;
const SHORT_TURN: f64 = 0.03;
/// Shares of the distance that are tried with the arm alone.
const SHARES: [f64; 6] = [1.0, 0.8, 0.6, 0.4, 0.2, 0.1];
/// The handle has slipped when it moved this far in the hand, metres.
const SLIP: f64 = 0.02;
/// Rolls of the chair between parts of an arc.
const SHIFTS: usize = 3;
/// Overlap of the legs along an arc: the hand does not stop between them.
const OVERLAP: f64 = 0.5;
/// Speed of the chair while it pulls, m/s.
const BACK: f64 = 0.08;
/// Longest time for the chair to pull, seconds.
const LONGEST: f64 = 12.0;

#[derive(Clone, Debug)]
enum State {
    Choose,
    Arm(Motion),
    Shift(Shift),
    Chair {
        since: f64,
    },
    Stop {
        since: f64,
    },
    /// Closed fingers push a door.
    Push(Push),
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Pull {
    state: State,
    shifts: usize,
}

impl Pull {
    /// Begins.
    #[must_use]
    pub fn new() -> Self {
        Self {
            state: State::Choose,
            shifts: 0,
        }
    }
}

impl Default for Pull {
    fn default() -> Self {
        Self::new()
    }
}

impl Pull {
    /// The movement by `way`, metres or radians, of a slide that is open by `at`.
    fn choose(&mut self, now: &mut Now<'_>, (slide, way): (usize, f64), at: &str) -> State {
        let joint = &now.scene.slides[slide];
        let (turns, lags) = (joint.motion == JointMotion::Turns, joint.lags());
        let start = now.house_from_desired();
        let tool = now.scene.tool_length;
        let pulled =
            |[share, lag]: [f64; 2]| joint.carried_about_bar(&start, way * share, (lag, tool));
        let mut whole = lags.iter().map(|lag| pulled([1.0, *lag]));
        if turns && self.shifts < SHIFTS && !whole.any(|way| now.reaches_gently(&way)) {
            self.shifts += 1;
            let ways: Vec<_> = lags.iter().map(|lag| pulled([1.0, *lag])).collect();
            let opened = opened(now).unwrap_or_else(|| now.scene.footprint_check(now.poses));
            if let Some(shift) = Shift::plan(now, &ways, &opened) {
                now.note(format!("rolls {:.2} m at {at}", shift.length));
                return State::Shift(shift);
            }
        }
        let tries = SHARES.into_iter();
        let mut tries = tries.flat_map(|share| lags.iter().map(move |lag| [share, *lag]));
        // A handle slips out of a hand that is late.
        let gently = tries
            .clone()
            .find(|tried| now.reaches_gently(&pulled(*tried)));
        let found = gently.or_else(|| tries.find(|tried| now.reaches(&pulled(*tried))));
        let Some(found) = found else {
            return State::Chair {
                since: now.observation.time,
            };
        };
        let speed = 0.7 * now.profile.carry_speed;
        let stops = pulled(found).into_iter().map(|pose| (pose, speed));
        let shape = Shape {
            overlap: if turns { OVERLAP } else { 0.0 },
            ..Shape::default()
        };
        State::Arm(Motion::shaped(now, &stops.collect::<Vec<_>>(), &shape))
    }
}

impl Skill for Pull {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let pushes = now.memory.candidate.is_some_and(|one| one.push.is_some());
        if let (State::Choose, true) = (&self.state, pushes) {
            self.state = State::Push(Push::default());
        }
        if let State::Push(push) = &mut self.state {
            return push.step(now);
        }
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
            State::Push(_) => Step::Done,
            State::Choose => {
                let way = if left > 0.0 { way } else { 0.0 };
                self.state = self.choose(now, (slide, way), &at);
                Step::Going(act)
            }
            State::Arm(motion) => match motion.step(now) {
                Progress::Moving(tool) => Step::Going(Act { tool, ..act }),
                Progress::Late(_) | Progress::Arrived => {
                    if left <= short {
                        return Step::Done;
                    }
                    if joint.motion == JointMotion::Turns && self.shifts < SHIFTS {
                        self.state = State::Choose;
                        return Step::Going(act);
                    }
                    self.state = State::Chair {
                        since: now.observation.time,
                    };
                    Step::Going(act)
                }
            },
            State::Shift(shift) => match shift.step(now) {
                Some((tool, base)) => Step::Going(Act {
                    tool: Some(tool),
                    base: Some(base),
                    ..act
                }),
                None => {
                    self.state = State::Choose;
                    Step::Going(Act {
                        base: Some([0.0, 0.0]),
                        ..act
                    })
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
