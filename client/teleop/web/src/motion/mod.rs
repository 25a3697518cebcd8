//! Intents of a page become commands. Pure: intents, the known state of the robot, and time
//! in; commands out.
//!
//! The rules: every intent counts once, in order. The age of the displayed image limits the
//! speed of the chair; older images allow steps, then only a stop. Every event that ends a
//! motion (a stop, silence, a rejection, a contact, a frozen image, lost control) ends its
//! epoch: the same press never moves the robot again. Times are seconds of the caller's
//! clock.
//!
//! `press` turns accepted intents into commands, within the limits of `chair`, `hand` and
//! `fingers`.

mod chair;
mod chair_step;
mod clutch;
mod fingers;
mod hand;
mod press;

use wheelarm_proto::v1;

use self::chair::Chair;
use self::chair_step::ChairStep;
use self::clutch::Engaged;
use self::fingers::Fingers;
use crate::phase::{self, Work};
use crate::protocol::{Action, Held, Intent};
use crate::speed::{self, Allow};
use crate::watch::Situation;

/// Silence of the page after which held motion stops, s.
pub const STALL: f64 = 0.25;
/// Silence of the page after which a step or a goal stops, s.
pub const GONE: f64 = 1.0;
/// Longest motion of one press that latches, s.
pub const LATCH: f64 = 2.0;
/// Time between two repetitions of a stop, s.
const AGAIN: f64 = 0.05;
/// Repetitions of a stop.
const STOPS: u8 = 2;

/// Output of an intent, or of time.
#[derive(Clone, Debug, PartialEq)]
pub enum Out {
    /// A command that answers the state of a tick.
    Send {
        /// The command.
        command: Box<v1::Command>,
        /// Tick that it answers; the newest one where absent.
        shown: Option<u64>,
        /// The page's number, where it results from an intent.
        seq: Option<u32>,
    },
    /// An intent was rejected.
    Refuse {
        /// The page's number.
        seq: u32,
        /// Code for programs.
        code: &'static str,
        /// Reason for people.
        reason: String,
    },
    /// A note for the person.
    Note(String),
    /// Ends a goal.
    EndGoal,
}

/// Motion of this page.
#[derive(Clone, Debug, Default, PartialEq)]
enum Going {
    #[default]
    Rest,
    /// Held or latched.
    Driving(Driving),
    /// The chair makes one step.
    Stepping(ChairStep),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Driving {
    epoch: u32,
    /// Time of the press, s.
    since: f64,
    latch: bool,
    base: bool,
    arm: bool,
}

/// Context of an intent.
#[derive(Clone, Copy)]
pub struct Now<'a> {
    /// Time, s.
    pub time: f64,
    /// The newest samples and status.
    pub situation: &'a Situation,
    /// Whether this page is in control of the robot.
    pub in_control: bool,
    /// Whether a skill runs.
    pub goal: bool,
    /// Lock-step: the simulation waits for an answer to every tick, too fast for a person.
    pub lock_step: bool,
}

impl Now<'_> {
    fn newest(&self) -> u64 {
        self.situation.header.tick
    }
}

/// Motion state of one page.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    chair: Chair,
    fingers: Fingers,
    seq: Option<u32>,
    epoch: u32,
    dead: u32,
    /// When the newest message arrived, s.
    received_at: Option<f64>,
    shown: Option<u64>,
    echo: f64,
    speed: u8,
    device: v1::Device,
    mode: v1::InputMode,
    going: Going,
    stopped: bool,
    /// Repetitions of a stop that remain, and the time of the next one, s.
    stops: u8,
    next_stop: f64,
    clutch: Option<Engaged>,
    /// Epoch for which a refusal was sent.
    refused_epoch: u32,
    /// Last held or stepped input.
    held: Held,
}

impl Motion {
    /// Stores the limits of the simulated robot.
    pub fn fit(&mut self, robot: &v1::RobotDescription) {
        self.chair = Chair::of(robot);
        self.fingers.fit(robot.gripper.as_ref());
    }

    /// Newest accepted number.
    #[must_use]
    pub fn seq(&self) -> u32 {
        self.seq.unwrap_or(0)
    }

    /// Newest epoch received, and newest dead epoch.
    #[must_use]
    pub fn epochs(&self) -> [u32; 2] {
        [self.epoch, self.dead]
    }

