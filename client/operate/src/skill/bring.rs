//! Bring: carries what is in the hand round to who sits in the chair, level all the
//! way: to the mouth, where it holds the tip before the lips until the task is done, or
//! over the lap, where it ends.
//!
//! All of it is planned in the frame of the chair, `wheelchair_root`: the hand goes
//! about the arm's base on a curve, then straight to its aim: to the lips, which it
//! follows, or down to the lap.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::exact;
use wheelarm_proto::v1::Phase;

use super::{Act, Now, Skill, Step, lift};
use crate::clearance::{Surroundings, held_balls};
use crate::goal::Goal;
use crate::grasp_candidate::GraspCandidate;
use crate::hand::Ball;
use crate::scene::Seated;
use crate::tool_path::distance;
use wheelarm_route::footprint_check::wrap;
use wheelarm_route::obb::Obb;

/// The tip is held this far before the lips, metres.
const BEFORE: f64 = 0.018;
/// A thing is let go this far over the lap, metres: the fingers reach below it.
const OVER: f64 = 0.02;
/// The straight way to the lips or down to the lap begins this far off, metres.
const AWAY: f64 = 0.11;
/// Headings of the hand at the mouth that are tried, against the chair's, degrees.
const HEADINGS: [f64; 15] = [
    -150.0, -135.0, -165.0, -120.0, -180.0, -142.5, -157.5, -105.0, -127.5, -172.5, -112.5, -90.0,
    -97.5, -187.5, -195.0,
];
/// The hand turns by less than this on the way round, radians.
const MOST_TURN: f64 = 5.0;
/// Directions of a thing's longest side in the lap: across the thighs, radians.
const ACROSS: [f64; 2] = [FRAC_PI_2, -FRAC_PI_2];
/// How far the hand leans forward there, so that a belly has room, radians.
const LEANS: [f64; 3] = [0.0, 0.4, 0.7];
/// Places in the lap forward of its middle, in shares of its half length.
const FORWARD: [f64; 2] = [0.0, 0.5];
/// Distances of the grasp point from the arm's base on the way round, metres.
const ROUND: [f64; 4] = [0.45, 0.52, 0.60, 0.67];
/// Its height on the way round, metres over the floor.
const HEIGHTS: [f64; 3] = [1.06, 1.14, 1.21];
/// The same for a hand that points down.
const LAP_HEIGHTS: [f64; 3] = [0.98, 0.93, 1.04];
/// Ways that are looked at for one stop of the chair.
const TRIED: usize = 40;
/// Whether the hand turns evenly on the way round, in its first half or in its second.
const TURNS: [[f64; 2]; 3] = [[0.0, 1.0], [0.0, 0.5], [0.5, 1.0]];
/// Parts of the way round that are looked at.
const PARTS: usize = 16;
/// What is carried keeps this far from the person's capsules, metres, and from the
/// head, which moves; the second where there is no way with the first.
const ROOMS: [[f64; 2]; 2] = [[0.02, 0.04], [0.01, 0.025]];
/// And on the last way down to the lap, metres.
const LAP_ROOM: f64 = 0.003;
/// Hand and thing keep this far from everything else, metres.
const CLEAR: f64 = 0.01;
/// Peak speed of the grasp point on the way round, m/s: below what the guard allows.
const ROUND_SPEED: f64 = 0.12;
/// Speed to the lips and after them, and down to the lap, m/s: below what the guard
/// allows at the face.
const LIPS_SPEED: f64 = 0.025;
/// A radian of turning counts as much as this, metres.
const METRES_PER_RADIAN: f64 = 0.15;
/// A smooth start and stop (fifth order) is faster in the middle than on average.
const PEAK: f64 = 1.875;
/// Extra time for the hand to come round, seconds.
const LATE: f64 = 4.0;
/// Longest time at the mouth without success, seconds.
const WAIT: f64 = 25.0;
/// Success is watched for this long, seconds.
const WATCH: f64 = 1.0;
/// The hand counts as come round within this, metres.
const ARRIVED: f64 = 0.012;

/// A way of the end effector to the mouth.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Places of the grasp point on the way round: distance from the arm's base,
    /// direction from there, height, heading of the hand beside that at the start,
    /// and how far it leans forward; metres and radians.
    corners: Vec<[f64; 5]>,
    /// The end effector at its start, in `base_link` turned as the chair.
    start: Isometry3<f64>,
    /// How the hand comes in the end.
    end: End,
}

