//! Bring: carries the held object level to the seated person: to the mouth, where the
//! hand holds the tip in front of the lips until the task is done, or over the lap,
//! where the skill ends.
//!
//! All poses are planned in the frame of the chair, `wheelchair_root`. The hand moves
//! on a curve about the arm's base, then straight to its target: to the lips, which it
//! follows, or down to the lap. `plan` computes the pose of the hand on a way, `ways`
//! lists the ways to try, `pace` sets the speed.

mod pace;
mod plan;
mod ways;

use nalgebra::Isometry3;
use wheelarm_proto::v1::Phase;

pub use self::plan::Way;
use self::plan::{End, HeldBalls, Plan, To};
use super::back_off::{BACKING_OFF, BackOff};
use super::{Act, Now, Skill, Step, lift};
use crate::clearance::{Surroundings, held_balls};
use crate::goal::Goal;
use crate::grasp_candidate::GraspCandidate;
use crate::hand::Ball;
use crate::tool_path::distance;

/// Most ways that are tried for one pose of the chair.
const TRIED: usize = 40;
/// Clearances of the carried object from the person's capsules and from the head, which
/// moves, metres; the second pair when no path keeps the first.
const ROOMS: [[f64; 2]; 2] = [[0.02, 0.04], [0.01, 0.025]];
/// Clearance of hand and object from everything else, metres.
const CLEAR: f64 = 0.01;
/// Speed to the lips and after them, and down to the lap, m/s: below what the guard
/// allows at the face.
const LIPS_SPEED: f64 = 0.025;
/// This near to the lips it is the whole speed, metres.
const FOLLOWS: f64 = 0.015;
/// Share of it for the slowest operator.
const SLOWEST: f64 = 0.5;
/// Speed at which an object is laid into the lap, m/s: the arm behind it presses with its
/// momentum within a tick.
const LAY_SPEED: f64 = 0.006;
/// Force on the lap from which the object counts as laid down, N.
const LAID: f64 = 0.3;
/// The hand rests for this long before it releases, seconds.
const REST: f64 = 0.3;
/// Extra time for the hand to come round, seconds.
const LATE: f64 = 4.0;
/// Longest time at the mouth without success, seconds.
const WAIT: f64 = 25.0;
/// The chair backs off within this share of the way round.
const ROUND_SHARE: f64 = 0.8;
/// Success is watched for this long, seconds.
const WATCH: f64 = 1.0;
/// The hand counts as come round within this, metres.
const ARRIVED: f64 = 0.012;

/// Poses of the end effector in `house` from the lift of an object grasped as
/// `candidate` to its end, for a chair at `house_from_chair`; several lists, one of
/// which must be reachable.
#[must_use]
pub fn after(
    now: &Now<'_>,
    house_from_chair: &Isometry3<f64>,
    candidate: &GraspCandidate,
) -> Vec<Vec<Isometry3<f64>>> {
    let base = house_from_chair * now.scene.chair_from_base;
    let height = lift::height(now.goal, now.profile.grasp.lift);
    let held = candidate.grasp.inv_mul(&now.object());
    let lifts = lift::lift_paths(&base, &candidate.grasp, height);
    // Straight up: the way to the person differs from the way back to the arm.
    let straight = lifts.into_iter().take(1);
    straight
        .flat_map(|up| {
            let raised = up.last().copied().unwrap_or(candidate.grasp);
            let brought = paths(now, house_from_chair, &held, &raised).into_iter();
            brought.map(move |path| [&up[..], &path[..]].concat())
        })
        .collect()
}

/// Paths of the end effector in `house` to the person, one of which must be reachable,
/// for a chair at `house_from_chair` and a hand that has raised the object at `raised`.
fn paths(
    now: &Now<'_>,
    house_from_chair: &Isometry3<f64>,
    tool_from_item: &Isometry3<f64>,
    raised: &Isometry3<f64>,
) -> Vec<Vec<Isometry3<f64>>> {
    let start = house_from_chair.inverse() * raised;
    let Some(plan) = Plan::of(now, tool_from_item, &start, None) else {
        return Vec::new();
    };
    let boxes = &now.scene.items[now.goal.item()].boxes;
    let held = HeldBalls::new(held_balls(boxes, tool_from_item));
    let ways = plan.ways(&start);
    let clear = |room: &[f64; 2]| -> Vec<&Way> {
        let clear = ways.iter();
        let clear: Vec<&Way> = clear
            .filter(|way| plan.keeps_clear(way, &held, *room))
            .collect();
        // Some of each kind.
        let step = clear.len().div_ceil(TRIED).max(1);
        clear.into_iter().step_by(step).collect()
    };
    let ways = ROOMS.iter().map(clear).find(|ways| !ways.is_empty());
    let in_house = |way: &Way| {
        let poses = plan.poses(way).into_iter();
        poses.map(|pose| house_from_chair * pose).collect()
    };
    ways.into_iter().flatten().map(in_house).collect()
}

