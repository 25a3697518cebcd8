//! The gate: keeps the newest valid command per actuator group of the one
//! commander that holds control and lets nothing else through. Everything
//! refused is counted and gets its reason.
//!
//! Age is wall time in real-time pacing and simulation time otherwise; the
//! caller passes it in seconds, so that this file knows no clock.

mod goals;
mod lease;
mod rate;
mod span;

use std::collections::BTreeMap;
use std::time::Instant;

use wheelarm_proto::schema::OtherVersion;
use wheelarm_proto::v1::RefusalCode;
use wheelarm_proto::{Message, PHYSICS_HZ, TICKS_PER_CONTROL, check, seal, v1};

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

/// How far ahead of the simulation a lock-step commander may answer, control ticks.
const MAX_AHEAD: u64 = 8;

/// Age of the state that a command answers beyond which it comes too late to
/// make sense, ticks: 1 s. A link that was frozen delivers what it held back.
const MAX_AGE: u64 = 240;

/// Largest command message, bytes: several times the largest that makes sense.
pub const MAX_BYTES: usize = 4096;

/// How far a sequence number may jump. Commands get lost, but not a million: a
/// number far ahead would lock out whoever counts on.
const MAX_JUMP: u64 = 1_000_000;

/// A chair that is braked.
const REST: BaseIntent = BaseIntent {
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
    /// The gate braked.
    pub stale: bool,
}

/// Why a command was not taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// The commander, empty when it could not be read.
    pub commander: String,
    /// Sequence number of the command.
    pub sequence: u64,
    /// What is wrong, for programs.
    pub code: RefusalCode,
    /// What is wrong and what would be right.
    pub reason: String,
}

/// A code for programs, words for people.
type Why = (RefusalCode, String);

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

