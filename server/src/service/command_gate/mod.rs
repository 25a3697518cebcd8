//! The command gate: validates and queues the commands of the commander that holds
//! control, and keeps the newest one per actuator group. Every rejected command is
//! counted and reported with a reason.
//!
//! Command age is wall time in real-time pacing, simulation time otherwise. The time
//! that a command waits for its tick is wall time, except in lock-step. The caller
//! passes both in seconds, so this module reads no clock.

mod admit;
mod goal_stream;
mod lease;
mod rate;
mod span;

use std::collections::BTreeMap;
use std::time::Instant;

use wheelarm_proto::limits::STALE_COMMAND_SECONDS;
use wheelarm_proto::v1;

pub use self::admit::{MAX_BYTES, Refused};
use self::goal_stream::GoalStream;
pub use self::lease::{ControlRequest, Granted, Lease, Life};
pub use self::rate::Bucket;
pub use self::span::SetPoints;
use self::span::Span;
use super::denied::Denied;
use crate::robot::control::{ArmIntent, BaseIntent, ControlInput, GripperMap};

/// Commands per second and burst size for the holder: several times the 60 control
/// ticks per second. Not applied in lock-step, which requests each command.
const RATE: (f64, f64) = (400.0, 200.0);

/// Base intent of a braked chair.
pub(super) const REST: BaseIntent = BaseIntent {
    linear: 0.0,
    angular: 0.0,
};

/// Output of the gate for one control tick.
#[derive(Debug, Default)]
pub struct GateOutput {
    /// Input of the simulation.
    pub input: ControlInput,
    /// Accepted commands since the last tick, oldest first.
    pub commands: Vec<v1::Command>,
    /// Actuator groups that the gate stopped.
    pub stopped: StoppedGroups,
}

/// Actuator groups that the gate stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoppedGroups {
    /// The chair brakes.
    pub base: bool,
    /// The arm holds.
    pub arm: bool,
    /// Control ended: no further commands of the former holder are delivered.
    pub control: bool,
}

impl StoppedGroups {
    /// Whether any group is stopped.
    #[must_use]
    pub fn any(self) -> bool {
        self.base || self.arm
    }
}

/// Which commands the gate accepts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Listening {
    /// Running episode; 0 between episodes.
    pub episode: u64,
    /// Every control tick waits for a command of the holder.
    pub lock_step: bool,
    /// Commands are replayed: the age rule is off.
    pub replay: bool,
}

/// Arrival time of the command in force for each group, by the age clock, s.
struct ArrivalTimes {
    base: f64,
    arm: f64,
}

/// Activity of a group whose commands become stale.
#[derive(Debug, Default)]
struct Active {
    /// Arrival time of the newest command in force, if it commands motion, s.
    since: Option<f64>,
}

/// A command that passed all checks, with its converted value.
#[derive(Debug)]
struct Accepted {
    /// Wall time of arrival, s.
    arrived: f64,
    command: v1::Command,
    input: ControlInput,
}

/// The command gate.
#[derive(Debug)]
pub struct CommandGate {
    gripper: GripperMap,
    listening: Listening,
    lease: Lease,
    rate: Bucket,
    /// Groups to stop at the next control tick.
    brake: StoppedGroups,
    pending: Vec<Accepted>,
    /// Lock-step: commands by the tick they answer.
    answers: BTreeMap<u64, Accepted>,
    /// Lock-step: the command that covers several control ticks.
    span: Option<Span>,
    /// Set points in force, from which the next span starts.
    set_points: Option<SetPoints>,
    next_tick: u64,
    base: Active,
    twist: Active,
    goal_stream: GoalStream,
    refused: u64,
    phase: (i32, String),
    /// Why the gate is closed; empty while it is open.
    closed: String,
}

