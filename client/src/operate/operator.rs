//! The skills in their order: drive, reach, grasp, lift, hold; and what to do
//! when one of them fails. Pure: observations in, actions out.

mod planning;

use nalgebra::{Isometry3, Translation3, Vector3};
use wheelarm_proto::v1::{self, Phase};

use super::drive::Drive;
use super::grasp::{Approach, Reach};
use super::observation::Observation;
use super::scene::{SceneModel, write_pose};
use super::style::Style;
use super::tool_path::{ToolPath, distance};

/// What is done at one control tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Act {
    /// New end effector target in `base_link`, if any.
    pub tool: Option<Isometry3<f64>>,
    /// Forward speed, m/s, and turn rate, rad/s, if the chair is commanded.
    pub base: Option<[f64; 2]>,
    /// Opening of the gripper, metres, if it changes.
    pub opening: Option<f64>,
    /// Phase of the work.
    pub phase: Phase,
    /// Its finer name.
    pub name: &'static str,
    /// Set once, when the work is over.
    pub outcome: Option<Outcome>,
}

/// How the work ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The task's conditions hold.
    Success,
    /// Why it was given up.
    Failure(String),
}

/// Attempts at the object before the operator gives up.
const ATTEMPTS: usize = 3;
/// A fully opened gripper, metres.
const OPEN: f64 = 0.085;
/// The hand counts as arrived within this, metres and radians.
const ARRIVED: [f64; 2] = [0.006, 0.03];
/// Extra time for the hand to arrive, seconds.
const ARRIVAL_TIME: f64 = 2.5;
/// A pad touches from this force, N.
const TOUCH: f64 = 2.0;
/// The knuckle stands still within this, radians. Its angle counts and not its
/// speed, which a stiff contact shakes.
const STILL: f64 = 0.006;
/// A grip is firm after the knuckle has stood still this long, seconds.
const FIRM: f64 = 0.3;
/// The object has slipped when it moved this far in the hand, metres.
const SLIP: f64 = 0.03;
/// Longest time to wait for the task's conditions at the end, seconds.
const WAIT: f64 = 6.0;
/// Success is watched for this long before the work is over, seconds.
const WATCH: f64 = 1.0;
/// The whole work takes no longer than this, seconds of simulation time.
const LONGEST: f64 = 150.0;

#[derive(Clone, Debug)]
enum Stage {
    /// Looks for a place to stop and a way to it.
    Plan,
    /// Drives.
    Drive { drive: Drive, begun: f64 },
    /// Waits until the chair is at rest.
    Rest { since: f64 },
    /// Looks for a way of the hand from where the chair stands.
    Aim,
    /// Moves the hand.
    Move {
        path: ToolPath,
        begun: f64,
        doing: Doing,
    },
    /// Closes the gripper.
    Close { begun: f64, still: Still },
    /// Waits for the task's conditions.
    Hold {
        since: f64,
        success_since: Option<f64>,
    },
    /// Opens the gripper after a miss.
    Open { since: f64 },
    /// Over.
    Over,
}

/// Where the knuckle was when it last moved.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Still {
    knuckle: f64,
    since: f64,
}

/// What a movement of the hand is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    Reaching,
    Approaching,
    Lifting,
    Retracting,
    Retreating,
}

impl Doing {
    fn phase(self) -> (Phase, &'static str) {
        match self {
            Self::Reaching => (Phase::Reaching, "reaching"),
            Self::Approaching => (Phase::Reaching, "approaching"),
            Self::Lifting => (Phase::Retracting, "lifting"),
            Self::Retracting => (Phase::Retracting, "retracting"),
            Self::Retreating => (Phase::Reaching, "retreating"),
        }
    }
}

/// The operator of one episode.
#[derive(Clone, Debug)]
pub struct Operator {
    scene: SceneModel,
    target: usize,
    style: Style,
    stage: Stage,
    begun: Option<f64>,
    /// End effector in `base_link` at the start: a safe place for the hand.
    home: Option<Isometry3<f64>>,
    approach: Option<Approach>,
    /// Object in the hand when it was closed.
    tool_from_object: Option<Isometry3<f64>>,
    /// Height of the object before it was lifted, metres.
    height: f64,
    attempts: usize,
    stops: usize,
    opened: bool,
    notes: Vec<String>,
}