/// How a hand comes in the end.
#[derive(Clone, Copy, Debug, PartialEq)]
struct End {
    /// Its heading beside that at the start, radians.
    turn: f64,
    /// How far it leans forward, as in `LEANS`, radians.
    lean: f64,
    /// The place in the lap, as in `FORWARD`.
    forward: f64,
}

/// Where a thing is brought.
enum To {
    /// The mouth in the frame of the chair.
    Lips(Isometry3<f64>),
    /// The lap in the frame of the chair.
    Lap(Obb),
}

/// What a way is planned for.
struct Plan<'a> {
    person: &'a Seated,
    /// The arm's base in the frame of the chair.
    base: Translation3<f64>,
    to: To,
    /// What comes to the lips, or to the middle of the lap, in the end effector's frame.
    tip: Point3<f64>,
    /// The longest side of the thing in the end effector's frame.
    long: Vector3<f64>,
    /// Half of its width across that on the floor plan, metres.
    wide: f64,
    tool_length: f64,
}

impl Plan<'_> {
    /// The end effector, turned about the vertical from `start`, with the tip `off`
    /// metres before the lips or over the lap, in the frame of the chair.
    fn at(&self, start: &Isometry3<f64>, end: End, off: f64) -> Isometry3<f64> {
        let aim = match self.to {
            To::Lips(mouth) => {
                let out = mouth.rotation * Vector3::x();
                let out = Vector3::new(out.x, out.y, 0.0);
                let out = out.try_normalize(1e-6).unwrap_or_else(Vector3::x);
                mouth.translation.vector + out * off
            }
            To::Lap(lap) => {
                // What leans hangs deeper.
                let deeper = self.wide * exact::sin_cos(end.lean).0;
                let place = Vector3::new(end.forward * lap.half.x, 0.0, off + deeper);
                lap.pose.translation.vector + place
            }
        };
        let rotation = turned(end.turn, end.lean) * start.rotation;
        Isometry3::from_parts(
            Translation3::from(aim - rotation * self.tip.coords),
            rotation,
        )
    }

    /// How near the tip comes in the end, metres.
    fn near(&self) -> f64 {
        match self.to {
            To::Lips(_) => BEFORE,
            To::Lap(_) => OVER,
        }
    }

    /// Ends that may do for an end effector at `start`, the best first.
    fn ends(&self, start: &Isometry3<f64>) -> Vec<End> {
        let heading = |of: Vector3<f64>| exact::atan2(of.y, of.x);
        match self.to {
            To::Lips(_) => {
                let forward = heading(start.rotation * Vector3::z());
                // The shorter turn of the hand first, then the other way about.
                let turn = |to: &f64| wrap(to.to_radians() - forward);
                let short = HEADINGS.iter().map(turn);
                let long = short.clone().map(|turn| turn - TAU * turn.signum());
                let end = |turn| End {
                    turn,
                    lean: 0.0,
                    forward: 0.0,
                };
                short
                    .chain(long.filter(|turn| turn.abs() < MOST_TURN))
                    .map(end)
                    .collect()
            }
            To::Lap(_) => {
                let long = heading(start.rotation * self.long);
                let mut ends = Vec::new();
                for lean in LEANS {
                    for forward in FORWARD {
                        ends.extend(ACROSS.map(|across| End {
                            turn: wrap(across - long),
                            lean,
                            forward,
                        }));
                    }
                }
                ends
            }
        }
    }

    /// The grasp point of an end effector.
    fn grip(&self, tool: &Isometry3<f64>) -> Point3<f64> {
        tool * Point3::new(0.0, 0.0, self.tool_length)
    }

    /// The grasp point about the arm's base: distance, direction, height.
    fn polar(&self, tool: &Isometry3<f64>) -> [f64; 3] {
        let grip = self.grip(tool);
        let off = grip.coords - self.base.vector;
        [
            exact::hypot(off.x, off.y),
            exact::atan2(off.y, off.x),
            grip.z,
        ]
    }

    /// The end effector at a corner of a way.
    fn tool(&self, start: &Isometry3<f64>, corner: [f64; 5]) -> Isometry3<f64> {
        let [far, to, height, turn, lean] = corner;
        let (sin, cos) = exact::sin_cos(to);
        let rotation = turned(turn, lean) * start.rotation;
        let grip = Vector3::new(self.base.x + far * cos, self.base.y + far * sin, height);
        let palm = rotation * Vector3::new(0.0, 0.0, self.tool_length);
        Isometry3::from_parts(Translation3::from(grip - palm), rotation)
    }

    /// Ways that may do, the best first, from an end effector at `start`.
    fn ways(&self, start: &Isometry3<f64>) -> Vec<Way> {
        let heights = match self.to {
            To::Lips(_) => HEIGHTS,
            To::Lap(_) => LAP_HEIGHTS,
        };
        let [far, from, height] = self.polar(start);
        let mut ways = Vec::new();
        for [begun, done] in TURNS {
            for up in heights {
                for round in ROUND {
                    for end in self.ends(start) {
                        let [near, mut to, low] = self.polar(&self.at(start, end, AWAY));
                        // Round by the front, not over the person.
                        if to > 0.3 {
                            to -= TAU;
                        }
                        let mut corners =
                            vec![[far, from, height, 0.0, 0.0], [round, from, up, 0.0, 0.0]];
                        for part in 1..=PARTS {
                            let share = part as f64 / PARTS as f64;
                            let late = (2.0 * share - 1.0).max(0.0);
                            corners.push([
                                round + (near - round) * late,
                                from + (to - from) * share,
                                up + (low - up) * share,
                                end.turn * ((share - begun) / (done - begun)).clamp(0.0, 1.0),
                                end.lean * late,
                            ]);
                        }
                        ways.push(Way {
                            corners,
                            start: *start,
                            end,
                        });
                    }
                }
            }
        }
        ways
    }

    /// The end effector along a way, up to its end.
    fn poses(&self, way: &Way) -> Vec<Isometry3<f64>> {
        let round = way.corners.iter().skip(1);
        let round = round.map(|corner| self.tool(&way.start, *corner));
        let straight = [0.5 * (AWAY + self.near()), self.near()];
        let straight = straight.map(|off| self.at(&way.start, way.end, off));
        round.chain(straight).collect()
    }

    /// Whether what is in the hand keeps clear of the person on the way round, and on
    /// the straight way to the lips of all but the head, or down to the lap.
    fn keeps_clear(&self, way: &Way, balls: &[Ball], room: [f64; 2]) -> bool {
        let poses = self.poses(way);
        let straight = poses.len() - way.corners.len() + 1;
        let room = |back: usize, moves: bool| match self.to {
            To::Lips(_) if back < straight && moves => None,
            To::Lap(_) if back < straight && !moves => Some(LAP_ROOM),
            _ => Some(room[usize::from(moves)]),
        };
        poses.iter().rev().enumerate().all(|(back, tool)| {
            balls.iter().all(|ball| {
                let at = tool * Point3::from(ball.centre);
                self.person.capsules.iter().all(|capsule| {
                    room(back, capsule.moves)
                        .is_none_or(|room| capsule.distance(&at) > ball.radius + room)
                })
            })
        })
    }
}

