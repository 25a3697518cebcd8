//! The skills in the order that a goal asks for, and what to do when one of
//! them fails. Pure: observations in, actions out.
//!
//! `plan` is that order, `start` where in it to begin, `recovery` what follows a skill
//! that failed, `mistake` what is done wrong on purpose.

mod mistake;
mod plan;
mod recovery;
mod start;

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use wheelarm_proto::geometry;
use wheelarm_proto::person::FORCE_LIMIT;
use wheelarm_proto::v1::{self, Phase};

pub use self::plan::Extent;
use self::plan::{Stage, plan};
use super::base_placement::ArmReachability;
use super::demonstration::Demonstrations;
use super::forced::ForcedError;
use super::goal::Goal;
use super::observation::Observation;
use super::pace::Pace;
use super::profile::OperatorProfile;
use super::scene::SceneModel;
pub use super::skill::Act;
use super::skill::fumble::Fumble;
use super::skill::stow::Stow;
use super::skill::{Memory, Now, Skill, Step};

/// Result of the work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Outcome {
    /// The task's conditions hold.
    Success,
    /// Why it was abandoned.
    Failure(String),
    /// The simulation broke under its hands: not its fault.
    Broken(String),
}

impl Outcome {
    /// Whether the operator finished and the task's conditions hold.
    #[must_use]
    pub fn is_success(&self, evaluation: &v1::Evaluation) -> bool {
        *self == Self::Success && evaluation.success
    }

    /// Reason of a failure, as text; absent after success.
    #[must_use]
    pub fn why(&self, evaluation: &v1::Evaluation) -> Option<String> {
        match self {
            Self::Failure(why) | Self::Broken(why) => Some(why.clone()),
            Self::Success if evaluation.success => None,
            Self::Success => Some("the task's conditions no longer held at the end".to_owned()),
        }
    }
}

/// The whole work takes no longer than this, seconds of simulation time.
const LONGEST: f64 = 300.0;
/// Skills that may end at one tick.
const ENDINGS: usize = 4;

/// The operator of one episode.
pub struct Operator {
    scene: SceneModel,
    goal: Goal,
    extent: Extent,
    profile: OperatorProfile,
    shown: Demonstrations,
    /// Index of the stage in the plan.
    at: usize,
    skill: Box<dyn Skill>,
    /// The skill that runs instead of the plan's: letting go after a miss, or
    /// driving somewhere else.
    detour: Option<Box<dyn Skill>>,
    memory: Memory,
    begun: Option<f64>,
    attempts: usize,
    stops: usize,
    opened: bool,
    over: bool,
    trouble: Trouble,
    /// The requested goal, while the wrong object is grasped on purpose.
    requested: Option<Goal>,
    /// An error is being made on purpose.
    forcing: bool,
    /// An error was made that a firm grasp puts right.
    erred: bool,
    /// Error or recovery since the last command.
    incident: v1::Incident,
    /// The incident to report when the hand sets off for the wrong object.
    about_to: Option<v1::Incident>,
    longest: f64,
    /// The hand is not brought home first, as long as that works.
    on_the_spot: bool,
    /// The arm was in its travel posture at the start, and had no room to leave it.
    begun_stowed: bool,
    /// The human-like pace.
    pace: Option<Pace>,
    /// The chair turns towards the target before it drives.
    looks_around: bool,
    /// Time as the skills see it, and when it was last moved on, seconds.
    own_time: Option<(f64, f64)>,
}

/// Intentional difficulties of an episode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trouble {
    /// The scenario hinders the robot.
    pub hindered: bool,
    /// An error that the operator is to make.
    pub forced: Option<ForcedError>,
    /// The scenario's time limit, seconds of simulation time.
    pub time_limit: Option<f64>,
}

impl Operator {
    /// An operator that works towards `goal`.
    ///
    /// # Errors
    /// When the goal is missing, or the scene has no grasp for it.
    pub fn new(
        scene: SceneModel,
        goal: Option<Goal>,
        profile: OperatorProfile,
    ) -> Result<Self, String> {
        let goal =
            goal.ok_or("the scenario has no task with an object: choose one with `--task`")?;
        if !scene.grasps.iter().any(|grasp| grasp.item == goal.item()) {
            return Err(format!(
                "the scene names no grasp for {:?}",
                scene.items[goal.item()].name
            ));
        }
        let skill = plan(&goal, Extent::Task)[0].begin();
        Ok(Self {
            scene,
            goal,
            extent: Extent::Task,
            pace: profile.pace.map(Pace::new),
            profile,
            shown: Demonstrations::default(),
            at: 0,
            skill,
            detour: None,
            memory: Memory::default(),
            begun: None,
            attempts: 0,
            stops: 0,
            opened: false,
            over: false,
            trouble: Trouble::default(),
            requested: None,
            forcing: false,
            erred: false,
            incident: v1::Incident::Unspecified,
            about_to: None,
            longest: LONGEST,
            on_the_spot: false,
            begun_stowed: false,
            looks_around: false,
            own_time: None,
        })
    }