/// Groups that are to be stopped at the next control tick.
#[derive(Clone, Copy, Debug, Default)]
struct Brake {
    base: bool,
    arm: bool,
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
    brake: Brake,
    pending: Vec<v1::Command>,
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
            brake: Brake::default(),
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
        self.brake = Brake::default();
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
        self.brake = Brake {
            base: true,
            arm: true,
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

    /// Refuses a message by its length, before it is copied or read.
    pub fn refuse_long(&mut self, bytes: usize) -> Refused {
        self.refused += 1;
        too_long(bytes)
    }

    /// Refuses a message of another version of the contract, unread.
    pub fn refuse_version(&mut self, from: &str, other: &OtherVersion) -> Refused {
        self.refused += 1;
        Refused {
            commander: from.chars().take(64).collect(),
            ..nobody(RefusalCode::Version, other.to_string())
        }
    }

    /// Takes a message at `now`, wall time in seconds, that came under the key of
    /// the commander `from`: nobody speaks for another.
    ///
    /// # Errors
    /// [`Refused`] with the reason; the state is as if it had never come.
    pub fn accept_from(&mut self, from: &str, bytes: &[u8], now: f64) -> Result<(), Refused> {
        self.count(|inbox| inbox.try_accept(Some(from), bytes, now))
    }

    /// As [`Inbox::accept_from`] of whomever the message names.
    ///
    /// # Errors
    /// As [`Inbox::accept_from`].
    pub fn accept(&mut self, bytes: &[u8], now: f64) -> Result<(), Refused> {
        self.count(|inbox| inbox.try_accept(None, bytes, now))
    }

    fn count(
        &mut self,
        taken: impl FnOnce(&mut Self) -> Result<(), Refused>,
    ) -> Result<(), Refused> {
        let result = taken(self);
        if result.is_err() {
            self.refused += 1;
        }
        result
    }

    fn try_accept(&mut self, from: Option<&str>, bytes: &[u8], now: f64) -> Result<(), Refused> {
        if bytes.len() > MAX_BYTES {
            return Err(too_long(bytes.len()));
        }
        let command = v1::Command::decode(bytes).map_err(|e| {
            let words = format!("not a wheelarm.v1.Command: {e}");
            nobody(RefusalCode::Invalid, words)
        })?;
        let header = command.header.clone().unwrap_or_default();
        let refuse = |(code, reason): Why| Refused {
            commander: command.commander.chars().take(64).collect(),
            sequence: header.sequence,
            code,
            reason,
        };
        wheelarm_proto::keys::check_name(&command.commander).map_err(|_| {
            let words = "commander must be 1 to 64 letters, digits, `-` or `_`";
            refuse((RefusalCode::Invalid, words.to_owned()))
        })?;
        if let Some(from) = from.filter(|from| *from != command.commander) {
            let words = format!(
                "the command names {:?} and came under the key of {:?}; send under \
                 `command/NAME` with your own name",
                command.commander,
                check::beginning(from)
            );
            return Err(refuse((RefusalCode::Foreign, words)));
        }
        if !self.closed.is_empty() {
            return Err(refuse((RefusalCode::Closed, self.closed.clone())));
        }
        self.check_control(&command.commander, &header.run_id, bytes)
            .map_err(refuse)?;
        if !self.listening.lock_step && !self.rate.take(now) {
            let words = format!("more than {} commands per second; 60 are of use", RATE.0);
            return Err(refuse((RefusalCode::Rate, words)));
        }
        check::command(&command)
            .and_then(|()| convert::control_input(&command, &self.gripper))
            .map_err(|e| refuse((RefusalCode::Invalid, e.to_string())))?;
        if header.episode != self.listening.episode {
            let words = format!(
                "command is for episode {}, running is {} (0 is none)",
                header.episode, self.listening.episode
            );
            return Err(refuse((RefusalCode::Episode, words)));
        }
        if self.listening.lock_step {
            let tick = command.answers_tick.ok_or_else(|| {
                let words = "in lock-step every command says which state it answers: set \
                             answers_tick to header.tick of the newest `clock`";
                refuse((RefusalCode::NoTick, words.to_owned()))
            })?;
            if !tick.is_multiple_of(TICKS_PER_CONTROL) {
                let words = format!(
                    "command answers tick {tick}, which is no control tick: set answers_tick to \
                     header.tick of the newest `clock`, a multiple of {TICKS_PER_CONTROL}"
                );
                return Err(refuse((RefusalCode::NoTick, words)));
            }
            if tick < self.next_tick {
                let words = format!(
                    "command answers tick {tick}, the simulation is at {}",
                    self.next_tick
                );
                return Err(refuse((RefusalCode::TooOld, words)));
            }
            let ahead = (tick - self.next_tick) / TICKS_PER_CONTROL;
            if self.answers.contains_key(&tick) {
                let words = format!("tick {tick} has been answered already");
                return Err(refuse((RefusalCode::Answered, words)));
            }
            if ahead >= MAX_AHEAD {
                let words = format!("more than {MAX_AHEAD} commands ahead");
                return Err(refuse((RefusalCode::Ahead, words)));
            }
        }
        if !self.listening.lock_step {
            if command.over_ticks > 1 {
                let words = "over_ticks is for lock-step, where time waits for answers; send a \
                             command per control tick, or start a server with --pacing lock-step";
                return Err(refuse((RefusalCode::Invalid, words.to_owned())));
            }
            self.check_age(&command).map_err(refuse)?;
        }
        self.check_sequence(header.sequence).map_err(refuse)?;
        if self.listening.lock_step {
            self.answers.insert(command.answers_tick(), command);
        } else {
            // Between two control ticks only the newest of each group counts,
            // so a flood costs no memory.
            if self.pending.len() >= 256 {
                self.pending.remove(0);
            }
            self.pending.push(command);
        }
        Ok(())
    }

    fn check_control(&self, name: &str, run_id: &str, bytes: &[u8]) -> Result<(), Why> {
        let Some(holder) = self.lease.holder() else {
            return Err((
                RefusalCode::NoControl,
                "nobody holds control; ask for control first (query `lease`)".to_owned(),
            ));
        };
        let life = &holder.life;
        if life.name != name {
            return Err((
                RefusalCode::ControlHeld,
                format!(
                    "control is held by {:?}; take it over with the query `lease`",
                    life.name
                ),
            ));
        }
        if life.run_id != run_id {
            return Err((
                RefusalCode::ControlHeld,
                format!("control is held by another process that is named {name:?} too"),
            ));
        }
        if holder.sealed && !seal::holds(bytes, &holder.secret) {
            return Err((
                RefusalCode::Seal,
                format!(
                    "{name:?} seals its commands, and this one has no seal or a wrong one: somebody \
                 else sends in its name"
                ),
            ));
        }
        Ok(())
    }

    /// Refuses what comes too late to make sense. What only stops is taken at
    /// any age; what drives must say which state it answers.
    fn check_age(&self, command: &v1::Command) -> Result<(), Why> {
        if check::stops(command) {
            return Ok(());
        }
        let Some(tick) = command.answers_tick else {
            if check::drives(command) {
                return Err((
                    RefusalCode::NoTick,
                    "answers_tick is missing: a command that drives the chair or gives the arm a \
                     twist says which state it answers; set it to header.tick of the newest `clock`"
                        .to_owned(),
                ));
            }
            return Ok(());
        };
        // The newest state that anybody can have seen.
        let newest = self.next_tick.saturating_add(TICKS_PER_CONTROL);
        if tick > newest {
            return Err((
                RefusalCode::Ahead,
                format!(
                    "command answers tick {tick}, which the simulation has not reached (it is at {})",
                    self.next_tick
                ),
            ));
        }
        let age = self.next_tick.saturating_sub(tick);
        if age > MAX_AGE {
            return Err((
                RefusalCode::TooOld,
                format!(
                    "command answers a state that is {:.2} s old, at most 1 s is taken",
                    age as f64 / PHYSICS_HZ as f64
                ),
            ));
        }
        Ok(())
    }

    fn check_sequence(&mut self, sequence: u64) -> Result<(), Why> {
        let Some(holder) = self.lease.holder_mut() else {
            return Ok(());
        };
        if let Some(last) = holder.last_sequence
            && sequence <= last
        {
            return Err((
                RefusalCode::Sequence,
                format!(
                    "sequence number {sequence} is not newer than {last} (old, repeated or reordered); \
                 asking for control again starts the numbers anew"
                ),
            ));
        }
        if let Some(last) = holder.last_sequence
            && sequence - last > MAX_JUMP
        {
            return Err((
                RefusalCode::Sequence,
                format!(
                    "sequence number {sequence} jumps by more than {MAX_JUMP} from {last}; count up \
                 by one per command"
                ),
            ));
        }
        holder.last_sequence = Some(sequence);
        Ok(())
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
        !self.pending.is_empty() || self.brake.base || self.brake.arm
    }

    /// Tells what is in force before the next control tick, from which a command
    /// for several of them goes on.
    pub fn stands(&mut self, standing: Standing) {
        self.standing = Some(standing);
    }

    /// Takes what is to be applied at `tick`; `now` is the age clock in seconds.
    pub fn take(&mut self, tick: u64, now: f64) -> Taken {
        let commands = if self.listening.lock_step {
            self.answers.remove(&tick).into_iter().collect()
        } else {
            std::mem::take(&mut self.pending)
        };
        self.next_tick = tick + 1;
        let mut taken = self.stopped();
        // In lock-step time waits, so nothing is late.
        let even = !self.listening.lock_step && !self.listening.replay;
        for command in &commands {
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
        taken.commands = commands;
        self.apply_age(&mut taken, now);
        taken
    }

    /// What stops the groups that are to be stopped, once.
    fn stopped(&mut self) -> Taken {
        let brake = std::mem::take(&mut self.brake);
        let mut taken = Taken {
            stale: brake.base || brake.arm,
            ..Taken::default()
        };
        taken.input.base = brake.base.then_some(REST);
        taken.input.arm = brake.arm.then_some(ArmIntent::Hold);
        taken
    }

    fn apply_age(&mut self, taken: &mut Taken, now: f64) {
        if let Some(base) = taken.input.base {
            let moves = base.linear != 0.0 || base.angular != 0.0;
            self.base.since = moves.then_some(now);
        }
        match taken.input.arm {
            Some(ArmIntent::Twist { .. }) => self.twist.since = Some(now),
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
            taken.stale = true;
        }
        if stale(&self.twist) {
            self.twist.since = None;
            taken.input.arm = Some(ArmIntent::Hold);
            taken.stale = true;
        }
    }
}

fn nobody(code: RefusalCode, reason: String) -> Refused {
    Refused {
        commander: String::new(),
        sequence: 0,
        code,
        reason,
    }
}

fn too_long(bytes: usize) -> Refused {
    let words = format!("command has {bytes} bytes, at most {MAX_BYTES} are taken");
    nobody(RefusalCode::TooLong, words)
}

#[cfg(test)]
mod tests;
