//! What a person does with a page becomes commands, and nothing else moves. Pure:
//! intents, what is known of the robot, and time go in, commands come out.
//!
//! The rules: every intent is taken once, in order. The chair goes no faster than
//! the age of the picture allows; pictures that are too old allow steps, and then
//! only a stop. Whatever ends a motion (a stop, silence, a refusal, a contact, a
//! frozen picture, the loss of control) ends its epoch: the same press never moves
//! anything again. Times are seconds of the caller's clock.

mod chair_step;
mod clutch;

use nalgebra::Vector3;
use wheelarm_proto::geometry::{self, normalized};
use wheelarm_proto::v1;

use self::chair_step::ChairStep;
use self::clutch::Engaged;
use crate::phase::{self, Work};
use crate::protocol::{Action, Held, Intent, Part};
use crate::speed::{self, Allow, Speeds};
use crate::watch::Situation;

/// Silence of the page after which what it drives is stopped, s.
pub const STALL: f64 = 0.25;
/// Silence of the page after which a step or a goal is stopped, s.
pub const GONE: f64 = 1.0;
/// Longest motion of one press that latches, s.
pub const LATCH: f64 = 2.0;
/// Time between two messages that say the same stop, s.
const AGAIN: f64 = 0.05;
/// Messages that say stop, after the first.
const STOPS: u8 = 2;
/// A step of the hand is not added while it has this far to go, m and rad.
const LEAD: [f64; 2] = [0.12, 0.40];
/// Longest time between two messages that counts for the fingers, s.
const GRIP_TIME: f64 = 0.1;
/// Distance from the middle of the axle to the farthest corner of a robot that is
/// not described yet, m.
const FAR_CORNER: f64 = 1.0;

/// What comes of an intent, or of time.
#[derive(Clone, Debug, PartialEq)]
pub enum Out {
    /// A command that answers the state of a tick.
    Send {
        /// The command.
        command: Box<v1::Command>,
        /// Tick that it answers; the newest one where absent.
        shown: Option<u64>,
        /// The page's number, where an intent brought it about.
        seq: Option<u32>,
    },
    /// An intent is not carried out.
    Refuse {
        /// The page's number.
        seq: u32,
        /// For programs.
        code: &'static str,
        /// For people.
        reason: String,
    },
    /// The person should know.
    Note(String),
    /// A goal ends.
    EndGoal,
}

/// What is in motion by this page.
#[derive(Clone, Debug, Default, PartialEq)]
enum Going {
    #[default]
    Rest,
    /// Held or latched.
    Driving(Driving),
    /// The chair goes one step.
    Stepping(ChairStep),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Driving {
    epoch: u32,
    /// When the press came, s.
    since: f64,
    latch: bool,
    base: bool,
    arm: bool,
}

/// What the description of the robot tells.
#[derive(Clone, Debug, PartialEq)]
struct Limits {
    /// Farthest corner of the footprint from the axle's middle, m.
    corner: f64,
    /// Widest opening of the fingers, m.
    stroke: f64,
    linkage: Option<v1::GripperLinkage>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            corner: FAR_CORNER,
            stroke: 0.0,
            linkage: None,
        }
    }
}

/// What is known besides the intent.
#[derive(Clone, Copy)]
pub struct Now<'a> {
    /// Time, s.
    pub time: f64,
    /// The newest of everything.
    pub situation: &'a Situation,
    /// This page is in control of the robot.
    pub in_control: bool,
    /// A skill is at work.
    pub goal: bool,
    /// Time waits for an answer to every control tick, which no person gives.
    pub lock_step: bool,
}

impl Now<'_> {
    fn newest(&self) -> u64 {
        self.situation.header.tick
    }
}