/// A turn about the vertical, and then forward in the frame of the chair.
fn turned(turn: f64, lean: f64) -> UnitQuaternion<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
    UnitQuaternion::from_axis_angle(&Vector3::y_axis(), lean) * turn
}

/// The plan for a thing that sits in the hand as `tool_from_item` says, for an end
/// effector at `start`; `None` where nobody sits there or nothing is to be brought.
fn plan<'a>(
    now: &Now<'a>,
    tool_from_item: &Isometry3<f64>,
    start: &Isometry3<f64>,
    mouth: Option<Isometry3<f64>>,
) -> Option<Plan<'a>> {
    let person = now.scene.person.as_ref()?;
    let boxes = now.scene.items[now.goal.item()].boxes.iter();
    let (middle, long, wide) = extent(boxes, &(start * tool_from_item));
    let (to, tip) = match now.goal {
        Goal::Bring { tip, .. } => (
            To::Lips(mouth.unwrap_or(person.mouth)),
            tool_from_item * tip,
        ),
        Goal::Give { lap, .. } => (To::Lap(*lap), start.inverse() * middle),
        _ => return None,
    };
    Some(Plan {
        person,
        base: now.scene.chair_from_base.translation,
        to,
        tip,
        long: start.rotation.inverse() * long,
        wide,
        tool_length: now.scene.tool_length,
    })
}