impl Operator {
    /// An operator for the scene's target.
    ///
    /// # Errors
    /// When the scene names no target or knows no grasp for it.
    pub fn new(scene: SceneModel, style: Style) -> Result<Self, String> {
        let target = scene
            .target
            .ok_or("the scenario has no task with an object: choose one with `--task`")?;
        if !scene.grasps.iter().any(|grasp| grasp.object == target) {
            return Err(format!(
                "the scene names no grasp for {:?}",
                scene.items[target].name
            ));
        }
        Ok(Self {
            scene,
            target,
            style,
            stage: Stage::Plan,
            begun: None,
            home: None,
            approach: None,
            tool_from_object: None,
            height: 0.0,
            attempts: 0,
            stops: 0,
            opened: false,
            notes: Vec::new(),
        })
    }

    /// What happened, in words, since the last call.
    pub fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Decides what to do at one control tick.
    pub fn step(&mut self, seen: &Observation, reach: &mut dyn Reach) -> Act {
        let begun = *self.begun.get_or_insert(seen.time);
        self.home.get_or_insert(seen.base_from_tool);
        if matches!(self.stage, Stage::Over) {
            return self.act(Phase::Unspecified, "over");
        }
        if seen.done && !seen.success {
            return self.finish(Outcome::Failure(format!(
                "the task failed: {}",
                seen.failure
            )));
        }
        if seen.time - begun > LONGEST {
            return self.finish(Outcome::Failure(format!("not done within {LONGEST} s")));
        }
        let mut act = match self.stage.clone() {
            Stage::Plan => self.plan(seen, reach),
            Stage::Drive { drive, begun } => self.drive(seen, &drive, begun),
            Stage::Rest { since } => self.rest(seen, since),
            Stage::Aim => self.aim(seen, reach),
            Stage::Move { path, begun, doing } => self.follow(seen, &path, begun, doing),
            Stage::Close { begun, still } => self.close(seen, begun, still),
            Stage::Hold {
                since,
                success_since,
            } => self.hold(seen, since, success_since),
            Stage::Open { since } => self.open(seen, since),
            Stage::Over => self.act(Phase::Unspecified, "over"),
        };
        // The hand starts open, whatever it was left at.
        if !self.opened {
            self.opened = true;
            act.opening.get_or_insert(OPEN);
        }
        act
    }

    fn act(&self, phase: Phase, name: &'static str) -> Act {
        Act {
            tool: None,
            base: None,
            opening: None,
            phase,
            name,
            outcome: None,
        }
    }

    fn finish(&mut self, outcome: Outcome) -> Act {
        self.stage = Stage::Over;
        Act {
            base: Some([0.0, 0.0]),
            outcome: Some(outcome),
            ..self.act(Phase::Retracting, "over")
        }
    }

    /// Gives this attempt up: back off, open, look again; or the end.
    fn miss(&mut self, seen: &Observation, why: &str) -> Act {
        self.attempts += 1;
        self.notes.push(format!("attempt {}: {why}", self.attempts));
        self.tool_from_object = None;
        if self.attempts >= ATTEMPTS {
            return self.finish(Outcome::Failure(format!(
                "{why}, after {ATTEMPTS} attempts"
            )));
        }
        self.stage = Stage::Open { since: seen.time };
        Act {
            opening: Some(OPEN),
            ..self.act(Phase::Grasping, "opening")
        }
    }

    fn drive(&mut self, seen: &Observation, drive: &Drive, begun: f64) -> Act {
        let time = seen.time - begun;
        let mut act = self.act(Phase::Navigating, "driving");
        if time > drive.duration() + 0.3 {
            self.stage = Stage::Rest { since: seen.time };
            act.base = Some([0.0, 0.0]);
        } else {
            act.base = Some(drive.command(time, &seen.chair()));
        }
        act
    }