/// One page's motion.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    limits: Limits,
    seq: Option<u32>,
    epoch: u32,
    dead: u32,
    /// When the newest message came, s.
    heard: Option<f64>,
    shown: Option<u64>,
    echo: f64,
    speed: u8,
    device: v1::Device,
    mode: v1::InputMode,
    going: Going,
    stopped: bool,
    /// What still is to be stopped once more: how often, and when next, s.
    stops: u8,
    next_stop: f64,
    /// The fingers' target, m, and when it was moved, s.
    grip: Option<(f64, f64)>,
    clutch: Option<Engaged>,
    /// Epoch of which a refusal was told.
    told: u32,
    /// What was held or stepped last.
    held: Held,
}

impl Motion {
    /// Takes the limits of the robot that is simulated.
    pub fn fit(&mut self, robot: &v1::RobotDescription) {
        let corner = robot.footprint.map(|f| {
            let x = f.x_min.abs().max(f.x_max.abs());
            let y = f.y_min.abs().max(f.y_max.abs());
            x.hypot(y)
        });
        self.limits = Limits {
            corner: corner.filter(|c| *c > 0.0).unwrap_or(FAR_CORNER),
            stroke: robot.gripper.as_ref().map_or(0.0, |g| g.stroke),
            linkage: robot.gripper.as_ref().and_then(|g| g.linkage),
        };
    }

    /// Newest number that was taken.
    #[must_use]
    pub fn seq(&self) -> u32 {
        self.seq.unwrap_or(0)
    }

    /// Newest epoch that was heard of, and the newest one that is over.
    #[must_use]
    pub fn epochs(&self) -> [u32; 2] {
        [self.epoch, self.dead]
    }