/// Under the middle of a thing, at its lowest, the direction of its longest side on the
/// floor plan, and half of its width across that, metres.
fn extent<'b>(
    boxes: impl Iterator<Item = &'b Obb>,
    at: &Isometry3<f64>,
) -> (Point3<f64>, Vector3<f64>, f64) {
    let corners: Vec<_> = boxes
        .flat_map(|obb| obb.corners())
        .map(|p| at * p)
        .collect();
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for corner in &corners {
        low = low.inf(&corner.coords);
        high = high.sup(&corner.coords);
    }
    let middle = (low + high) / 2.0;
    // Main axis of the corners' scatter.
    let [xx, xy, yy] = corners.iter().fold([0.0; 3], |[xx, xy, yy], corner| {
        let off = corner.coords - middle;
        [xx + off.x * off.x, xy + off.x * off.y, yy + off.y * off.y]
    });
    let (sin, cos) = exact::sin_cos(0.5 * exact::atan2(2.0 * xy, xx - yy));
    let across = Vector3::new(-sin, cos, 0.0);
    let offs = corners
        .iter()
        .map(|corner| (corner.coords - middle).dot(&across));
    (
        Point3::new(middle.x, middle.y, low.z),
        Vector3::new(cos, sin, 0.0),
        offs.fold(0.0, |wide, off| off.abs().max(wide)),
    )
}

/// Poses of the end effector in `house` from the lift of a thing that is taken by
/// `candidate` up to its end, for a chair at `house_from_chair`; several lists of which
/// one has to be reached.
#[must_use]
pub fn after(
    now: &Now<'_>,
    house_from_chair: &Isometry3<f64>,
    candidate: &GraspCandidate,
) -> Vec<Vec<Isometry3<f64>>> {
    let base = house_from_chair * now.scene.chair_from_base;
    let height = lift::height(now.goal, now.profile.grasp.lift);
    let held = candidate.grasp.inv_mul(&now.thing());
    let lifts = lift::lift_paths(&base, &candidate.grasp, height);
    // Straight up: round to the person goes another way than back to the arm.
    let straight = lifts.into_iter().take(1);
    straight
        .flat_map(|up| {
            let raised = up.last().copied().unwrap_or(candidate.grasp);
            let brought = paths(now, house_from_chair, &held, &raised).into_iter();
            brought.map(move |path| [&up[..], &path[..]].concat())
        })
        .collect()
}

