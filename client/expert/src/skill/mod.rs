//! The skills: one small state machine each. A skill reads observations, returns
//! actions, and ends done, missed or unable. It depends neither on the task nor on the
//! skills before or after it, except for the object in the hand.

pub mod back_off;
pub(crate) mod base_search;
pub mod bring;
pub mod carry;
pub mod fumble;
pub mod grasp;
pub mod lift;
pub mod look_around;
pub mod motion;
pub mod navigate;
pub mod place;
pub mod play;
pub mod prepare;
pub mod pull;
mod push;
pub mod reach;
pub mod release;
mod shift;
pub mod stow;
mod stowed_drive;
mod tuck;
pub mod watch;

use nalgebra::Isometry3;
use wheelarm_proto::v1::Phase;

use super::base_placement::{self, ArmReachability};
use super::demonstration::{Demonstration, Demonstrations, Wander, adapt};
use super::goal::Goal;
use super::grasp_candidate::{self, GraspCandidate, Shown};
use super::observation::Observation;
use super::profile::OperatorProfile;
use super::scene::SceneModel;
use super::tool_path::distance;
use wheelarm_planning::footprint_check::Pose2;

/// Checks of the arm after which planning a drive ends, with all its base searches: each that
/// fails takes the server some 3 ms. Without a bound, a plan took more than 60 s.
const ARM_CHECKS: usize = 5_000;

/// The action of one control tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Act {
    /// New end effector target in `base_link`, if any.
    pub tool: Option<Isometry3<f64>>,
    /// New positions of the arm's joints instead, radians, if any.
    pub joints: Option<[f64; 6]>,
    /// Forward speed, m/s, and turn rate, rad/s, if the chair is commanded.
    pub base: Option<[f64; 2]>,
    /// Opening of the gripper, metres, if it changes.
    pub opening: Option<f64>,
    /// Phase of the work.
    pub phase: Phase,
    /// Its finer name.
    pub name: &'static str,
}

impl Act {
    /// Nothing but the name of what is being done.
    #[must_use]
    pub fn named(phase: Phase, name: &'static str) -> Self {
        Self {
            tool: None,
            joints: None,
            base: None,
            opening: None,
            phase,
            name,
        }
    }
}

/// The result of a skill at one control tick.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// It is at work.
    Going(Act),
    /// It has done its part.
    Done,
    /// The attempt failed: release and try again.
    Missed(String),
    /// It cannot be done from the present pose of the chair.
    Elsewhere(String),
    /// It cannot be done at all.
    Impossible(String),
}

/// A skill at work.
pub trait Skill: Send {
    /// Decides what to do at one control tick.
    fn step(&mut self, now: &mut Now<'_>) -> Step;
}

/// The inputs of a skill at one control tick.
pub struct Now<'a> {
    /// Geometry of the scene.
    pub scene: &'a SceneModel,
    /// Goal of the task.
    pub goal: &'a Goal,
    /// The operator profile.
    pub profile: &'a OperatorProfile,
    /// The observation.
    pub observation: &'a Observation,
    /// Poses of all objects in `house`.
    pub poses: &'a [Isometry3<f64>],
    /// The arm's kinematics.
    pub reach: &'a mut dyn ArmReachability,
    /// Demonstrations of the grasp.
    pub shown: &'a Demonstrations,
    /// State that skills share.
    pub memory: &'a mut Memory,
}

/// State that skills share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// End effector in `base_link` at the start: a safe place for the hand.
    pub home: Option<Isometry3<f64>>,
    /// The grasp candidate that was chosen.
    pub candidate: Option<GraspCandidate>,
    /// The grasp for which the chair was placed, as the end effector in the object's
    /// frame.
    pub planned: Option<Isometry3<f64>>,
    /// Grasp candidates that failed, as the end effector in the object's frame.
    pub refused: Vec<Isometry3<f64>>,
    /// Stops of the chair from which it did not work.
    pub left: Vec<Pose2>,
    /// The object in the end effector's frame when the hand closed.
    pub held: Option<Isometry3<f64>>,
    /// The object in `house` before it was grasped.
    pub rest: Option<Isometry3<f64>>,
    /// Checks of the arm since the present drive is planned.
    pub arm_checks: usize,
    /// Notes for people.
    pub notes: Vec<String>,
    /// The scenario hinders the robot: what is taken may be moved by others.
    pub hindered: bool,
    /// The next grasp closes beside the object, on purpose.
    pub aside: bool,
    /// Frame of the demonstration that is played, in `house`, and how the hand is off.
    pub playing: Option<(Isometry3<f64>, Wander)>,
}