    /// Does only a part of the work.
    #[must_use]
    pub fn only(mut self, extent: Extent) -> Self {
        self.extent = extent;
        self.skill = plan(&self.goal, extent)[0].begin();
        self
    }

    /// Grasps the object only as one of the demonstrations `shown` does; with an empty
    /// list, by its own plan.
    #[must_use]
    pub fn shown(mut self, shown: Demonstrations) -> Self {
        // Demonstrations replace habits.
        if !shown.list.is_empty() {
            self.profile.habits = None;
        }
        self.shown = shown;
        self
    }

    /// The episode of the demonstration of the last grasp.
    #[must_use]
    pub fn source(&self) -> Option<&str> {
        let shown = self.memory.candidate.as_ref()?.shown?;
        let one = self.shown.list.get(shown.index)?;
        Some(&one.source)
    }

    /// Goes on from the present pose of the hand instead of stowing the arm and
    /// choosing a base placement. A policy then learns to correct small errors instead
    /// of beginning again. When the arm cannot reach the object from there, and after a
    /// miss, the operator begins again.
    #[must_use]
    pub fn on_the_spot(mut self) -> Self {
        self.on_the_spot = true;
        self
    }

    /// Turns on the spot until the robot faces the target, before it drives.
    #[must_use]
    pub fn looking_around(mut self) -> Self {
        self.looks_around = true;
        self
    }

    /// With something that may go wrong, on purpose.
    #[must_use]
    pub fn troubled(mut self, trouble: Trouble) -> Self {
        self.memory.hindered = trouble.hindered;
        self.memory.aside = trouble.forced == Some(ForcedError::WrongGrasp);
        self.longest = trouble.time_limit.unwrap_or(LONGEST);
        self.trouble = trouble;
        self
    }

    /// Error or recovery since the last call.
    pub fn incident(&mut self) -> v1::Incident {
        std::mem::take(&mut self.incident)
    }