    fn rest(&mut self, seen: &Observation, since: f64) -> Act {
        let [speed, rate] = seen.chair_speed;
        let waited = seen.time - since;
        if waited > 0.3 && (speed < 0.005 && rate.abs() < 0.01 || waited > 3.0) {
            self.stage = Stage::Aim;
        }
        Act {
            base: Some([0.0, 0.0]),
            ..self.act(Phase::Navigating, "stopping")
        }
    }

    fn start_move(&mut self, seen: &Observation, stops: &[(Isometry3<f64>, f64)], doing: Doing) {
        let start = seen.base_from_desired.unwrap_or(seen.base_from_tool);
        self.stage = Stage::Move {
            path: ToolPath::new(start, stops),
            begun: seen.time,
            doing,
        };
    }

    fn follow(&mut self, seen: &Observation, path: &ToolPath, begun: f64, doing: Doing) -> Act {
        let (phase, name) = doing.phase();
        let mut act = self.act(phase, name);
        let time = seen.time - begun;
        // The target of this tick takes effect during the next one.
        let soon = time + 1.0 / 60.0;
        if time <= path.duration() {
            act.tool = Some(path.at(soon));
        }
        if let (Doing::Lifting | Doing::Retracting, Some(reason)) = (doing, self.slipped(seen)) {
            return self.miss(seen, &reason);
        }
        let off = distance(&seen.base_from_tool, &path.end());
        let turn = seen.base_from_tool.rotation.angle_to(&path.end().rotation);
        let arrived = time >= path.duration() && off < ARRIVED[0] && turn < ARRIVED[1];
        let late = time > path.duration() + ARRIVAL_TIME;
        if late && !arrived {
            let why = format!(
                "{name}: the hand stays {:.0} mm and {:.2} rad off{}",
                off * 1e3,
                turn,
                if seen.arm_problem.is_empty() {
                    String::new()
                } else {
                    format!(" ({})", seen.arm_problem)
                }
            );
            match doing {
                // What it holds is worth more than the exact place.
                Doing::Lifting | Doing::Retracting | Doing::Retreating => self.notes.push(why),
                Doing::Reaching | Doing::Approaching => return self.miss(seen, &why),
            }
        }
        if arrived || late {
            self.moved(seen, doing, path.end());
        }
        act
    }

    /// What follows a finished movement.
    fn moved(&mut self, seen: &Observation, doing: Doing, at: Isometry3<f64>) {
        let style = self.style;
        let Some(approach) = self.approach else {
            self.stage = Stage::Aim;
            return;
        };
        let base_from_house = (seen.house_from_chair * self.scene.chair_from_base).inverse();
        match doing {
            Doing::Reaching => {
                let stop = (base_from_house * approach.at, style.approach_speed);
                self.start_move(seen, &[stop], Doing::Approaching);
            }
            Doing::Approaching => {
                self.height = seen.objects[self.target].translation.z;
                self.stage = Stage::Close {
                    begun: seen.time,
                    still: Still {
                        knuckle: seen.knuckle,
                        since: seen.time,
                    },
                };
            }
            Doing::Lifting => {
                // Back towards the chair, which looks along -x of `base_link`.
                let back = base_from_house
                    .rotation
                    .transform_vector(&(approach.at.rotation * Vector3::z()))
                    * -style.retract;
                let stop = (Translation3::from(back) * at, style.carry_speed);
                self.start_move(seen, &[stop], Doing::Retracting);
            }
            Doing::Retracting => {
                self.stage = Stage::Hold {
                    since: seen.time,
                    success_since: None,
                };
            }
            Doing::Retreating => self.stage = Stage::Aim,
        }
    }