    /// A stop is in force until the next fresh press.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// Whether this page moves something.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.going != Going::Rest
    }

    /// The page's own clock at its newest message, ms, and how long ago that came
    /// at `time`, s.
    #[must_use]
    pub fn echo(&self, time: f64) -> Option<(f64, f64)> {
        self.heard.map(|heard| (self.echo, time - heard))
    }

    /// The person's speed, 1 to 5.
    #[must_use]
    pub fn speed(&self) -> u8 {
        self.speed.max(1)
    }

    /// Age of the picture that is seen when the newest state is that of `newest`, s.
    #[must_use]
    pub fn age(&self, newest: u64) -> Option<f64> {
        self.shown.map(|shown| speed::age(shown, newest))
    }

    /// Silence of the page at `time`, s.
    #[must_use]
    pub fn silence(&self, time: f64) -> f64 {
        self.heard.map_or(f64::INFINITY, |heard| time - heard)
    }

    /// Directions in which the hand was moved last, as pages name them.
    #[must_use]
    pub fn hand_directions(&self) -> Vec<&'static str> {
        const NAMES: [[&str; 2]; 6] = [
            ["hand.forward", "hand.back"],
            ["hand.left", "hand.right"],
            ["hand.up", "hand.down"],
            ["turn.roll_plus", "turn.roll_minus"],
            ["turn.pitch_plus", "turn.pitch_minus"],
            ["turn.yaw_plus", "turn.yaw_minus"],
        ];
        let held = self.held.hand.into_iter().chain(self.held.turn);
        let moved = held.zip(NAMES).filter(|(value, _)| *value != 0.0);
        moved
            .map(|(value, [plus, minus])| if value > 0.0 { plus } else { minus })
            .collect()
    }

    /// Takes an intent.
    pub fn take(&mut self, intent: &Intent, now: Now<'_>) -> Vec<Out> {
        if self.seq.is_some_and(|newest| intent.seq <= newest) {
            return Vec::new();
        }
        self.seq = Some(intent.seq);
        self.heard = Some(now.time);
        self.epoch = self.epoch.max(intent.epoch);
        self.echo = intent.ms;
        self.shown = intent.shown;
        self.speed = intent.speed;
        match intent.action {
            Action::Alive => return Vec::new(),
            Action::Stop => return self.stop(intent, now),
            Action::Drive(held) if held.is_rest() => return self.release(intent, now),
            Action::Drive(_) | Action::Step { .. } => {}
        }
        if intent.epoch <= self.dead {
            return Vec::new();
        }
        if !now.in_control {
            return self.refuse(intent, "NO_CONTROL", "this page is not in control", now);
        }
        if now.lock_step {
            let words = "this episode is in lock-step; a person drives in real time \
                         (wheelarm-server without --pacing lock-step)";
            return self.refuse(intent, "LOCK_STEP", words, now);
        }
        if now.goal {
            let mut out = vec![Out::EndGoal];
            out.extend(self.end(now, true));
            return out;
        }
        let age = self.age(now.newest());
        match (Allow::at(age), intent.action) {
            (Allow::Drive, _) | (Allow::Steps, Action::Step { .. }) => {}
            (Allow::Steps, _) => {
                let words = "the picture is more than 1 s old: only single steps are taken";
                return self.refuse(intent, "TOO_OLD", words, now);
            }
            (Allow::Stop, _) => {
                let words = match age {
                    None => "no picture is shown: only a stop is taken",
                    Some(_) => "the picture is more than 2 s old: only a stop is taken",
                };
                return self.refuse(intent, "FROZEN", words, now);
            }
        }
        self.device = intent.device;
        self.mode = intent.mode;
        match intent.action {
            Action::Drive(held) => self.drive(intent, &held, now),
            Action::Step { part, axis, sign } => self.step(intent, part, axis, sign, now),
            Action::Stop | Action::Alive => Vec::new(),
        }
    }

    /// Time has come to `now`.
    pub fn tick(&mut self, now: Now<'_>) -> Vec<Out> {
        let silence = self.silence(now.time);
        let allow = Allow::at(self.age(now.newest()));
        match &mut self.going {
            Going::Rest => {}
            Going::Driving(driving) => {
                let held = now.time - driving.since;
                let why = if silence > STALL {
                    Some("the page was silent: everything stops")
                } else if allow != Allow::Drive {
                    Some("the picture is too old: everything stops")
                } else if driving.latch && held >= LATCH {
                    Some("the press is over: press again to go on")
                } else {
                    None
                };
                if let Some(why) = why {
                    let mut out = self.end(now, true);
                    out.push(Out::Note(why.to_owned()));
                    return out;
                }
            }
            Going::Stepping(step) => {
                if silence > GONE || allow == Allow::Stop {
                    let mut out = self.end(now, true);
                    out.push(Out::Note("the step was broken off".to_owned()));
                    return out;
                }
                match step.due(now.time, now.situation) {
                    chair_step::Due::Nothing => {}
                    chair_step::Due::Send(base) => {
                        let command = v1::Command {
                            base: Some(base),
                            ..v1::Command::default()
                        };
                        return vec![self.command(command, Some(Work::Chair), None, None, now)];
                    }
                    chair_step::Due::Done => return self.end(now, false),
                }
            }
        }
        if self.stops > 0 && now.time >= self.next_stop && now.in_control {
            self.stops -= 1;
            self.next_stop = now.time + AGAIN;
            return vec![self.command(rest(true, false), None, None, None, now)];
        }
        Vec::new()
    }

    /// Ends what is in motion and its epoch, because of `why`.
    pub fn cut(&mut self, why: &str, now: Now<'_>) -> Vec<Out> {
        if self.going == Going::Rest {
            self.dead = self.epoch;
            return Vec::new();
        }
        let mut out = self.end(now, true);
        out.push(Out::Note(why.to_owned()));
        out
    }

    /// Control is lost, or the connection: nothing is sent any more.
    pub fn forget(&mut self) {
        self.going = Going::Rest;
        self.dead = self.epoch;
        self.stops = 0;
        self.clutch = None;
        self.grip = None;
    }

    fn stop(&mut self, intent: &Intent, now: Now<'_>) -> Vec<Out> {
        self.device = intent.device;
        self.mode = intent.mode;
        self.going = Going::Rest;
        self.dead = self.epoch;
        self.stopped = true;
        self.clutch = None;
        self.grip = None;
        self.stops = STOPS;
        self.next_stop = now.time + AGAIN;
        let seq = Some(intent.seq);
        vec![
            Out::EndGoal,
            self.command(rest(true, true), None, None, seq, now),
        ]
    }

    fn release(&mut self, intent: &Intent, now: Now<'_>) -> Vec<Out> {
        // What was pressed is over. A step goes on to its end.
        match self.going {
            Going::Driving(_) => {
                self.device = intent.device;
                self.end(now, true)
            }
            Going::Rest | Going::Stepping(_) => Vec::new(),
        }
    }

    /// Stops what this page has set in motion; with `dead` its press is over.
    fn end(&mut self, now: Now<'_>, dead: bool) -> Vec<Out> {
        let (base, arm) = match self.going {
            Going::Driving(driving) => (driving.base, driving.arm),
            Going::Stepping(_) => (true, false),
            Going::Rest => (true, true),
        };
        self.going = Going::Rest;
        self.clutch = None;
        self.grip = None;
        if dead {
            self.dead = self.epoch;
        }
        if !base && !arm {
            return Vec::new();
        }
        self.stops = STOPS;
        self.next_stop = now.time + AGAIN;
        vec![self.command(rest(base, arm), None, None, None, now)]
    }

    fn refuse(&mut self, intent: &Intent, code: &'static str, why: &str, now: Now<'_>) -> Vec<Out> {
        let mut out = Vec::new();
        if self.going != Going::Rest {
            out.extend(self.end(now, true));
        }
        self.dead = self.dead.max(intent.epoch);
        if self.told != intent.epoch {
            self.told = intent.epoch;
            out.push(Out::Refuse {
                seq: intent.seq,
                code,
                reason: why.to_owned(),
            });
        }
        out
    }

    /// What is held, as velocities.
    fn drive(&mut self, intent: &Intent, held: &Held, now: Now<'_>) -> Vec<Out> {
        let latch = intent.mode == v1::InputMode::Latch;
        let before = match self.going {
            Going::Driving(driving) => Some(driving),
            Going::Rest | Going::Stepping(_) => None,
        };
        let since = match before {
            Some(driving) if driving.epoch == intent.epoch => driving.since,
            _ => now.time,
        };
        if latch && now.time - since >= LATCH {
            return self.end(now, true);
        }
        let speeds = Speeds::of(intent.speed);
        let base = self.base(held, &speeds, now);
        let was = before.unwrap_or(Driving {
            epoch: intent.epoch,
            since,
            latch,
            base: matches!(self.going, Going::Stepping(_)),
            arm: false,
        });
        let arm = match held.clutch {
            Some(clutch) => match self.follow(intent.epoch, &clutch, now) {
                Ok(target) => Some(target),
                Err(why) => return self.refuse(intent, "NO_POSE", why, now),
            },
            None => {
                self.clutch = None;
                self.twist(held, &speeds, now)
            }
        };
        let gripper = self.grip(held.grip, &speeds, now);
        self.held = *held;
        self.stopped = false;
        self.stops = 0;
        self.going = Going::Driving(Driving {
            epoch: intent.epoch,
            since,
            latch,
            base: base.is_some(),
            arm: arm.is_some(),
        });
        let work = match (&base, &arm) {
            (Some(_), _) => Work::Chair,
            (None, Some(_)) => Work::Arm,
            (None, None) => Work::Gripper,
        };
        let hold = v1::arm_command::Target::Hold(true);
        let command = v1::Command {
            base: base.or(was.base.then(v1::BaseCommand::default)),
            arm: arm
                .or(was.arm.then_some(hold))
                .map(|target| v1::ArmCommand {
                    target: Some(target),
                }),
            gripper,
            ..v1::Command::default()
        };
        let (shown, seq) = (intent.shown, Some(intent.seq));
        vec![self.command(command, Some(work), shown, seq, now)]
    }

    /// The chair's speeds, no faster than the age of the picture allows.
    fn base(&self, held: &Held, speeds: &Speeds, now: Now<'_>) -> Option<v1::BaseCommand> {
        if held.chair == [0.0; 2] {
            return None;
        }
        let linear = held.chair[0] * speeds.chair[0];
        let angular = held.chair[1] * speeds.chair[1];
        let cap = speed::cap(self.age(now.newest())?);
        // No corner of the chair turns faster than the chair may go.
        let fastest = linear.abs().max(angular.abs() * self.limits.corner);
        let share = (cap / fastest.max(cap)).min(1.0);
        Some(v1::BaseCommand {
            linear: linear * share,
            angular: angular * share,
        })
    }

    /// The hand's velocity: along the axes of the chair, turning about its own.
    fn twist(&self, held: &Held, speeds: &Speeds, now: Now<'_>) -> Option<v1::arm_command::Target> {
        if held.hand == [0.0; 3] && held.turn == [0.0; 3] {
            return None;
        }
        let most = |v: Vector3<f64>| v / v.norm().max(1.0);
        let share = (speed::cap(self.age(now.newest())?) / speed::cap(0.0)).min(1.0);
        let linear = most(Vector3::from(held.hand)) * speeds.hand[0] * share;
        let about_tool = most(tool_axes(held.turn)) * speeds.hand[1] * share;
        let mount = now.situation.mount()?;
        let tool = now.situation.base_from_tool?.rotation;
        Some(v1::arm_command::Target::Twist(v1::CartesianTwist {
            frame: v1::CommandFrame::Wheelchair.into(),
            twist: Some(geometry::twist(&linear, &(mount * tool * about_tool))),
        }))
    }

    fn follow(
        &mut self,
        epoch: u32,
        clutch: &crate::protocol::Clutch,
        now: Now<'_>,
    ) -> Result<v1::arm_command::Target, &'static str> {
        let unknown = "the hand's pose has not come yet";
        let present = now.situation.base_from_tool.ok_or(unknown)?;
        let mount = now.situation.mount().ok_or(unknown)?;
        let mut engaged = match self.clutch.take() {
            Some(engaged) if engaged.epoch() == epoch => engaged,
            _ => Engaged::new(epoch, present),
        };
        let target = engaged.follow(clutch, &mount, &present);
        self.clutch = Some(engaged);
        Ok(v1::arm_command::Target::Pose(v1::CartesianTarget {
            frame: v1::CommandFrame::BaseLink.into(),
            pose: Some(geometry::pose(&target)),
        }))
    }

    /// The fingers' target after as much time as has passed.
    fn grip(&mut self, way: f64, speeds: &Speeds, now: Now<'_>) -> Option<v1::GripperCommand> {
        if way == 0.0 {
            self.grip = None;
            return None;
        }
        let (from, at) = match self.grip {
            Some(grip) => grip,
            None => (self.opening(now.situation)?, now.time),
        };
        let passed = (now.time - at).clamp(0.0, GRIP_TIME);
        let opening = (from + way * speeds.grip * passed).clamp(0.0, self.limits.stroke);
        self.grip = Some((opening, now.time));
        Some(opening_of(opening))
    }

    /// Opening that the fingers were told last, m.
    fn opening(&self, situation: &Situation) -> Option<f64> {
        let told = situation.applied.as_ref().map(|a| a.knuckle);
        let opening = self.limits.linkage.zip(told.or(situation.knuckle()));
        opening.map(|(linkage, knuckle)| linkage.opening(knuckle).max(0.0))
    }

    fn step(
        &mut self,
        intent: &Intent,
        part: Part,
        axis: usize,
        sign: f64,
        now: Now<'_>,
    ) -> Vec<Out> {
        let speeds = Speeds::of(intent.speed);
        let [metres, radians] = speeds.step;
        let unknown = "the robot's pose has not come yet";
        let mut command = v1::Command::default();
        match part {
            Part::Chair => {
                let way = if axis == 0 { metres } else { radians };
                let Some(step) = ChairStep::new(axis == 1, sign * way, now.time, now.situation)
                else {
                    return self.refuse(intent, "NO_POSE", unknown, now);
                };
                self.dead = intent.epoch;
                self.stopped = false;
                self.stops = 0;
                self.going = Going::Stepping(step);
                return self.tick(now);
            }
            Part::Hand | Part::Turn => {
                if let Some(why) = behind(now.situation) {
                    return self.refuse(intent, "AHEAD", why, now);
                }
                let mut along = [0.0; 3];
                along[axis] = sign;
                self.held = Held::default();
                match part {
                    Part::Hand => self.held.hand = along,
                    _ => self.held.turn = along,
                }
                let (translation, rotation) = match part {
                    Part::Hand => (Vector3::from(along) * metres, Vector3::zeros()),
                    _ => (Vector3::zeros(), tool_axes(along) * radians),
                };
                command.arm = Some(v1::ArmCommand {
                    target: Some(v1::arm_command::Target::Step(v1::CartesianStep {
                        frame: v1::CommandFrame::Wheelchair.into(),
                        translation: Some(geometry::vector(&translation)),
                        rotation: Some(geometry::vector(&rotation)),
                    })),
                });
            }
            Part::Grip => {
                let Some(from) = self.opening(now.situation) else {
                    return self.refuse(intent, "NO_POSE", unknown, now);
                };
                let opening = from + sign * speeds.grip_step;
                command.gripper = Some(opening_of(opening.clamp(0.0, self.limits.stroke)));
            }
        }
        // One press is one step, however often it is said.
        self.dead = intent.epoch;
        self.stopped = false;
        let work = match part {
            Part::Grip => Work::Gripper,
            _ => Work::Arm,
        };
        // The gate takes no answers to states that are a second old; a step ends by
        // itself, so the gateway answers for it.
        let fresh = self.age(now.newest()).is_some_and(|age| age < 0.9);
        let shown = intent.shown.filter(|_| fresh);
        vec![self.command(command, Some(work), shown, Some(intent.seq), now)]
    }

    fn command(
        &self,
        mut command: v1::Command,
        work: Option<Work>,
        shown: Option<u64>,
        seq: Option<u32>,
        now: Now<'_>,
    ) -> Out {
        command.device = self.device.into();
        command.mode = self.mode.into();
        command.assistance = v1::Assistance::None.into();
        if let Some(work) = work {
            let (phase, name) = phase::of(work, now.situation.pad_force);
            command.phase = phase.into();
            name.clone_into(&mut command.phase_name);
        }
        Out::Send {
            command: Box::new(command),
            shown,
            seq,
        }
    }
}

