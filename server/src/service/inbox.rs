//! The gate: keeps the newest valid command per actuator group of the one
//! commander that holds control and lets nothing else through. Everything
//! refused is counted and gets its reason.
//!
//! Age is wall time in real-time pacing and simulation time otherwise, and what a
//! command waits for its tick is wall time but in lock-step; the caller passes both
//! in seconds, so that this file knows no clock.

mod admit;
mod goals;
mod lease;
mod rate;
mod span;

use std::collections::BTreeMap;
use std::time::Instant;

use wheelarm_proto::v1;

pub use self::admit::{MAX_BYTES, Refused};
use self::goals::Goals;
pub use self::lease::{Asked, Granted, Lease, Life};
pub use self::rate::Bucket;
use self::span::Span;
pub use self::span::Standing;
use super::convert;
use super::denied::Denied;
use crate::robot::control::{ArmIntent, BaseIntent, ControlInput, GripperMap};

/// Age of the newest chair or twist command at which braking starts, s.
pub const STALE_SECS: f64 = 0.25;

/// Commands of the holder per second, and at once: several times what the 60
/// control ticks of a second can use. Not in lock-step, which asks for each.
const RATE: (f64, f64) = (400.0, 200.0);

/// A chair that is braked.
pub(super) const REST: BaseIntent = BaseIntent {
    linear: 0.0,
    angular: 0.0,
};

/// What one control tick takes from the gate.
#[derive(Debug, Default)]
pub struct Taken {
    /// Input of the simulation.
    pub input: ControlInput,
    /// Accepted commands since the last tick, oldest first.
    pub commands: Vec<v1::Command>,
    /// What the gate stopped.
    pub stopped: Stopped,
}

/// Groups that are stopped, or to be stopped, by the gate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stopped {
    /// The chair brakes.
    pub base: bool,
    /// The arm holds.
    pub arm: bool,
    /// Control has ended: nothing of who had it comes any more.
    pub control: bool,
}

impl Stopped {
    /// Whether the gate stopped anything.
    #[must_use]
    pub fn any(self) -> bool {
        self.base || self.arm
    }
}

/// Whom the gate listens to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Listening {
    /// Running episode; 0 between episodes.
    pub episode: u64,
    /// Every control tick waits for the answer of the commander in control.
    pub lock_step: bool,
    /// Commands are a replay: no age rule.
    pub replay: bool,
}

/// When what is in force for each group came, by the age clock, s.
struct Since {
    base: f64,
    arm: f64,
}

/// Activity of a group that goes stale.
#[derive(Debug, Default)]
struct Active {
    /// Time of the newest command in force, if it moves anything.
    since: Option<f64>,
}

/// The gate.
#[derive(Debug)]
pub struct Inbox {
    gripper: GripperMap,
    listening: Listening,
    lease: Lease,
    rate: Bucket,
    /// What is to be stopped at the next control tick.
    brake: Stopped,
    /// With the wall time at which each came, seconds.
    pending: Vec<(f64, v1::Command)>,
    /// Lock-step: commands by the tick they answer.
    answers: BTreeMap<u64, v1::Command>,
    /// Lock-step: the command that answers for several control ticks.
    span: Option<Span>,
    /// What is in force, for the next span.
    standing: Option<Standing>,
    next_tick: u64,
    base: Active,
    twist: Active,
    goals: Goals,
    refused: u64,
    phase: (i32, String),
    /// Why no command is taken at all; empty when they are.
    closed: String,
}

impl Inbox {
    /// A gate for a robot with this gripper.
    #[must_use]
    pub fn new(gripper: GripperMap) -> Self {
        Self {
            gripper,
            listening: Listening::default(),
            lease: Lease::default(),
            rate: Bucket::new(RATE.0, RATE.1),
            brake: Stopped::default(),
            pending: Vec::new(),
            answers: BTreeMap::new(),
            span: None,
            standing: None,
            next_tick: 0,
            base: Active::default(),
            twist: Active::default(),
            goals: Goals::default(),
            refused: 0,
            phase: (0, String::new()),
            closed: String::new(),
        }
    }

    /// From now on it is the gate of a robot with this gripper.
    pub fn fit(&mut self, gripper: GripperMap) {
        self.gripper = gripper;
    }

    /// Refuses every command with `why`, until [`Inbox::renew`].
    pub fn close(&mut self, why: &str) {
        why.clone_into(&mut self.closed);
    }