    /// Whether a stop is in force until the next fresh press.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// Whether this page moves the robot.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.going != Going::Rest
    }

    /// The page's own clock at its newest message, ms, and the age of that message
    /// at `time`, s.
    #[must_use]
    pub fn echo(&self, time: f64) -> Option<(f64, f64)> {
        self.received_at.map(|at| (self.echo, time - at))
    }

    /// The person's speed, 1 to 5.
    #[must_use]
    pub fn speed(&self) -> u8 {
        self.speed.max(1)
    }

    /// Age of the displayed image when `newest` is the newest state, s.
    #[must_use]
    pub fn age(&self, newest: u64) -> Option<f64> {
        self.shown.map(|shown| speed::age(shown, newest))
    }

    /// Silence of the page at `time`, s.
    #[must_use]
    pub fn silence(&self, time: f64) -> f64 {
        self.received_at.map_or(f64::INFINITY, |at| time - at)
    }

    /// Directions of the last hand motion, as the page protocol names them.
    #[must_use]
    pub fn hand_directions(&self) -> Vec<&'static str> {
        hand::directions(&self.held)
    }

    /// Handles an intent.
    pub fn take(&mut self, intent: &Intent, now: Now<'_>) -> Vec<Out> {
        if self.seq.is_some_and(|newest| intent.seq <= newest) {
            return Vec::new();
        }
        self.seq = Some(intent.seq);
        self.received_at = Some(now.time);
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
                let words = "the image is more than 0.9 s old: only single steps are accepted";
                return self.refuse(intent, "TOO_OLD", words, now);
            }
            (Allow::Stop, _) => {
                let words = match age {
                    None => "no image is shown: only a stop is accepted",
                    Some(_) => "the image is more than 2 s old: only a stop is accepted",
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

    /// Advances the clock to `now`.
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
                    Some("the image is too old: everything stops")
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
                    out.push(Out::Note("the step was interrupted".to_owned()));
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

    /// Ends the motion and its epoch, because of `why`.
    pub fn cut(&mut self, why: &str, now: Now<'_>) -> Vec<Out> {
        if self.going == Going::Rest {
            self.dead = self.epoch;
            return Vec::new();
        }
        let mut out = self.end(now, true);
        out.push(Out::Note(why.to_owned()));
        out
    }

    /// Control or the connection is lost: no further command is sent.
    pub fn forget(&mut self) {
        self.going = Going::Rest;
        self.dead = self.epoch;
        self.stops = 0;
        self.clutch = None;
        self.fingers.rest();
    }

    fn stop(&mut self, intent: &Intent, now: Now<'_>) -> Vec<Out> {
        self.device = intent.device;
        self.mode = intent.mode;
        self.going = Going::Rest;
        self.dead = self.epoch;
        self.stopped = true;
        self.clutch = None;
        self.fingers.rest();
        self.stops = STOPS;
        self.next_stop = now.time + AGAIN;
        let seq = Some(intent.seq);
        vec![
            Out::EndGoal,
            self.command(rest(true, true), None, None, seq, now),
        ]
    }

    fn release(&mut self, intent: &Intent, now: Now<'_>) -> Vec<Out> {
        // The held press is over. A step runs to its end.
        match self.going {
            Going::Driving(_) => {
                self.device = intent.device;
                self.end(now, true)
            }
            Going::Rest | Going::Stepping(_) => Vec::new(),
        }
    }

    /// Stops the motion of this page; with `dead` its press is over.
    fn end(&mut self, now: Now<'_>, dead: bool) -> Vec<Out> {
        let (base, arm) = match self.going {
            Going::Driving(driving) => (driving.base, driving.arm),
            Going::Stepping(_) => (true, false),
            Going::Rest => (true, true),
        };
        self.going = Going::Rest;
        self.clutch = None;
        self.fingers.rest();
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
        if self.refused_epoch != intent.epoch {
            self.refused_epoch = intent.epoch;
            out.push(Out::Refuse {
                seq: intent.seq,
                code,
                reason: why.to_owned(),
            });
        }
        out
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

/// A command that brakes the chair and holds the arm.
pub(crate) fn rest(base: bool, arm: bool) -> v1::Command {
    v1::Command {
        base: base.then(v1::BaseCommand::default),
        arm: arm.then_some(v1::ArmCommand {
            target: Some(v1::arm_command::Target::Hold(true)),
        }),
        ..v1::Command::default()
    }
}

#[cfg(test)]
mod tests;
