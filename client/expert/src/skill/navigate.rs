//! Navigate: looks for a base placement and a path to it, drives there, waits
//! until the chair is at rest.
//!
//! The arm stays home on the way. Where the chair finds no place or no path with it, and the
//! robot has a travel posture, the arm is stowed where it has room, and returns home where it
//! has room again: at the stop, or before it.

use wheelarm_proto::v1::Phase;

use super::base_search::{find, find_narrow};
use super::motion::{Motion, Progress};
use super::prepare::Prepare;
use super::stow::Stow;
use super::stowed_drive::{self, Leg};
use super::{Act, Now, Skill, Step, tuck};
use crate::base_placement;
use crate::drive::Drive;
use crate::grasp_candidate::GraspCandidate;

pub use super::base_search::Purpose;

/// Longest time of the arm into the travel posture or home, seconds.
const FOLDING: f64 = 15.0;
/// Most drives to one stop.
const LEGS: usize = 6;

#[derive(Clone, Debug)]
enum State {
    Plan,
    /// The hand brings what it holds to where it is at home.
    Tuck(Motion),
    /// The arm moves into the travel posture before the drive.
    Fold {
        drive: Drive,
        since: f64,
    },
    Drive {
        drive: Drive,
        begun: f64,
        prepare: Option<Prepare>,
    },
    Rest {
        since: f64,
    },
    /// The arm returns home after a drive in the travel posture.
    Unfold {
        since: f64,
    },
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Navigate {
    purpose: Purpose,
    state: State,
    /// The chair drives with the arm in the travel posture.
    is_stowed: bool,
    /// The drive ends where the arm changes its posture: the next one is planned there.
    is_between: bool,
    /// The chair is where the arm has room to be stowed.
    wants_stowed: bool,
    /// The hand has brought what it holds to where it is at home, or cannot.
    is_tucked: bool,
    /// Drives that were planned.
    legs: usize,
}

impl Navigate {
    /// Begins.
    #[must_use]
    pub fn new(purpose: Purpose) -> Self {
        Self {
            purpose,
            state: State::Plan,
            is_stowed: false,
            is_between: false,
            wants_stowed: false,
            is_tucked: false,
            legs: 0,
        }
    }

    fn plan(&mut self, now: &mut Now<'_>) -> Step {
        now.memory.arm_checks = 0;
        let region = now.goal.region();
        let is_far = region.is_some_and(|region| tuck::is_far(&now.object(), &region));
        if self.purpose == Purpose::Put && (is_far || self.is_tucked) {
            return self.plan_with_held(now);
        }
        self.legs += 1;
        if self.legs > LEGS {
            let why = format!("no place to stop after {LEGS} drives");
            return Step::Impossible(why);
        }
        let travel = now.scene.travel.as_ref();
        if travel.is_some_and(|travel| Stow::is_home(&now.observation.arm, &travel.joints)) {
            let Some(drive) = stowed_drive::to_return(now) else {
                let why = "no place where the arm has room to leave its travel posture";
                return Step::Impossible(why.to_owned());
            };
            self.is_stowed = true;
            self.is_between = true;
            return self.set_off(now, drive, None);
        }
        self.is_stowed = false;
        self.is_between = false;
        let own = match self.wants_stowed {
            true => Err("no place to stop after the arm was stowed".to_owned()),
            false => find(now, self.purpose),
        };
        let why = match own {
            Ok((drive, candidate)) => return self.set_off(now, drive, Some(candidate)),
            Err(why) => why,
        };
        let narrow = match self.wants_stowed {
            true => None,
            false => find_narrow(now, self.purpose),
        };
        if let Some((drive, candidate)) = narrow {
            return self.set_off(now, drive, Some(candidate));
        }
        // An arm that holds something is not stowed.
        let leg = match self.purpose {
            Purpose::Take => stowed_drive::plan(now, self.purpose),
            Purpose::Put => None,
        };
        self.wants_stowed = matches!(leg, Some(Leg::ToStow(_)));
        match leg {
            None => Step::Impossible(why),
            Some(Leg::Stop(drive, candidate)) => {
                self.is_stowed = true;
                self.set_off(now, drive, Some(*candidate))
            }
            Some(Leg::ToReturn(drive)) => {
                (self.is_stowed, self.is_between) = (true, true);
                self.set_off(now, drive, None)
            }
            Some(Leg::ToStow(drive)) => {
                self.is_between = true;
                self.set_off(now, drive, None)
            }
        }
    }

    /// Plans a long way with what is held.
    fn plan_with_held(&mut self, now: &mut Now<'_>) -> Step {
        if !std::mem::replace(&mut self.is_tucked, true) {
            if let Some(motion) = tuck::plan(now) {
                self.state = State::Tuck(motion);
                return Step::Going(Act::named(Phase::Retracting, "carrying"));
            }
            now.note("no free path of the hand to where it is at home".to_owned());
        }
        let (with_held, slow) = (tuck::with_held(now), now.profile.in_narrow_places());
        let mut why = String::new();
        for scene in [&with_held, now.scene] {
            let mut now = Now {
                scene,
                goal: now.goal,
                profile: &slow,
                observation: now.observation,
                poses: now.poses,
                reach: &mut *now.reach,
                shown: now.shown,
                memory: &mut *now.memory,
            };
            match find(&mut now, self.purpose) {
                Ok((drive, candidate)) => return self.set_off(&mut now, drive, Some(candidate)),
                Err(words) => why = words,
            }
            if let Some((drive, candidate)) = find_narrow(&mut now, self.purpose) {
                return self.set_off(&mut now, drive, Some(candidate));
            }
        }
        Step::Impossible(why)
    }