    /// Starts listening anew: pending commands are dropped, and what they had
    /// set in motion is stopped.
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
        self.goals.clear();
        self.phase = (0, String::new());
    }

    /// As [`Inbox::listen`] for another robot, which stands still.
    pub fn renew(&mut self, listening: Listening, next_tick: u64) {
        self.listen(listening, next_tick);
        self.brake = Stopped::default();
        self.closed.clear();
    }

    /// Who is in control.
    #[must_use]
    pub fn lease(&self) -> &Lease {
        &self.lease
    }

    /// A commander's token vanished; true when control ended with it.
    pub fn vanished(&mut self, life: &Life) -> bool {
        let ended = self.lease.end(life);
        if ended {
            self.end_control();
        }
        ended
    }

    /// Asks for control, or takes it. Who asks has a token that stands.
    ///
    /// # Errors
    /// Who has it, and how to get it.
    pub fn ask(&mut self, life: Life, asked: &Asked, now: Instant) -> Result<Granted, Denied> {
        let granted = self.lease.ask(life, asked, now)?;
        if matches!(granted, Granted::From(_)) {
            self.end_control();
        }
        Ok(granted)
    }

    /// Gives control back; true when `life` had it.
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

    /// The chair brakes and the arm holds until somebody commands them.
    fn end_control(&mut self) {
        self.pending.clear();
        self.answers.clear();
        self.span = None;
        self.base = Active::default();
        self.twist = Active::default();
        self.goals.clear();
        self.brake = Stopped {
            base: true,
            arm: true,
            control: true,
        };
    }

    /// Commands refused so far.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Phase as the newest command tells it, with its finer name.
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

    /// Tells what is in force before the next control tick, from which a command
    /// for several of them goes on.
    pub fn stands(&mut self, standing: Standing) {
        self.standing = Some(standing);
    }

    /// Takes what is to be applied at `tick`; `now` is the age clock and `wall` the
    /// clock of [`Inbox::accept`], both in seconds.
    pub fn take(&mut self, tick: u64, now: f64, wall: f64) -> Taken {
        let commands: Vec<_> = if self.listening.lock_step {
            self.answers
                .remove(&tick)
                .map(|c| (now, c))
                .into_iter()
                .collect()
        } else {
            // Time may have stood since one came: what moves is as old as it is.
            let came = |(at, command): (f64, v1::Command)| (now - (wall - at).max(0.0), command);
            std::mem::take(&mut self.pending)
                .into_iter()
                .map(came)
                .collect()
        };
        let mut since = Since {
            base: now,
            arm: now,
        };
        self.next_tick = tick + 1;
        let mut taken = self.stopped();
        // In lock-step time waits, so nothing is late.
        let even = !self.listening.lock_step && !self.listening.replay;
        for (came, command) in &commands {
            if command.phase != 0 {
                let name = command.phase_name.chars().take(64).collect();
                self.phase = (command.phase, name);
            }
            // Checked when it came in, so that nothing can be missing here.
            let Ok(mut input) = convert::control_input(command, &self.gripper) else {
                continue;
            };
            self.span = None;
            if let (Some(standing), true) = (self.standing, command.over_ticks > 1) {
                let span = Span::new(standing, input.clone(), tick, command.over_ticks);
                input = span.input(tick).unwrap_or(input);
                self.span = Some(span);
            }
            let arm = match input.arm {
                Some(arm) if even => self.goals.came(tick, command.answers_tick(), arm),
                arm => arm,
            };
            if arm.is_some() {
                since.arm = *came;
            }
            if input.base.is_some() {
                since.base = *came;
            }
            taken.input.arm = arm.or(taken.input.arm);
            taken.input.base = input.base.or(taken.input.base);
            taken.input.gripper = input.gripper.or(taken.input.gripper);
        }
        if even {
            taken.input.arm = self.goals.play(tick).or(taken.input.arm);
        }
        // An answer of its own comes before that of a span.
        if commands.is_empty()
            && let Some(input) = self.span.as_ref().and_then(|span| span.input(tick))
        {
            taken.input = ControlInput {
                arm: input.arm.or(taken.input.arm.take()),
                base: input.base.or(taken.input.base),
                gripper: input.gripper.or(taken.input.gripper),
            };
        }
        taken.commands = commands.into_iter().map(|(_, command)| command).collect();
        self.apply_age(&mut taken, &since, now);
        taken
    }

    /// What stops the groups that are to be stopped, once.
    fn stopped(&mut self) -> Taken {
        let brake = std::mem::take(&mut self.brake);
        let mut taken = Taken {
            stopped: brake,
            ..Taken::default()
        };
        taken.input.base = brake.base.then_some(REST);
        taken.input.arm = brake.arm.then_some(ArmIntent::Hold);
        taken
    }

    fn apply_age(&mut self, taken: &mut Taken, came: &Since, now: f64) {
        if let Some(base) = taken.input.base {
            let moves = base.linear != 0.0 || base.angular != 0.0;
            self.base.since = moves.then_some(came.base);
        }
        match taken.input.arm {
            Some(ArmIntent::Twist { .. }) => self.twist.since = Some(came.arm),
            Some(_) => self.twist.since = None,
            None => {}
        }
        if self.listening.replay {
            return;
        }
        let stale = |group: &Active| group.since.is_some_and(|since| now - since >= STALE_SECS);
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