impl CommandGate {
    /// A gate for a robot with this gripper.
    #[must_use]
    pub fn new(gripper: GripperMap) -> Self {
        Self {
            gripper,
            listening: Listening::default(),
            lease: Lease::default(),
            rate: Bucket::new(RATE.0, RATE.1),
            brake: StoppedGroups::default(),
            pending: Vec::new(),
            answers: BTreeMap::new(),
            span: None,
            set_points: None,
            next_tick: 0,
            base: Active::default(),
            twist: Active::default(),
            goal_stream: GoalStream::default(),
            refused: 0,
            phase: (0, String::new()),
            closed: String::new(),
        }
    }

    /// Changes the gripper. Call [`CommandGate::renew`] afterwards: queued commands were
    /// converted for the former gripper.
    pub fn set_gripper(&mut self, gripper: GripperMap) {
        self.gripper = gripper;
    }

    /// Rejects every command with `why`, until [`CommandGate::renew`].
    pub fn close(&mut self, why: &str) {
        why.clone_into(&mut self.closed);
    }

    /// Drops pending commands, stops the motion they started, and applies new rules.
    pub fn listen(&mut self, listening: Listening, next_tick: u64) {
        self.brake.base |= self.base.since.is_some();
        self.brake.arm |= self.twist.since.is_some();
        self.listening = listening;
        self.pending.clear();
        self.answers.clear();
        self.span = None;
        self.next_tick = next_tick;
        self.base = Active::default();
        self.twist = Active::default();
        self.goal_stream.clear();
        self.phase = (0, String::new());
    }

    /// As [`CommandGate::listen`] for another robot, which is at rest.
    pub fn renew(&mut self, listening: Listening, next_tick: u64) {
        self.listen(listening, next_tick);
        self.brake = StoppedGroups::default();
        self.closed.clear();
    }

    /// The lease on control.
    #[must_use]
    pub fn lease(&self) -> &Lease {
        &self.lease
    }

    /// Handles the loss of a commander's liveliness token; true when its control ended.
    pub fn token_lost(&mut self, life: &Life) -> bool {
        let ended = self.lease.end(life);
        if ended {
            self.end_control();
        }
        ended
    }

    /// Requests or takes control for a commander whose liveliness token exists.
    ///
    /// # Errors
    /// The current holder, and how to take control over.
    pub fn request_control(
        &mut self,
        life: Life,
        request: &ControlRequest,
        now: Instant,
    ) -> Result<Granted, Denied> {
        let granted = self.lease.request(life, request, now)?;
        if matches!(granted, Granted::From(_)) {
            self.end_control();
        }
        Ok(granted)
    }

    /// Releases control; true when `life` held it.
    ///
    /// # Errors
    /// When `secret` is not the lease's.
    pub fn release(&mut self, life: &Life, secret: &str) -> Result<bool, Denied> {
        let ended = self.lease.release(life, secret)?;
        if ended {
            self.end_control();
        }
        Ok(ended)
    }

    /// The chair brakes and the arm holds until the next holder commands them.
    fn end_control(&mut self) {
        self.pending.clear();
        self.answers.clear();
        self.span = None;
        self.base = Active::default();
        self.twist = Active::default();
        self.goal_stream.clear();
        self.brake = StoppedGroups {
            base: true,
            arm: true,
            control: true,
        };
    }

    /// Number of commands rejected so far.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Phase and phase name of the newest command.
    #[must_use]
    pub fn phase(&self) -> (i32, &str) {
        (self.phase.0, &self.phase.1)
    }

    /// Whether the lock-step commander has answered `tick`.
    #[must_use]
    pub fn answered(&self, tick: u64) -> bool {
        let spanned = || self.span.as_ref().is_some_and(|span| span.covers(tick));
        !self.listening.lock_step || self.answers.contains_key(&tick) || spanned()
    }

    /// Whether a command or a brake waits for the next control tick.
    #[must_use]
    pub fn has_pending(&self) -> bool {
        !self.pending.is_empty() || self.brake.any()
    }

    /// Sets the set points in force before the next control tick. A command that covers
    /// several ticks starts from them.
    pub fn set_set_points(&mut self, set_points: SetPoints) {
        self.set_points = Some(set_points);
    }

