//! Checks of the command gate: which commands are accepted, and why others are rejected.

use wheelarm_proto::limits::MAX_COMMAND_AGE_TICKS;
use wheelarm_proto::schema::OtherVersion;
use wheelarm_proto::v1::RefusalCode;
use wheelarm_proto::{Message, PHYSICS_HZ, TICKS_PER_CONTROL, check, seal, v1};

use super::{Accepted, CommandGate, RATE};
use crate::service::convert;

/// Most control ticks that a lock-step commander may be ahead of the simulation.
const MAX_AHEAD: u64 = 8;

/// Largest command message, bytes: several times the largest useful one.
pub const MAX_BYTES: usize = 4096;

/// Most commands queued for a control tick.
pub(super) const MAX_PENDING: usize = 256;

/// Largest jump of a sequence number. A number far ahead would block the holder, which
/// counts up by one.
const MAX_JUMP: u64 = 1_000_000;

/// Reason a command was rejected.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// Name of the commander; empty when it could not be read.
    pub commander: String,
    /// Sequence number of the command.
    pub sequence: u64,
    /// Machine-readable reason.
    pub code: RefusalCode,
    /// What is wrong and how to fix it.
    pub reason: String,
}

/// Machine-readable code and human-readable reason.
type Reason = (RefusalCode, String);

impl CommandGate {
    /// Rejects a message by its length, before it is copied or decoded.
    pub fn refuse_long(&mut self, bytes: usize) -> Refused {
        self.refused += 1;
        too_long(bytes)
    }

    /// Rejects a message of another contract version without decoding it.
    pub fn refuse_version(&mut self, from: &str, other: &OtherVersion) -> Refused {
        self.refused += 1;
        Refused {
            commander: from.chars().take(64).collect(),
            ..anonymous(RefusalCode::Version, other.to_string())
        }
    }

    /// Checks and queues a message that arrived at `now`, wall time in seconds, under the
    /// key of the commander `from`. The message must name the same commander.
    ///
    /// # Errors
    /// [`Refused`] with the reason; the state is unchanged.
    pub fn accept_from(&mut self, from: &str, bytes: &[u8], now: f64) -> Result<(), Refused> {
        self.count(|gate| gate.try_accept(Some(from), bytes, now))
    }

    /// As [`CommandGate::accept_from`], for the commander that the message names.
    ///
    /// # Errors
    /// As [`CommandGate::accept_from`].
    pub fn accept(&mut self, bytes: &[u8], now: f64) -> Result<(), Refused> {
        self.count(|gate| gate.try_accept(None, bytes, now))
    }

    fn count(
        &mut self,
        accept: impl FnOnce(&mut Self) -> Result<(), Refused>,
    ) -> Result<(), Refused> {
        let result = accept(self);
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
            anonymous(RefusalCode::Invalid, words)
        })?;
        let header = command.header.clone().unwrap_or_default();
        let refuse = |(code, reason): Reason| Refused {
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
                "the command names {:?} but arrived under the key of {:?}; send under \
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
            let words = format!("more than {} commands per second: send at most 60", RATE.0);
            return Err(refuse((RefusalCode::Rate, words)));
        }
        let input = check::command(&command)
            .and_then(|()| convert::control_input(&command, &self.gripper))
            .map_err(|e| refuse((RefusalCode::Invalid, e.to_string())))?;
        if header.episode != self.listening.episode {
            let words = format!(
                "command is for episode {}, running is {} (0 is none): set header.episode to that of \
                 the newest `clock`",
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
                    "command answers tick {tick}, which is not a control tick: set answers_tick to \
                     header.tick of the newest `clock`, a multiple of {TICKS_PER_CONTROL}"
                );
                return Err(refuse((RefusalCode::NoTick, words)));
            }
            if tick < self.next_tick {
                let words = format!(
                    "command answers tick {tick}, the simulation waits at {}: set answers_tick to \
                     header.tick of the newest `clock`",
                    self.next_tick.next_multiple_of(TICKS_PER_CONTROL)
                );
                return Err(refuse((RefusalCode::TooOld, words)));
            }
            let ahead = (tick - self.next_tick) / TICKS_PER_CONTROL;
            if self.answers.contains_key(&tick) {
                let words = format!(
                    "tick {tick} has been answered already: wait for the next `clock`, and answer it once"
                );
                return Err(refuse((RefusalCode::Answered, words)));
            }
            if ahead >= MAX_AHEAD {
                let words = format!(
                    "more than {MAX_AHEAD} commands ahead: wait for `clock` to come nearer"
                );
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
            let accepted = Accepted {
                arrived: now,
                command,
                input,
            };
            self.answers
                .insert(accepted.command.answers_tick(), accepted);
        } else {
            // Only the newest command of each group counts between two control ticks,
            // so the queue is bounded.
            if self.pending.len() >= MAX_PENDING {
                forget_one(&mut self.pending);
            }
            self.pending.push(Accepted {
                arrived: now,
                command,
                input,
            });
        }
        Ok(())
    }

    fn check_control(&self, name: &str, run_id: &str, bytes: &[u8]) -> Result<(), Reason> {
        let Some(holder) = self.lease.holder() else {
            return Err((
                RefusalCode::NoControl,
                "no commander holds control; request control first (query `lease`)".to_owned(),
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
                format!("control is held by another process with the name {name:?}"),
            ));
        }
        if holder.sealed && !seal::is_sealed(bytes, &holder.secret) {
            return Err((
                RefusalCode::Seal,
                format!(
                    "{name:?} seals its commands, and this one has no seal or a wrong one: another \
                 process sends in its name"
                ),
            ));
        }
        Ok(())
    }

    /// Rejects a command that answers a state older than [`MAX_COMMAND_AGE_TICKS`]. A command that only
    /// stops is accepted at any age; one that drives must name the state it answers.
    fn check_age(&self, command: &v1::Command) -> Result<(), Reason> {
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
        // The newest state that a commander can have received.
        let newest = self.next_tick.saturating_add(TICKS_PER_CONTROL);
        if tick > newest {
            return Err((
                RefusalCode::Ahead,
                format!(
                    "command answers tick {tick}, which the simulation has not reached (it is at {}): set \
                     answers_tick to header.tick of the newest `clock`",
                    self.next_tick
                ),
            ));
        }
        let age = self.next_tick.saturating_sub(tick);
        if age > MAX_COMMAND_AGE_TICKS {
            return Err((
                RefusalCode::TooOld,
                format!(
                    "command answers a state that is {:.2} s old, at most 1 s is accepted",
                    age as f64 / PHYSICS_HZ as f64
                ),
            ));
        }
        Ok(())
    }

    fn check_sequence(&mut self, sequence: u64) -> Result<(), Reason> {
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
                 requesting control again restarts the numbers"
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
}

/// Removes the oldest command that is not the newest of any group.
fn forget_one(pending: &mut Vec<Accepted>) {
    let groups = |c: &v1::Command| [c.arm.is_some(), c.base.is_some(), c.gripper.is_some()];
    let newest = |group: usize| pending.iter().rposition(|a| groups(&a.command)[group]);
    let kept = [0, 1, 2].map(newest);
    let at = (0..pending.len()).find(|at| !kept.contains(&Some(*at)));
    if let Some(at) = at {
        pending.remove(at);
    }
}

fn anonymous(code: RefusalCode, reason: String) -> Refused {
    Refused {
        commander: String::new(),
        sequence: 0,
        code,
        reason,
    }
}

fn too_long(bytes: usize) -> Refused {
    let words = format!("command has {bytes} bytes, at most {MAX_BYTES} are accepted");
    anonymous(RefusalCode::TooLong, words)
}