#[derive(Clone, Debug)]
enum State {
    Choose,
    Round {
        way: Way,
        begun: f64,
        back_off: Option<BackOff>,
    },
    Last {
        since: f64,
        end: End,
        start: Isometry3<f64>,
        aim: Isometry3<f64>,
        /// Time at which the object touched the lap, seconds.
        laid: Option<f64>,
    },
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Bring {
    state: State,
    success_since: Option<f64>,
}

impl Bring {
    /// Begins.
    #[must_use]
    pub fn new() -> Self {
        Self {
            state: State::Choose,
            success_since: None,
        }
    }

    fn choose(&mut self, now: &mut Now<'_>) -> Step {
        let way = match choose(now) {
            Ok(way) => way,
            Err(why) => {
                return Step::Impossible(format!(
                    "the arm finds no way to {}: {why}",
                    aim_of(now.goal)
                ));
            }
        };
        now.note(format!(
            "comes round to {}, turned by {:.0}°",
            aim_of(now.goal),
            way.end.turn.to_degrees()
        ));
        let back_off = back_off(now, &way);
        self.state = State::Round {
            way,
            begun: now.observation.time,
            back_off,
        };
        Step::Going(Act::named(Phase::Retracting, "carrying"))
    }
}

impl Default for Bring {
    fn default() -> Self {
        Self::new()
    }
}

impl Skill for Bring {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        if let Some(why) = now.slipped() {
            return Step::Missed(why);
        }
        let time = now.observation.time;
        let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
        let mouth = mouth(now);
        let start = match &self.state {
            State::Choose => return self.choose(now),
            State::Round { way, .. } => way.start,
            State::Last { start, .. } => *start,
        };
        let Some(plan) = Plan::of(now, &held, &start, mouth) else {
            return Step::Impossible("no seated person to bring it to".to_owned());
        };
        let base = now.scene.chair_from_base;
        let still = Some([0.0, 0.0]);
        match &mut self.state {
            State::Choose => Step::Going(Act::named(Phase::Retracting, "carrying")),
            State::Round {
                way,
                begun,
                back_off,
            } => {
                let seconds = plan.seconds(way);
                let since = time - *begun;
                let target = plan.along(way, since + 1.0 / 60.0);
                let tool = base * now.observation.base_from_tool;
                let off = distance(&tool, &plan.along(way, seconds));
                if since > seconds && (off < ARRIVED || since > seconds + LATE) {
                    if off >= ARRIVED {
                        let problem = &now.observation.arm_problem;
                        return Step::Impossible(format!(
                            "on the way to {} the hand stays {:.0} mm off {problem}",
                            aim_of(now.goal),
                            off * 1e3
                        ));
                    }
                    let aim = plan.along(way, seconds);
                    self.state = State::Last {
                        since: time,
                        end: way.end,
                        start: way.start,
                        aim,
                        laid: None,
                    };
                    return Step::Going(Act::named(Phase::Retracting, "bringing"));
                }
                let backs = back_off.filter(|back_off| !back_off.is_over(time));
                let name = match backs {
                    Some(_) => BACKING_OFF,
                    None => "carrying",
                };
                Step::Going(Act {
                    tool: Some(base.inverse() * target),
                    base: backs.map_or(still, |back_off| Some(back_off.command(time))),
                    ..Act::named(Phase::Retracting, name)
                })
            }
            State::Last {
                since,
                end,
                start,
                aim,
                laid,
            } => {
                self.success_since = now
                    .observation
                    .success
                    .then(|| self.success_since.unwrap_or(time));
                if self
                    .success_since
                    .is_some_and(|first| time - first >= WATCH)
                {
                    return Step::Done;
                }
                let wanted = plan.last(start, *end);
                let tool = base * now.observation.base_from_tool;
                let waited = time - *since;
                // At the lips a slow operator too follows the head.
                let mut speed = match distance(aim, &wanted) < FOLLOWS {
                    true => LIPS_SPEED,
                    false => LIPS_SPEED * now.profile.tempo.max(SLOWEST),
                };
                if matches!(plan.to, To::Lap(_)) {
                    let over = plan.at(start, *end, plan.near());
                    if aim.translation.z < over.translation.z + LIPS_SPEED / 60.0 {
                        speed = LAY_SPEED;
                    }
                    let lies = now.observation.lap_force > LAID || distance(&tool, &wanted) < 1e-3;
                    if laid.is_none() && (lies || waited > WAIT) {
                        *laid = Some(time);
                        *aim = tool;
                    }
                    if laid.is_some_and(|at| time - at > REST) {
                        return Step::Done;
                    }
                    if laid.is_some() {
                        speed = 0.0;
                    }
                }
                let way = wanted.translation.vector - aim.translation.vector;
                if matches!(plan.to, To::Lips(_)) && waited > WAIT && self.success_since.is_none() {
                    return Step::Impossible(
                        "the tip does not come to rest at the lips".to_owned(),
                    );
                }
                let most = speed / 60.0;
                aim.translation.vector += way * (most / way.norm().max(most));
                Step::Going(Act {
                    tool: Some(base.inverse() * *aim),
                    base: still,
                    ..Act::named(Phase::Retracting, "bringing")
                })
            }
        }
    }
}

