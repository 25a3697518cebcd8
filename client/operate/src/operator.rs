//! The skills in the order that a goal asks for, and what to do when one of
//! them fails. Pure: observations in, actions out.

use nalgebra::{Isometry3, Point3};
use wheelarm_proto::geometry;
use wheelarm_proto::v1::{self, Phase};

use super::base_placement::ArmReachability;
use super::forced::ForcedError;
use super::goal::Goal;
use super::observation::Observation;
use super::profile::OperatorProfile;
use super::scene::SceneModel;
pub use super::skill::Act;
use super::skill::bring::Bring;
use super::skill::carry::Carry;
use super::skill::fumble::Fumble;
use super::skill::grasp::Grasp;
use super::skill::lift::Lift;
use super::skill::navigate::{Navigate, Purpose};
use super::skill::place::Place;
use super::skill::pull::Pull;
use super::skill::reach::Reach;
use super::skill::release::Release;
use super::skill::stow::Stow;
use super::skill::watch::Watch;
use super::skill::{Memory, Now, Skill, Step};

/// How the work ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The task's conditions hold.
    Success,
    /// Why it was abandoned.
    Failure(String),
    /// The simulation broke under its hands: not its fault.
    Broken(String),
}

/// Attempts at the thing before the operator gives up.
const ATTEMPTS: usize = 3;
/// The same where the scenario hinders the robot.
const HINDERED_ATTEMPTS: usize = 8;
/// Stops from which the arm did not reach before it gives up.
const STOPS: usize = 4;
/// The whole work takes no longer than this, seconds of simulation time.
const LONGEST: f64 = 150.0;
/// A pad presses on something from this force, N.
const PRESSES: f64 = 2.0;
/// What the pads hold lies no further than this from where they meet, metres.
const HELD: f64 = 0.02;
/// A chair that goes faster is under way, m/s and rad/s.
const SLOW: [f64; 2] = [0.05, 0.1];
/// What lies further beyond the arm's range is not tried on the spot, metres.
const NEARLY: f64 = 0.2;
/// Skills that may end at one tick.
const ENDINGS: usize = 4;

/// One step of the plan: which skill comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Navigate(Purpose),
    Before,
    Reach,
    Grasp,
    Lift,
    Carry,
    Place,
    Bring,
    Pull,
    LetGo,
    Watch,
}

impl Stage {
    fn begin(self) -> Box<dyn Skill> {
        match self {
            Self::Navigate(purpose) => Box::new(Navigate::new(purpose)),
            Self::Before => Box::new(Reach::before()),
            Self::Reach => Box::new(Reach::new()),
            Self::Grasp => Box::new(Grasp::default()),
            Self::Lift => Box::new(Lift::default()),
            Self::Carry => Box::new(Carry::default()),
            Self::Place => Box::new(Place::new()),
            Self::Bring => Box::new(Bring::new()),
            Self::Pull => Box::new(Pull::new()),
            Self::LetGo => Box::new(Release::let_go()),
            Self::Watch => Box::new(Watch::default()),
        }
    }
}

/// Another thing than the goal's, the nearest to it that can be taken; a wrong one
/// further away than this is none, metres.
const NEAR: f64 = 0.6;

/// How much of the work is done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Extent {
    /// All of it, until the task's conditions hold.
    #[default]
    Task,
    /// Until the hand stands before the thing.
    Near,
    /// Until the thing is held and lifted.
    Take,
    /// From there on: what the hand holds is put into the region.
    Put,
}

/// The skills that reach a goal, in their order.
fn plan(goal: &Goal, extent: Extent) -> &'static [Stage] {
    const TAKE: Stage = Stage::Navigate(Purpose::Take);
    match extent {
        Extent::Task => {}
        Extent::Near => return &[TAKE, Stage::Before],
        Extent::Take => return &[TAKE, Stage::Reach, Stage::Grasp, Stage::Lift],
        Extent::Put => return &[Stage::Navigate(Purpose::Put), Stage::Place],
    }
    match goal {
        Goal::Lift { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Carry,
            Stage::Watch,
        ],
        Goal::Put { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Place,
            Stage::Watch,
        ],
        Goal::Give { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Bring,
            Stage::LetGo,
            Stage::Watch,
        ],
        Goal::Bring { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Lift,
            Stage::Carry,
            Stage::Bring,
        ],
        Goal::Open { .. } | Goal::Close { .. } => &[
            TAKE,
            Stage::Reach,
            Stage::Grasp,
            Stage::Pull,
            Stage::LetGo,
            Stage::Watch,
        ],
    }
}