    /// Notes for people since the last call.
    pub fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.memory.notes)
    }

    /// Decides the action of one control tick. The outcome is returned once, with the
    /// last action. At the human-like pace the skills use their own time, which stops
    /// during pauses and scales the speed of the chair.
    pub fn step(
        &mut self,
        observation: &Observation,
        arm: &mut dyn ArmReachability,
    ) -> (Act, Option<Outcome>) {
        let Some(pace) = &mut self.pace else {
            return self.decide(observation, arm);
        };
        let (mut own, last) = self
            .own_time
            .unwrap_or((observation.time, observation.time));
        let begun = self.begun.unwrap_or(observation.time);
        let rate = pace.rate(observation.time - begun);
        own += (observation.time - last) * rate;
        self.own_time = Some((own, observation.time));
        let mut slowed = observation.clone();
        slowed.time = own;
        let (mut act, outcome) = self.decide(&slowed, arm);
        act.base = act.base.map(|base| base.map(|v| v * rate));
        (act, outcome)
    }

    fn decide(
        &mut self,
        observation: &Observation,
        arm: &mut dyn ArmReachability,
    ) -> (Act, Option<Outcome>) {
        let holds = self.extent == Extent::Put;
        if self.begun.is_none() && !holds {
            self.set_off(observation);
        }
        let begun = *self.begun.get_or_insert(observation.time);
        let is_ready = !self.begun_stowed || Stow::is_home(&observation.arm, &self.scene.home);
        if self.detour.is_none() && !self.on_the_spot && is_ready {
            self.memory.home.get_or_insert(observation.base_from_tool);
        }
        if self.over {
            return (Act::named(Phase::Unspecified, "over"), None);
        }
        if self.extent == Extent::Task && observation.done && !observation.success {
            return self.finish(Outcome::Failure(format!(
                "the task failed: {}",
                observation.failure
            )));
        }
        if observation.person_force > FORCE_LIMIT {
            return self.finish(Outcome::Failure(format!(
                "the robot pressed the person with {:.0} N (limit {FORCE_LIMIT} N)",
                observation.person_force
            )));
        }
        if observation.time - begun > self.longest {
            let longest = self.longest;
            return self.finish(Outcome::Failure(format!("not done within {longest} s")));
        }
        let poses = self.scene.poses(observation);
        if let Some(ForcedError::WrongObject) = self.trouble.forced {
            self.trouble.forced = None;
            self.take_the_wrong_object(&poses);
        }
        for _ in 0..ENDINGS {
            let mut now = Now {
                scene: &self.scene,
                goal: &self.goal,
                profile: &self.profile,
                observation,
                poses: &poses,
                reach: &mut *arm,
                shown: &self.shown,
                memory: &mut self.memory,
            };
            let skill = self.detour.as_mut().unwrap_or(&mut self.skill);
            let was_aside = now.memory.aside;
            let step = skill.step(&mut now);
            if was_aside && !self.memory.aside {
                self.force(ForcedError::WrongGrasp);
            }
            match step {
                Step::Going(mut act) => {
                    // The hand starts open, whatever it was left at.
                    if !self.opened && !holds {
                        self.opened = true;
                        act.opening.get_or_insert(self.scene.hand.stroke);
                    }
                    return (act, None);
                }
                Step::Done => {
                    if let Some(outcome) = self.done() {
                        return self.finish(outcome);
                    }
                }
                Step::Missed(why) => {
                    if let Some(outcome) = self.missed(&why) {
                        return self.finish(outcome);
                    }
                }
                Step::Elsewhere(why) => {
                    if let Some(outcome) = self.elsewhere(why) {
                        return self.finish(outcome);
                    }
                }
                Step::Impossible(why) => match self.requested.take() {
                    Some(goal) => self.correct(goal),
                    None => return self.finish(Outcome::Failure(why)),
                },
            }
        }
        (Act::named(Phase::Unspecified, "thinking"), None)
    }

    /// Chooses what follows a completed skill.
    fn done(&mut self) -> Option<Outcome> {
        if self.detour.take().is_some() {
            return None;
        }
        let stage = plan(&self.goal, self.extent).get(self.at).copied();
        if stage == Some(Stage::Grasp) {
            if let Some(goal) = self.requested.take() {
                self.correct(goal);
                return None;
            }
            self.forcing = false;
            if std::mem::take(&mut self.erred) {
                self.incident = v1::Incident::Recovered;
                self.memory.notes.push("has it again".to_owned());
            }
            if self.trouble.forced == Some(ForcedError::Drop) {
                self.force(ForcedError::Drop);
                self.detour = Some(Box::new(Fumble::default()));
            }
        }
        self.at += 1;
        match plan(&self.goal, self.extent).get(self.at) {
            Some(stage) => {
                if *stage == Stage::Reach
                    && let Some(incident) = self.about_to.take()
                {
                    self.incident = incident;
                }
                self.skill = stage.begin();
                None
            }
            None => Some(Outcome::Success),
        }
    }

    fn finish(&mut self, outcome: Outcome) -> (Act, Option<Outcome>) {
        self.over = true;
        let act = Act {
            base: Some([0.0, 0.0]),
            ..Act::named(Phase::Retracting, "over")
        };
        (act, Some(outcome))
    }

    /// The goal's object in `house`.
    #[must_use]
    pub fn object(&self, observation: &Observation) -> Option<Isometry3<f64>> {
        let poses = self.scene.poses(observation);
        poses.get(self.goal.item()).copied()
    }

    /// The goal's object in the end effector's frame.
    #[must_use]
    pub fn object_in_hand(&self, observation: &Observation) -> Isometry3<f64> {
        let object = self.object(observation).unwrap_or_default();
        self.scene.house_from_tool(observation).inv_mul(&object)
    }

    /// The action as a command.
    #[must_use]
    pub fn command(&self, act: &Act) -> v1::Command {
        use v1::{arm_command, gripper_command};
        let pose = act.tool.map(|pose| {
            arm_command::Target::Pose(v1::CartesianTarget {
                frame: v1::CommandFrame::BaseLink.into(),
                pose: Some(geometry::pose(&pose)),
            })
        });
        let (candidate, hand) = (self.memory.candidate, &self.scene.hand);
        let width = candidate.map_or(0.0, |candidate| candidate.width);
        let force = candidate
            .and_then(|candidate| candidate.force)
            .unwrap_or(self.profile.force_at(width / hand.stroke));
        let target = pose.or(act.joints.map(|joints| {
            arm_command::Target::Joints(v1::JointTarget {
                positions: joints.to_vec(),
            })
        }));
        v1::Command {
            arm: target.map(|target| v1::ArmCommand {
                target: Some(target),
            }),
            base: act
                .base
                .map(|[linear, angular]| v1::BaseCommand { linear, angular }),
            gripper: act.opening.map(|opening| v1::GripperCommand {
                target: Some(gripper_command::Target::Opening(opening)),
                // The server rejects a force beyond the gripper's own.
                max_force: Some(force.min(hand.max_force)),
            }),
            phase: act.phase.into(),
            phase_name: act.name.to_owned(),
            device: v1::Device::Script.into(),
            mode: v1::InputMode::Stream.into(),
            ..Default::default()
        }
    }
}