/// The object has slipped when it moved this far in the hand, metres.
const SLIP: f64 = 0.03;

impl Now<'_> {
    /// The goal's object in `house`.
    #[must_use]
    pub fn object(&self) -> Isometry3<f64> {
        self.poses[self.goal.item()]
    }

    /// The goal's object in the end effector's frame.
    #[must_use]
    pub fn object_in_hand(&self) -> Isometry3<f64> {
        self.scene
            .house_from_tool(self.observation)
            .inv_mul(&self.object())
    }

    /// The reason why the object is not held any more; `None` while it is held.
    #[must_use]
    pub fn slipped(&self) -> Option<String> {
        let held = self.memory.held?;
        let moved = distance(&held, &self.object_in_hand());
        (moved > SLIP).then(|| {
            format!(
                "the {} slipped {:.0} mm in the hand",
                self.scene.items[self.goal.item()].name,
                moved * 1e3
            )
        })
    }

    /// Grasp candidates of the goal's object at its present pose that keep `margin`
    /// metres from obstacles: only demonstrated ones when there are demonstrations.
    #[must_use]
    pub fn candidates(&self, margin: f64) -> Vec<GraspCandidate> {
        match self.shown.list.is_empty() {
            true => {
                let standoff = self.profile.grasp.standoff;
                let habits = self.profile.habits.as_ref();
                let (scene, goal) = (self.scene, self.goal);
                grasp_candidate::candidates(scene, goal, self.poses, habits, standoff, margin)
            }
            false => adapt::candidates(self.scene, self.goal, self.poses, self.shown, margin),
        }
    }

    /// The demonstration of the present or planned grasp.
    #[must_use]
    pub fn taken_as(&self) -> Option<(&Demonstration, Shown)> {
        let shown = self.memory.candidate.as_ref()?.shown?;
        Some((self.shown.list.get(shown.index)?, shown))
    }

    /// Target of the server for the end effector, in `house`.
    #[must_use]
    pub fn house_from_desired(&self) -> Isometry3<f64> {
        let desired = self
            .observation
            .base_from_desired
            .unwrap_or(self.observation.base_from_tool);
        self.scene.house_from_base(self.observation) * desired
    }

    /// Whether the arm, from where the end effector is meant to be, reaches
    /// `poses` in `house` one after another without folding over.
    pub fn reaches(&mut self, poses: &[Isometry3<f64>]) -> bool {
        let tool = self
            .observation
            .base_from_desired
            .unwrap_or(self.observation.base_from_tool);
        let chair = self.observation.house_from_chair;
        base_placement::reaches_from(self.scene, &chair, &tool, poses, self.reach)
    }

    /// The same along a path on which no joint has to be quick.
    pub fn reaches_gently(&mut self, poses: &[Isometry3<f64>]) -> bool {
        let base_from_house = self.scene.house_from_base(self.observation).inverse();
        let poses: Vec<_> = poses.iter().map(|pose| base_from_house * pose).collect();
        let tool = self.observation.base_from_desired;
        let tool = tool.unwrap_or(self.observation.base_from_tool);
        base_placement::reaches_within(&tool, &poses, base_placement::GENTLE, self.reach)
    }

    /// Gives up this stop of the chair: it is not taken again.
    #[must_use]
    pub fn elsewhere(&mut self, why: &str) -> Step {
        self.memory.left.push(self.observation.chair());
        Step::Elsewhere(why.to_owned())
    }

    /// The candidate that was chosen is not chosen again.
    pub fn refuse_candidate(&mut self) {
        if let Some(candidate) = self.memory.candidate {
            let object_from_tool = self.object().inv_mul(&candidate.grasp);
            self.memory.refused.push(object_from_tool);
        }
    }

    /// Leaves a note.
    pub fn note(&mut self, text: String) {
        self.memory.notes.push(text);
    }
}