/// Paths of the end effector in `house` to where it is brought, of which one has to be reached,
/// for a chair at `house_from_chair` and a hand that has raised the thing at `raised`.
fn paths(
    now: &Now<'_>,
    house_from_chair: &Isometry3<f64>,
    tool_from_item: &Isometry3<f64>,
    raised: &Isometry3<f64>,
) -> Vec<Vec<Isometry3<f64>>> {
    let start = house_from_chair.inverse() * raised;
    let Some(plan) = plan(now, tool_from_item, &start, None) else {
        return Vec::new();
    };
    let balls = held_balls(&now.scene.items[now.goal.item()].boxes, tool_from_item);
    let ways = plan.ways(&start);
    let clear = |room: &[f64; 2]| -> Vec<&Way> {
        let clear = ways.iter();
        let clear: Vec<&Way> = clear
            .filter(|way| plan.keeps_clear(way, &balls, *room))
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
    },
    Last {
        since: f64,
        end: End,
        start: Isometry3<f64>,
        aim: Isometry3<f64>,
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
        self.state = State::Round {
            way,
            begun: now.seen.time,
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
        let time = now.seen.time;
        let held = now.memory.held.unwrap_or_else(|| now.thing_in_hand());
        let mouth = mouth(now);
        let start = match &self.state {
            State::Choose => return self.choose(now),
            State::Round { way, .. } => way.start,
            State::Last { start, .. } => *start,
        };
        let Some(plan) = plan(now, &held, &start, mouth) else {
            return Step::Impossible("nobody sits there to whom it could be brought".to_owned());
        };
        let base = now.scene.chair_from_base;
        let still = Some([0.0, 0.0]);
        match &mut self.state {
            State::Choose => Step::Going(Act::named(Phase::Retracting, "carrying")),
            State::Round { way, begun } => {
                let seconds = plan.seconds(way);
                let since = time - *begun;
                let target = plan.along(way, since + 1.0 / 60.0);
                let tool = base * now.seen.base_from_tool;
                let off = distance(&tool, &plan.along(way, seconds));
                if since > seconds && (off < ARRIVED || since > seconds + LATE) {
                    if off >= ARRIVED {
                        let problem = &now.seen.arm_problem;
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
                    };
                    return Step::Going(Act::named(Phase::Retracting, "bringing"));
                }
                Step::Going(Act {
                    tool: Some(base.inverse() * target),
                    base: still,
                    ..Act::named(Phase::Retracting, "carrying")
                })
            }
            State::Last {
                since,
                end,
                start,
                aim,
            } => {
                self.success_since = now.seen.success.then(|| self.success_since.unwrap_or(time));
                if self
                    .success_since
                    .is_some_and(|first| time - first >= WATCH)
                {
                    return Step::Done;
                }
                let wanted = plan.at(start, *end, plan.near());
                let way = wanted.translation.vector - aim.translation.vector;
                let tool = base * now.seen.base_from_tool;
                let waited = time - *since;
                match plan.to {
                    To::Lips(_) if waited > WAIT && self.success_since.is_none() => {
                        return Step::Impossible(
                            "the tip does not come to rest at the lips".to_owned(),
                        );
                    }
                    // What lies on something already goes no further down.
                    To::Lap(_) if distance(&tool, &wanted) < ARRIVED || waited > WAIT => {
                        return Step::Done;
                    }
                    _ => {}
                }
                let most = LIPS_SPEED / 60.0;
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

impl Plan<'_> {
    /// Lengths of the way round from corner to corner, metres; turning counts.
    fn lengths(&self, way: &Way) -> Vec<f64> {
        let leg = |pair: &[[f64; 5]]| {
            let [a, b] = [pair[0], pair[1]].map(|corner| self.tool(&way.start, corner));
            let grips = self.grip(&a) - self.grip(&b);
            let turned = wrap(pair[1][3] - pair[0][3]).abs() + (pair[1][4] - pair[0][4]).abs();
            grips.norm() + METRES_PER_RADIAN * turned
        };
        way.corners.windows(2).map(leg).collect()
    }

    /// Seconds of the way round.
    fn seconds(&self, way: &Way) -> f64 {
        PEAK * self.lengths(way).iter().sum::<f64>() / ROUND_SPEED
    }

    /// The end effector `time` seconds after the start of the way round.
    fn along(&self, way: &Way, time: f64) -> Isometry3<f64> {
        let lengths = self.lengths(way);
        let whole: f64 = lengths.iter().sum();
        let t = (time * ROUND_SPEED / (PEAK * whole).max(1e-9)).clamp(0.0, 1.0);
        let mut left = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t) * whole;
        for (pair, length) in way.corners.windows(2).zip(&lengths) {
            if left <= *length {
                let share = left / length.max(1e-9);
                let corner =
                    [0, 1, 2, 3, 4].map(|i| pair[0][i] + (pair[1][i] - pair[0][i]) * share);
                return self.tool(&way.start, corner);
            }
            left -= length;
        }
        let last = way.corners.last().copied().unwrap_or_default();
        self.tool(&way.start, last)
    }
}

/// Where a goal's thing is brought, in words.
fn aim_of(goal: &Goal) -> &'static str {
    match goal {
        Goal::Give { .. } => "the lap",
        _ => "the mouth",
    }
}

/// The mouth now, in the frame of the chair.
fn mouth(now: &Now<'_>) -> Option<Isometry3<f64>> {
    let chair = now.seen.house_from_chair;
    now.seen.mouth.map(|mouth| chair.inverse() * mouth)
}

/// The best way that the arm can go and on which nothing is touched, or what hinders.
fn choose(now: &mut Now<'_>) -> Result<Way, String> {
    const NOBODY: &str = "nobody sits there";
    let held = now.memory.held.unwrap_or_else(|| now.thing_in_hand());
    let item = now.goal.item();
    let balls = held_balls(&now.scene.items[item].boxes, &held);
    let width = now
        .memory
        .candidate
        .map_or(0.0, |candidate| candidate.width);
    let chair = now.seen.house_from_chair;
    let start = chair.inverse() * now.house_from_desired();
    let ways = plan(now, &held, &start, mouth(now))
        .ok_or(NOBODY)?
        .ways(&start);
    let [mut person, mut things, mut reach] = [0; 3];
    for room in ROOMS {
        for way in &ways {
            let plan = plan(now, &held, &start, mouth(now)).ok_or(NOBODY)?;
            if !plan.keeps_clear(way, &balls, room) {
                person += 1;
                continue;
            }
            let poses: Vec<_> = plan.poses(way).iter().map(|pose| chair * pose).collect();
            let stops = [&[chair * start], &poses[..]].concat();
            let around = now.scene.around(&stops, now.poses, Some(item));
            if !is_free(&around, now, &stops, &balls, width) {
                things += 1;
            } else if now.reaches(&poses) {
                return Ok(way.clone());
            } else {
                reach += 1;
            }
        }
    }
    Err(format!(
        "{person} touch the person, {things} something else, {reach} are out of the arm's reach"
    ))
}

/// Whether hand and thing keep clear of furniture and other things between `stops`.
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