    fn close(&mut self, seen: &Observation, begun: f64, mut still: Still) -> Act {
        let mut act = self.act(Phase::Grasping, "closing");
        // The cap on the force stops the fingers at the object.
        if seen.time - begun < 0.05 {
            act.opening = Some(0.0);
        }
        let touching = seen.pad_force.iter().all(|force| *force > TOUCH);
        if !touching || (seen.knuckle - still.knuckle).abs() > STILL {
            still = Still {
                knuckle: seen.knuckle,
                since: seen.time,
            };
        }
        self.stage = Stage::Close { begun, still };
        if seen.time - still.since > FIRM {
            self.tool_from_object = Some(self.target_in_hand(seen));
            let up = seen
                .house_from_chair
                .rotation
                .inverse_transform_vector(&Vector3::z())
                * self.style.grasp.lift;
            let base_from_chair = self.scene.chair_from_base.inverse();
            let up = base_from_chair.rotation.transform_vector(&up);
            let start = seen.base_from_desired.unwrap_or(seen.base_from_tool);
            let stop = (Translation3::from(up) * start, self.style.carry_speed);
            self.start_move(seen, &[stop], Doing::Lifting);
        } else if seen.knuckle > 0.77 {
            return self.miss(seen, "the fingers closed on nothing");
        } else if seen.time - begun > 5.0 {
            return self.miss(seen, "the fingers found no firm grip");
        }
        act
    }

    /// The object in the end effector's frame.
    #[must_use]
    pub fn target_in_hand(&self, seen: &Observation) -> Isometry3<f64> {
        let house_from_tool =
            seen.house_from_chair * self.scene.chair_from_base * seen.base_from_tool;
        house_from_tool.inv_mul(&seen.objects[self.target])
    }

    /// Why the object is no longer held; `None` while it is.
    fn slipped(&self, seen: &Observation) -> Option<String> {
        let held = self.tool_from_object?;
        let moved = distance(&held, &self.target_in_hand(seen));
        (moved > SLIP).then(|| format!("the object slipped {:.0} mm in the hand", moved * 1e3))
    }

    fn hold(&mut self, seen: &Observation, since: f64, success_since: Option<f64>) -> Act {
        let act = self.act(Phase::Retracting, "holding");
        if let Some(reason) = self.slipped(seen) {
            return self.miss(seen, &reason);
        }
        let success_since = seen.success.then(|| success_since.unwrap_or(seen.time));
        self.stage = Stage::Hold {
            since,
            success_since,
        };
        if success_since.is_some_and(|first| seen.time - first >= WATCH) {
            return self.finish(Outcome::Success);
        }
        if seen.time - since > WAIT && success_since.is_none() {
            let raised = seen.objects[self.target].translation.z - self.height;
            return self.finish(Outcome::Failure(format!(
                "the object is held and raised by {raised:.3} m, but the task's conditions do not hold"
            )));
        }
        act
    }

    fn open(&mut self, seen: &Observation, since: f64) -> Act {
        let act = self.act(Phase::Grasping, "opening");
        if seen.time - since < 0.3 || (seen.knuckle > 0.05 && seen.time - since < 3.0) {
            return act;
        }
        // Straight back first, so that the fingers leave the object, then home.
        let start = seen.base_from_desired.unwrap_or(seen.base_from_tool);
        let back = start * Translation3::new(0.0, 0.0, -self.style.grasp.standoff);
        let home = self.home.unwrap_or(back);
        let stops = [
            (back, self.style.approach_speed),
            (home, self.style.free_speed),
        ];
        self.start_move(seen, &stops, Doing::Retreating);
        act
    }

    /// The action as a command.
    #[must_use]
    pub fn command(&self, act: &Act) -> v1::Command {
        use v1::{arm_command, gripper_command};
        v1::Command {
            arm: act.tool.map(|pose| v1::ArmCommand {
                target: Some(arm_command::Target::Pose(v1::CartesianTarget {
                    frame: v1::CommandFrame::BaseLink.into(),
                    pose: Some(write_pose(&pose)),
                })),
            }),
            base: act
                .base
                .map(|[linear, angular]| v1::BaseCommand { linear, angular }),
            gripper: act.opening.map(|opening| v1::GripperCommand {
                target: Some(gripper_command::Target::Opening(opening)),
                max_force: self.style.force,
            }),
            phase: act.phase.into(),
            phase_name: act.name.to_owned(),
            ..Default::default()
        }
    }
}
