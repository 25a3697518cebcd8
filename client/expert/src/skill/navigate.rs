//! Navigate: looks for a base placement and a path to it, drives there, waits
//! until the chair is at rest.
//!
//! The arm stays home on the way. Where the chair finds no place or no path with it, and the
//! robot has a travel posture, the arm is stowed first and returns home at the stop.

use wheelarm_proto::v1::Phase;

use super::base_search::find;
use super::prepare::Prepare;
use super::stow::Stow;
use super::{Act, Now, Skill, Step};
use crate::base_placement;
use crate::drive::Drive;
use crate::grasp_candidate::GraspCandidate;
use crate::scene::SceneModel;
use wheelarm_planning::floor_map::STOWED_CLEARANCE;

pub use super::base_search::Purpose;

/// Longest time of the arm into the travel posture or home, seconds.
const FOLDING: f64 = 15.0;

#[derive(Clone, Debug)]
enum State {
    Plan,
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

/// Greatest speed with the arm stowed, m/s: the chair begins to turn late, and doors are narrow.
const STOWED_SPEED: f64 = 0.2;

/// See the module.
#[derive(Clone, Debug)]
pub struct Navigate {
    purpose: Purpose,
    state: State,
    /// The chair drives with the arm in the travel posture.
    is_stowed: bool,
}

impl Navigate {
    /// Begins.
    #[must_use]
    pub fn new(purpose: Purpose) -> Self {
        Self {
            purpose,
            state: State::Plan,
            is_stowed: false,
        }
    }

    fn plan(&mut self, now: &mut Now<'_>) -> Step {
        let (drive, candidate) = match find(now, self.purpose) {
            Ok(found) => found,
            Err(why) => match self.find_stowed(now) {
                Some(found) => found,
                None => return Step::Impossible(why),
            },
        };
        let stop = drive.goal();
        let posture = if self.is_stowed {
            " with the arm stowed"
        } else {
            ""
        };
        now.note(format!(
            "drives to ({:.2}, {:.2}) heading {:.0}° in {:.1} s{posture}",
            stop.x,
            stop.y,
            stop.heading.to_degrees(),
            drive.duration()
        ));
        let prepare = match self.purpose {
            Purpose::Put => None,
            Purpose::Take => {
                now.memory.planned = Some(now.object().inv_mul(&candidate.grasp));
                let at = base_placement::standing(&stop);
                match self.is_stowed {
                    true => None,
                    false => Prepare::plan(now, &at, &candidate, drive.duration()),
                }
            }
        };
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

    /// The drive for a chair with the arm in the travel posture. An arm that holds something
    /// is not stowed.
    fn find_stowed(&mut self, now: &mut Now<'_>) -> Option<(Drive, GraspCandidate)> {
        let travel = now.scene.travel.as_ref()?;
        if self.purpose == Purpose::Put {
            return None;
        }
        let scene = SceneModel {
            outlines: travel.outlines.clone(),
            ..now.scene.clone()
        };
        for margin in [now.profile.path.margin, STOWED_CLEARANCE] {
            let mut profile = *now.profile;
            profile.path.margin = margin;
            profile.drive.speed = profile.drive.speed.min(STOWED_SPEED);
            let mut stowed = Now {
                scene: &scene,
                goal: now.goal,
                profile: &profile,
                observation: now.observation,
                poses: now.poses,
                reach: &mut *now.reach,
                shown: now.shown,
                memory: &mut *now.memory,
            };
            if let Ok(found) = find(&mut stowed, self.purpose) {
                self.is_stowed = true;
                return Some(found);
            }
        }
        None
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
                Self::posture(now, now.scene.home, *since, "unfolding").unwrap_or(Step::Done)
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
                        return Step::Done;
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