    /// Begins a drive: to a stop for a candidate, or to where the arm changes its posture.
    fn set_off(
        &mut self,
        now: &mut Now<'_>,
        drive: Drive,
        candidate: Option<GraspCandidate>,
    ) -> Step {
        let stop = drive.goal();
        let posture = if self.is_stowed {
            " with the arm stowed"
        } else {
            ""
        };
        let purpose = match (self.is_between, self.is_stowed) {
            (false, _) => "",
            (true, true) => ", where it returns home",
            (true, false) => ", where it is stowed",
        };
        now.note(format!(
            "drives to ({:.2}, {:.2}) heading {:.0}° in {:.1} s{posture}{purpose}",
            stop.x,
            stop.y,
            stop.heading.to_degrees(),
            drive.duration()
        ));
        let mut prepare = None;
        if let (Purpose::Take, Some(candidate)) = (self.purpose, candidate) {
            now.memory.planned = Some(now.object().inv_mul(&candidate.grasp));
            if !self.is_stowed {
                let at = base_placement::standing(&stop);
                prepare = Prepare::plan(now, &at, &candidate, drive.duration());
            }
        }
        let time = now.observation.time;
        self.state = match self.is_stowed {
            true => State::Fold { drive, since: time },
            false => State::Drive {
                drive,
                begun: time,
                prepare,
            },
        };
        Step::Going(Act::named(Phase::Navigating, "planning"))
    }

    /// What follows a drive, with the arm at home.
    fn arrived(&mut self) -> Step {
        if !self.is_between {
            return Step::Done;
        }
        self.state = State::Plan;
        Step::Going(Act {
            base: Some([0.0, 0.0]),
            ..Act::named(Phase::Navigating, "planning")
        })
    }

    /// Moves the arm to `joints`, radians; `None` when it is there.
    fn posture(now: &Now<'_>, joints: [f64; 6], since: f64, name: &'static str) -> Option<Step> {
        if Stow::is_home(&now.observation.arm, &joints) {
            return None;
        }
        if now.observation.time - since > FOLDING {
            let why = "the arm does not get into its travel posture or home";
            return Some(Step::Impossible(why.to_owned()));
        }
        Some(Step::Going(Act {
            joints: Some(joints),
            base: Some([0.0, 0.0]),
            ..Act::named(Phase::Navigating, name)
        }))
    }
}

impl Skill for Navigate {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let still = Some([0.0, 0.0]);
        match &self.state {
            State::Plan => self.plan(now),
            State::Tuck(motion) => {
                if let Some(why) = now.slipped() {
                    return Step::Missed(why);
                }
                match motion.step(now) {
                    Progress::Moving(tool) => Step::Going(Act {
                        tool,
                        base: still,
                        ..Act::named(Phase::Retracting, "carrying")
                    }),
                    Progress::Late(_) | Progress::Arrived => self.plan(now),
                }
            }
            State::Fold { drive, since } => {
                let travel = now.scene.travel.as_ref().map(|travel| travel.joints);
                let joints = travel.unwrap_or(now.scene.home);
                if let Some(step) = Self::posture(now, joints, *since, "stowing") {
                    return step;
                }
                self.state = State::Drive {
                    drive: drive.clone(),
                    begun: now.observation.time,
                    prepare: None,
                };
                Step::Going(Act {
                    base: still,
                    ..Act::named(Phase::Navigating, "stowing")
                })
            }
            State::Unfold { since } => {
                let step = Self::posture(now, now.scene.home, *since, "unfolding");
                match step {
                    Some(step) => step,
                    None => self.arrived(),
                }
            }
            State::Drive {
                drive,
                begun,
                prepare,
            } => {
                let time = now.observation.time - begun;
                let mut act = Act::named(Phase::Navigating, "driving");
                if time > drive.duration() + 0.3 {
                    act.base = still;
                    self.state = State::Rest {
                        since: now.observation.time,
                    };
                } else {
                    act.base = Some(drive.command(time, &now.observation.chair()));
                    act.tool = prepare.as_ref().and_then(|prepare| prepare.target(time));
                    if act.tool.is_some() {
                        act.name = "driving and preparing";
                    }
                }
                Step::Going(act)
            }
            State::Rest { since } => {
                let [speed, rate] = now.observation.chair_speed;
                let waited = now.observation.time - since;
                if waited > 0.3 && (speed < 0.005 && rate.abs() < 0.01 || waited > 3.0) {
                    if !self.is_stowed {
                        return self.arrived();
                    }
                    self.state = State::Unfold {
                        since: now.observation.time,
                    };
                }
                Step::Going(Act {
                    base: still,
                    ..Act::named(Phase::Navigating, "stopping")
                })
            }
        }
    }
}