    /// Returns the input to apply at `tick`. `now` is the age clock, `wall` the clock of
    /// [`CommandGate::accept`], both in seconds.
    pub fn take(&mut self, tick: u64, now: f64, wall: f64) -> GateOutput {
        let accepted: Vec<Accepted> = if self.listening.lock_step {
            self.answers.remove(&tick).into_iter().collect()
        } else {
            std::mem::take(&mut self.pending)
        };
        let lock_step = self.listening.lock_step;
        // Simulation time may have been paused since arrival: the wait counts as age.
        let arrival = |arrived: f64| match lock_step {
            true => now,
            false => now - (wall - arrived).max(0.0),
        };
        let mut since = ArrivalTimes {
            base: now,
            arm: now,
        };
        self.next_tick = tick + 1;
        let mut taken = self.take_stops();
        // In lock-step time waits for commands, so none is late.
        let smooth = !self.listening.lock_step && !self.listening.replay;
        let none = accepted.is_empty();
        for Accepted {
            arrived,
            command,
            mut input,
        } in accepted
        {
            let arrived = arrival(arrived);
            if command.phase != 0 {
                let name = command.phase_name.chars().take(64).collect();
                self.phase = (command.phase, name);
            }
            self.span = None;
            if let (Some(set_points), true) = (self.set_points, command.over_ticks > 1) {
                let span = Span::new(set_points, input.clone(), tick, command.over_ticks);
                input = span.input(tick).unwrap_or(input);
                self.span = Some(span);
            }
            let arm = match input.arm {
                Some(arm) if smooth => self.goal_stream.push(tick, command.answers_tick(), arm),
                arm => arm,
            };
            if arm.is_some() {
                since.arm = arrived;
            }
            if input.base.is_some() {
                since.base = arrived;
            }
            taken.input.arm = arm.or(taken.input.arm);
            taken.input.base = input.base.or(taken.input.base);
            taken.input.gripper = input.gripper.or(taken.input.gripper);
            taken.commands.push(command);
        }
        if smooth {
            taken.input.arm = self.goal_stream.play(tick).or(taken.input.arm);
        }
        // A command for this tick has priority over a span.
        if none && let Some(input) = self.span.as_ref().and_then(|span| span.input(tick)) {
            taken.input = ControlInput {
                arm: input.arm.or(taken.input.arm.take()),
                base: input.base.or(taken.input.base),
                gripper: input.gripper.or(taken.input.gripper),
            };
        }
        self.apply_age(&mut taken, &since, now);
        taken
    }

    /// The input that stops the groups marked in `brake`, once.
    fn take_stops(&mut self) -> GateOutput {
        let brake = std::mem::take(&mut self.brake);
        let mut taken = GateOutput {
            stopped: brake,
            ..GateOutput::default()
        };
        taken.input.base = brake.base.then_some(REST);
        taken.input.arm = brake.arm.then_some(ArmIntent::Hold);
        taken
    }

    fn apply_age(&mut self, taken: &mut GateOutput, arrived: &ArrivalTimes, now: f64) {
        if let Some(base) = taken.input.base {
            let moves = base.linear != 0.0 || base.angular != 0.0;
            self.base.since = moves.then_some(arrived.base);
        }
        match taken.input.arm {
            Some(ArmIntent::Twist { .. }) => self.twist.since = Some(arrived.arm),
            Some(_) => self.twist.since = None,
            None => {}
        }
        if self.listening.replay {
            return;
        }
        let stale = |group: &Active| {
            group
                .since
                .is_some_and(|since| now - since >= STALE_COMMAND_SECONDS)
        };
        if stale(&self.base) {
            self.base.since = None;
            taken.input.base = Some(REST);
            taken.stopped.base = true;
        }
        if stale(&self.twist) {
            self.twist.since = None;
            taken.input.arm = Some(ArmIntent::Hold);
            taken.stopped.arm = true;
        }
    }
}

#[cfg(test)]
mod tests;