/// Roll to the right, pitch downwards and yaw to the left as turns about the tool's
/// own axes: x is to the left, y upwards and z ahead of a level hand.
fn tool_axes([roll, pitch, yaw]: [f64; 3]) -> Vector3<f64> {
    Vector3::new(pitch, yaw, roll)
}

fn opening_of(metres: f64) -> v1::GripperCommand {
    v1::GripperCommand {
        target: Some(v1::gripper_command::Target::Opening(metres)),
        max_force: None,
    }
}

/// A chair at rest and an arm that holds.
fn rest(base: bool, arm: bool) -> v1::Command {
    v1::Command {
        base: base.then(v1::BaseCommand::default),
        arm: arm.then_some(v1::ArmCommand {
            target: Some(v1::arm_command::Target::Hold(true)),
        }),
        ..v1::Command::default()
    }
}

/// Why the hand takes no further step now.
fn behind(situation: &Situation) -> Option<&'static str> {
    let applied = situation.applied.as_ref()?;
    let desired = normalized("desired pose", applied.desired_pose.as_ref()).ok()?;
    let present = situation.base_from_tool?;
    let way = (desired.translation.vector - present.translation.vector).norm();
    let turn = desired.rotation.angle_to(&present.rotation);
    (way > LEAD[0] || turn > LEAD[1]).then_some("the hand is still on its way")
}

#[cfg(test)]
mod tests;