/// The motion of the chair while the hand moves on `way`.
fn back_off(now: &Now<'_>, way: &Way) -> Option<BackOff> {
    let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
    let plan = Plan::of(now, &held, &way.start, mouth(now))?;
    let chair = now.observation.house_from_chair;
    let poses = plan.poses(way).into_iter();
    let poses: Vec<_> = [way.start].into_iter().chain(poses).collect();
    let poses: Vec<_> = poses.iter().map(|pose| chair * pose).collect();
    BackOff::plan(now, &poses, ROUND_SHARE * plan.seconds(way))
}

/// Name of the place to which the object of a goal is brought.
fn aim_of(goal: &Goal) -> &'static str {
    match goal {
        Goal::Give { .. } => "the lap",
        _ => "the mouth",
    }
}

/// The mouth now, in the frame of the chair.
fn mouth(now: &Now<'_>) -> Option<Isometry3<f64>> {
    let chair = now.observation.house_from_chair;
    now.observation.mouth.map(|mouth| chair.inverse() * mouth)
}

/// The best way that the arm can go and on which nothing is touched, or what hinders.
fn choose(now: &mut Now<'_>) -> Result<Way, String> {
    const NO_PERSON: &str = "no seated person";
    let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
    let item = now.goal.item();
    let balls = HeldBalls::new(held_balls(&now.scene.items[item].boxes, &held));
    let width = now
        .memory
        .candidate
        .map_or(0.0, |candidate| candidate.width);
    let chair = now.observation.house_from_chair;
    let start = chair.inverse() * now.house_from_desired();
    let plan = Plan::of(now, &held, &start, mouth(now)).ok_or(NO_PERSON)?;
    let ways = plan.ways(&start);
    let [mut person, mut obstacles, mut reach] = [0; 3];
    let mut quick = None;
    for room in ROOMS {
        for way in &ways {
            if !plan.keeps_clear(way, &balls, room) {
                person += 1;
                continue;
            }
            let poses: Vec<_> = plan.poses(way).iter().map(|pose| chair * pose).collect();
            let stops = [&[chair * start], &poses[..]].concat();
            let around = now.scene.around(&stops, now.poses, Some(item));
            if !is_free(&around, now, &stops, &balls.balls, width) {
                obstacles += 1;
            } else if now.reaches_gently(&poses) {
                return Ok(way.clone());
            } else if quick.is_none() && now.reaches(&poses) {
                quick = Some(way.clone());
            } else {
                reach += 1;
            }
        }
    }
    quick.ok_or_else(|| {
        format!(
            "{person} touch the person, {obstacles} something else, {reach} are out of the arm's reach"
        )
    })
}

/// Whether hand and object keep clear of furniture and other objects between `stops`.
fn is_free(
    around: &Surroundings,
    now: &Now<'_>,
    stops: &[Isometry3<f64>],
    balls: &[Ball],
    width: f64,
) -> bool {
    around.hand_is_free(&now.scene.hand, width, stops, CLEAR)
        && stops
            .windows(2)
            .all(|leg| around.is_free(balls, &leg[0], &leg[1], CLEAR))
}