/// The operator of one episode.
pub struct Operator {
    scene: SceneModel,
    goal: Goal,
    extent: Extent,
    profile: OperatorProfile,
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
    /// What is asked, while the wrong thing is taken on purpose.
    asked: Option<Goal>,
    /// An error is being made on purpose.
    forcing: bool,
    /// An error was made that a firm grasp puts right.
    erred: bool,
    /// What went wrong or right again since the last command.
    incident: v1::Incident,
    /// What will be told when the hand sets off for the wrong thing.
    about_to: Option<v1::Incident>,
    longest: f64,
    /// The hand is not brought home first, as long as that works.
    on_the_spot: bool,
    /// Time as the skills see it, and when it was last moved on, seconds.
    own_time: Option<(f64, f64)>,
}

/// What may go wrong in an episode, on purpose.
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
    /// When there is no goal, or the scene knows no grasp for it.
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
            profile,
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
            asked: None,
            forcing: false,
            erred: false,
            incident: v1::Incident::Unspecified,
            about_to: None,
            longest: LONGEST,
            on_the_spot: false,
            own_time: None,
        })
    }

    /// That does only a part of the work.
    #[must_use]
    pub fn only(mut self, extent: Extent) -> Self {
        self.extent = extent;
        self.skill = plan(&self.goal, extent)[0].begin();
        self
    }

    /// That goes on from wherever somebody else left the hand, instead of bringing it
    /// home and looking for a place to stop: who learns from that sees how to put right
    /// what is a little off, and not how to begin again. Where the arm cannot take the
    /// thing from there, and after a miss, it begins again.
    #[must_use]
    pub fn on_the_spot(mut self) -> Self {
        self.on_the_spot = true;
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

    /// Begins with the wrong thing, where there is one near by.
    fn take_the_wrong_one(&mut self, poses: &[Isometry3<f64>]) {
        let item = self.goal.item();
        let off = |other: usize| {
            (poses[other].translation.vector - poses[item].translation.vector).norm()
        };
        let others = self.scene.grasps.iter().map(|grasp| grasp.item);
        let others = others.filter(|&other| other != item && off(other) < NEAR);
        let slides = matches!(self.goal, Goal::Open { .. } | Goal::Close { .. });
        let nearest = others.min_by(|&a, &b| off(a).total_cmp(&off(b)));
        let Some(other) = nearest.filter(|_| !slides) else {
            self.memory
                .notes
                .push("there is no other thing near by to take by mistake".to_owned());
            return;
        };
        self.force(ForcedError::WrongObject);
        let wrong = Goal::Lift { item: other };
        self.asked = Some(std::mem::replace(&mut self.goal, wrong));
    }

    /// Goes on with what is asked.
    fn correct(&mut self, goal: Goal) {
        self.memory
            .notes
            .push("that was the wrong thing; takes the right one".to_owned());
        self.goal = goal;
        self.forcing = false;
        self.about_to = None;
        self.memory.candidate = None;
        self.memory.refused.clear();
        self.memory.left.clear();
        self.at = 0;
        self.skill = plan(&self.goal, self.extent)[0].begin();
        self.detour = Some(Box::new(Release::after_miss()));
    }

    /// Notes an error that is made on purpose.
    fn force(&mut self, error: ForcedError) {
        self.trouble.forced = None;
        self.forcing = true;
        self.erred = true;
        match error {
            // Told when the hand sets off: until then the way is the same.
            ForcedError::WrongObject => self.about_to = Some(error.incident()),
            ForcedError::WrongGrasp | ForcedError::Drop => self.incident = error.incident(),
        }
        let note = match error {
            ForcedError::WrongGrasp => "forced: closes beside it",
            ForcedError::WrongObject => "forced: takes another thing first",
            ForcedError::Drop => "forced: drops it",
        };
        self.memory.notes.push(note.to_owned());
    }

    /// What went wrong or right again since the last call.
    pub fn incident(&mut self) -> v1::Incident {
        std::mem::take(&mut self.incident)
    }

    /// What happened, in words, since the last call.
    pub fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.memory.notes)
    }

    /// Decides what to do at one control tick; the outcome comes once, with
    /// the last action. In stop and go the skills see a time of their own, which
    /// rests in a pause, and the chair goes as much slower as that time does.
    pub fn step(
        &mut self,
        seen: &Observation,
        arm: &mut dyn ArmReachability,
    ) -> (Act, Option<Outcome>) {
        let Some(pace) = self.profile.pace else {
            return self.decide(seen, arm);
        };
        let (mut own, last) = self.own_time.unwrap_or((seen.time, seen.time));
        let begun = self.begun.unwrap_or(seen.time);
        let rate = pace.rate(seen.time - begun);
        own += (seen.time - last) * rate;
        self.own_time = Some((own, seen.time));
        let mut slowed = seen.clone();
        slowed.time = own;
        let (mut act, outcome) = self.decide(&slowed, arm);
        act.base = act.base.map(|base| base.map(|v| v * rate));
        (act, outcome)
    }

    /// Chooses what to begin with: the plan from its start, with the arm home, or what
    /// can be gone on with on the spot.
    fn set_off(&mut self, seen: &Observation) {
        let is_home = Stow::is_home(&seen.arm, &self.scene.home);
        let [speed, rate] = seen.chair_speed;
        // A chair under way with the arm home goes on driving.
        let drives = is_home && (speed.abs() > SLOW[0] || rate.abs() > SLOW[1]);
        // The thing between both pads already is held on to.
        let presses = seen.pad_force.iter().all(|force| *force > PRESSES);
        let stage = match presses && self.is_between_pads(seen) {
            true => Stage::Grasp,
            false => Stage::Reach,
        };
        let plan = plan(&self.goal, self.extent);
        let at = plan.iter().position(|other| *other == stage);
        self.on_the_spot &= !drives && at.is_some() && self.is_near(seen);
        if self.on_the_spot {
            self.at = at.unwrap_or_default();
            self.skill = match stage {
                Stage::Reach => Box::new(Reach::on_the_spot()),
                _ => stage.begin(),
            };
            if is_home {
                self.memory.home = Some(seen.base_from_tool);
            }
        } else if !is_home {
            self.detour = Some(Box::new(Stow::default()));
        }
    }

    /// The goal's thing is where the pads meet, and not another.
    fn is_between_pads(&self, seen: &Observation) -> bool {
        let pads = Point3::new(0.0, 0.0, self.scene.tool_length);
        let point = self.thing_in_hand(seen).inverse() * pads;
        let boxes = self.scene.items[self.goal.item()].boxes.iter();
        boxes.map(|obb| obb.distance(&point)).any(|off| off < HELD)
    }

    /// The thing may be in the arm's reach from where the chair stands.
    fn is_near(&self, seen: &Observation) -> bool {
        let poses = self.scene.poses(seen);
        let base = self.scene.house_from_base(seen).translation.vector;
        let thing = poses.get(self.goal.item());
        thing.is_some_and(|thing| {
            let away = (thing.translation.vector - base).xy().norm();
            away < self.scene.arm_range[1] + NEARLY
        })
    }

    fn decide(
        &mut self,
        seen: &Observation,
        arm: &mut dyn ArmReachability,
    ) -> (Act, Option<Outcome>) {
        let holds = self.extent == Extent::Put;
        if self.begun.is_none() && !holds {
            self.set_off(seen);
        }
        let begun = *self.begun.get_or_insert(seen.time);
        if self.detour.is_none() && !self.on_the_spot {
            self.memory.home.get_or_insert(seen.base_from_tool);
        }
        if self.over {
            return (Act::named(Phase::Unspecified, "over"), None);
        }
        if self.extent == Extent::Task && seen.done && !seen.success {
            return self.finish(Outcome::Failure(format!(
                "the task failed: {}",
                seen.failure
            )));
        }
        if seen.time - begun > self.longest {
            let longest = self.longest;
            return self.finish(Outcome::Failure(format!("not done within {longest} s")));
        }
        let poses = self.scene.poses(seen);
        if let Some(ForcedError::WrongObject) = self.trouble.forced {
            self.trouble.forced = None;
            self.take_the_wrong_one(&poses);
        }
        for _ in 0..ENDINGS {
            let mut now = Now {
                scene: &self.scene,
                goal: &self.goal,
                profile: &self.profile,
                seen,
                poses: &poses,
                reach: &mut *arm,
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
                Step::Impossible(why) => match self.asked.take() {
                    Some(goal) => self.correct(goal),
                    None => return self.finish(Outcome::Failure(why)),
                },
            }
        }
        (Act::named(Phase::Unspecified, "thinking"), None)
    }

    /// What comes after a skill that has done its part.
    fn done(&mut self) -> Option<Outcome> {
        if self.detour.take().is_some() {
            return None;
        }
        let stage = plan(&self.goal, self.extent).get(self.at).copied();
        if stage == Some(Stage::Grasp) {
            if let Some(goal) = self.asked.take() {
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

    /// Begins again from the start of the plan, with the arm home.
    fn begin_again(&mut self, why: &str) {
        self.memory.notes.push(format!("{why}, begins again"));
        self.memory.held = None;
        self.on_the_spot = false;
        self.opened = false;
        self.at = 0;
        self.skill = plan(&self.goal, self.extent)[0].begin();
        self.detour = Some(Box::new(Stow::default()));
    }

    /// Gives this attempt up: lets go, backs off, looks again; or the end.
    fn missed(&mut self, why: &str) -> Option<Outcome> {
        if self.on_the_spot {
            self.begin_again(why);
            return None;
        }
        if let Some(goal) = self.asked.take() {
            self.correct(goal);
            return None;
        }
        self.memory.held = None;
        match std::mem::take(&mut self.forcing) {
            // Meant so: it does not count.
            true => self.memory.notes.push(why.to_owned()),
            false => {
                self.attempts += 1;
                self.erred = true;
                let moved = why.starts_with("it was moved");
                self.incident = match moved {
                    true => v1::Incident::Moved,
                    false => v1::Incident::Missed,
                };
                let note = format!("attempt {}: {why}", self.attempts);
                self.memory.notes.push(note);
            }
        }
        let most = match self.trouble.hindered {
            true => HINDERED_ATTEMPTS,
            false => ATTEMPTS,
        };
        let reach = plan(&self.goal, self.extent)
            .iter()
            .position(|stage| matches!(stage, Stage::Reach | Stage::Before));
        let Some(reach) = reach else {
            return Some(Outcome::Failure(why.to_owned()));
        };
        if self.attempts >= most {
            return Some(Outcome::Failure(format!("{why}, after {most} attempts")));
        }
        self.at = reach;
        self.skill = plan(&self.goal, self.extent)[reach].begin();
        self.detour = Some(Box::new(Release::after_miss()));
        None
    }

    /// Drives to another place for the present skill; or the end.
    fn elsewhere(&mut self, why: String) -> Option<Outcome> {
        if self.on_the_spot {
            self.begin_again(&why);
            return None;
        }
        if let Some(goal) = self.asked.take() {
            self.correct(goal);
            return None;
        }
        self.stops += 1;
        if self.stops >= STOPS {
            return Some(Outcome::Failure(format!(
                "{why}, from none of {STOPS} stops"
            )));
        }
        self.memory
            .notes
            .push(format!("{why}, looks for another place"));
        let stage = plan(&self.goal, self.extent)[self.at];
        let purpose = if stage == Stage::Place {
            Purpose::Put
        } else {
            Purpose::Take
        };
        self.skill = stage.begin();
        self.detour = Some(Stage::Navigate(purpose).begin());
        None
    }

    fn finish(&mut self, outcome: Outcome) -> (Act, Option<Outcome>) {
        self.over = true;
        let act = Act {
            base: Some([0.0, 0.0]),
            ..Act::named(Phase::Retracting, "over")
        };
        (act, Some(outcome))
    }

    /// The goal's thing in the end effector's frame.
    #[must_use]
    pub fn thing_in_hand(&self, seen: &Observation) -> Isometry3<f64> {
        let poses = self.scene.poses(seen);
        let thing = poses.get(self.goal.item()).copied().unwrap_or_default();
        self.scene.house_from_tool(seen).inv_mul(&thing)
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
                max_force: Some(
                    self.memory
                        .candidate
                        .and_then(|candidate| candidate.force)
                        .unwrap_or(self.profile.force),
                ),
            }),
            phase: act.phase.into(),
            phase_name: act.name.to_owned(),
            device: v1::Device::Script.into(),
            mode: v1::InputMode::Stream.into(),
            ..Default::default()
        }
    }
}
