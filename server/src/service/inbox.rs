//! The gate: keeps the newest valid command per actuator group and lets
//! nothing else through. Everything refused is counted and gets its reason.
//!
//! Age is wall time in real-time pacing and simulation time otherwise; the
//! caller passes it in seconds, so that this file knows no clock.

use std::collections::BTreeMap;

use wheelarm_proto::{Message, TICKS_PER_CONTROL, check, v1};

use super::convert;
use crate::robot::control::{ArmIntent, BaseIntent, ControlInput, GripperMap};

/// Age of the newest chair or twist command at which braking starts, s.
pub const STALE_SECS: f64 = 0.25;

/// How many commanders are remembered; the least recently seen is forgotten.
const MAX_COMMANDERS: usize = 64;

/// How far ahead of the simulation a lock-step commander may answer, control ticks.
const MAX_AHEAD: u64 = 8;

/// Largest command message, bytes.
const MAX_BYTES: usize = 64 * 1024;

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
    /// What is wrong and what would be right.
    pub reason: String,
}

/// Whom the gate listens to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Listening {
    /// Running episode; 0 between episodes.
    pub episode: u64,
    /// Lock-step: the one commander that is waited for.
    pub commander: Option<String>,
    /// Commands are a replay: no age rule.
    pub replay: bool,
}

#[derive(Debug)]
struct Commander {
    run_id: String,
    last_sequence: u64,
    seen: u64,
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
    commanders: BTreeMap<String, Commander>,
    seen: u64,
    pending: Vec<v1::Command>,
    /// Lock-step: commands by the tick they answer.
    answers: BTreeMap<u64, v1::Command>,
    next_tick: u64,
    base: Active,
    twist: Active,
    refused: u64,
    phase: (i32, String),
}

impl Inbox {
    /// A gate for a robot with this gripper.
    #[must_use]
    pub fn new(gripper: GripperMap) -> Self {
        Self {
            gripper,
            listening: Listening::default(),
            commanders: BTreeMap::new(),
            seen: 0,
            pending: Vec::new(),
            answers: BTreeMap::new(),
            next_tick: 0,
            base: Active::default(),
            twist: Active::default(),
            refused: 0,
            phase: (0, String::new()),
        }
    }

    /// Starts listening anew: pending commands are dropped.
    pub fn listen(&mut self, listening: Listening, next_tick: u64) {
        self.listening = listening;
        self.pending.clear();
        self.answers.clear();
        self.next_tick = next_tick;
        self.base = Active::default();
        self.twist = Active::default();
        self.phase = (0, String::new());
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

    /// Takes a message from the network.
    ///
    /// # Errors
    /// [`Refused`] with the reason; the state is as if it had never come.
    pub fn accept(&mut self, bytes: &[u8]) -> Result<(), Refused> {
        let result = self.try_accept(bytes);
        if result.is_err() {
            self.refused += 1;
        }
        result
    }

    fn try_accept(&mut self, bytes: &[u8]) -> Result<(), Refused> {
        let nobody = |reason| Refused {
            commander: String::new(),
            sequence: 0,
            reason,
        };
        if bytes.len() > MAX_BYTES {
            return Err(nobody(format!(
                "command has {} bytes, at most {MAX_BYTES} are taken",
                bytes.len()
            )));
        }
        let command = v1::Command::decode(bytes)
            .map_err(|e| nobody(format!("not a wheelarm.v1.Command: {e}")))?;
        let header = command.header.clone().unwrap_or_default();
        let refuse = |reason| Refused {
            commander: command.commander.chars().take(64).collect(),
            sequence: header.sequence,
            reason,
        };
        wheelarm_proto::keys::check_name(&command.commander).map_err(|_| {
            refuse("commander must be 1 to 64 letters, digits, `-` or `_`".to_owned())
        })?;
        check::command(&command).map_err(|e| refuse(e.to_string()))?;
        if header.episode != self.listening.episode {
            return Err(refuse(format!(
                "command is for episode {}, running is {} (0 is none)",
                header.episode, self.listening.episode
            )));
        }
        if let Some(expected) = &self.listening.commander {
            if command.commander != *expected {
                return Err(refuse(format!("this episode is commanded by {expected:?}")));
            }
            let tick = command.answers_tick;
            if tick < self.next_tick {
                return Err(refuse(format!(
                    "command answers tick {tick}, the simulation is at {}",
                    self.next_tick
                )));
            }
            let ahead = (tick - self.next_tick) / TICKS_PER_CONTROL;
            if self.answers.contains_key(&tick) {
                return Err(refuse(format!("tick {tick} has been answered already")));
            }
            if ahead >= MAX_AHEAD {
                return Err(refuse(format!("more than {MAX_AHEAD} commands ahead")));
            }
        }
        self.check_sequence(&command.commander, &header)
            .map_err(refuse)?;
        if self.listening.commander.is_some() {
            self.answers.insert(command.answers_tick, command);
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

    fn check_sequence(&mut self, name: &str, header: &v1::Header) -> Result<(), String> {
        self.seen += 1;
        let seen = self.seen;
        if let Some(known) = self.commanders.get_mut(name) {
            if known.run_id == header.run_id && header.sequence <= known.last_sequence {
                return Err(format!(
                    "sequence number {} is not newer than {} (old, repeated or reordered)",
                    header.sequence, known.last_sequence
                ));
            }
            known.run_id.clone_from(&header.run_id);
            known.last_sequence = header.sequence;
            known.seen = seen;
            return Ok(());
        }
        if self.commanders.len() >= MAX_COMMANDERS {
            let oldest = self.commanders.iter().min_by_key(|(_, c)| c.seen);
            if let Some(name) = oldest.map(|(name, _)| name.clone()) {
                self.commanders.remove(&name);
            }
        }
        self.commanders.insert(
            name.to_owned(),
            Commander {
                run_id: header.run_id.clone(),
                last_sequence: header.sequence,
                seen,
            },
        );
        Ok(())
    }

    /// Whether the lock-step commander has answered `tick`.
    #[must_use]
    pub fn answered(&self, tick: u64) -> bool {
        self.listening.commander.is_none() || self.answers.contains_key(&tick)
    }

    /// Takes what is to be applied at `tick`; `now` is the age clock in seconds.
    pub fn take(&mut self, tick: u64, now: f64) -> Taken {
        let commands = if self.listening.commander.is_some() {
            self.answers.remove(&tick).into_iter().collect()
        } else {
            std::mem::take(&mut self.pending)
        };
        self.next_tick = tick + 1;
        let mut taken = Taken::default();
        for command in &commands {
            if command.phase != 0 {
                let name = command.phase_name.chars().take(64).collect();
                self.phase = (command.phase, name);
            }
            // Checked when it came in, so that nothing can be missing here.
            let Ok(input) = convert::control_input(command, &self.gripper) else {
                continue;
            };
            taken.input.arm = input.arm.or(taken.input.arm);
            taken.input.base = input.base.or(taken.input.base);
            taken.input.gripper = input.gripper.or(taken.input.gripper);
        }
        taken.commands = commands;
        self.apply_age(&mut taken, now);
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
            taken.input.base = Some(BaseIntent {
                linear: 0.0,
                angular: 0.0,
            });
            taken.stale = true;
        }
        if stale(&self.twist) {
            self.twist.since = None;
            taken.input.arm = Some(ArmIntent::Hold);
            taken.stale = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(sequence: u64, linear: f64) -> v1::Command {
        v1::Command {
            header: Some(v1::Header {
                sequence,
                run_id: "r".into(),
                ..Default::default()
            }),
            commander: "me".into(),
            base: Some(v1::BaseCommand {
                linear,
                angular: 0.0,
            }),
            ..Default::default()
        }
    }

    fn inbox() -> Inbox {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = crate::robot::RobotModel::load(&assets, "wheelarm").expect("the robot");
        Inbox::new(GripperMap::new(&model))
    }

    fn accept(inbox: &mut Inbox, command: &v1::Command) -> Result<(), Refused> {
        inbox.accept(&command.encode_to_vec())
    }

    #[test]
    fn a_chair_command_brakes_when_it_is_a_quarter_of_a_second_old() {
        let mut inbox = inbox();
        accept(&mut inbox, &drive(1, 0.4)).unwrap();
        assert_eq!(inbox.take(0, 0.0).input.base.unwrap().linear, 0.4);
        assert!(inbox.take(4, 0.24).input.base.is_none());
        let stale = inbox.take(8, 0.25);
        assert!(stale.stale && stale.input.base.unwrap().linear == 0.0);
        assert!(!inbox.take(12, 0.5).stale, "braked twice");
    }

    #[test]
    fn old_repeated_and_foreign_commands_are_refused_with_a_reason() {
        let mut inbox = inbox();
        accept(&mut inbox, &drive(5, 0.1)).unwrap();
        for (command, word) in [
            (drive(5, 0.2), "sequence"),
            (drive(4, 0.2), "sequence"),
            (
                v1::Command {
                    commander: "a/b".into(),
                    ..drive(6, 0.2)
                },
                "commander",
            ),
            (drive(6, f64::NAN), "finite"),
            (drive(6, 1e9), "expected"),
        ] {
            let refused = accept(&mut inbox, &command).unwrap_err();
            assert!(refused.reason.contains(word), "{}", refused.reason);
        }
        assert!(inbox.accept(&[0xff; 7]).is_err());
        assert!(inbox.accept(&vec![0; MAX_BYTES + 1]).is_err());
        assert_eq!(inbox.refused(), 7);
        assert_eq!(inbox.take(0, 0.0).input.base.unwrap().linear, 0.1);
    }

    #[test]
    fn lock_step_waits_for_the_answer_to_its_own_tick() {
        let mut inbox = inbox();
        let listening = Listening {
            commander: Some("me".into()),
            ..Default::default()
        };
        inbox.listen(listening, 100);
        assert!(!inbox.answered(100));
        let early = v1::Command {
            answers_tick: 96,
            ..drive(1, 0.1)
        };
        assert!(
            accept(&mut inbox, &early)
                .unwrap_err()
                .reason
                .contains("tick")
        );
        let other = v1::Command {
            commander: "other".into(),
            answers_tick: 100,
            ..drive(1, 0.1)
        };
        assert!(accept(&mut inbox, &other).is_err());
        accept(
            &mut inbox,
            &v1::Command {
                answers_tick: 100,
                ..drive(2, 0.1)
            },
        )
        .unwrap();
        assert!(inbox.answered(100));
        assert_eq!(inbox.take(100, 0.0).commands.len(), 1);
        assert!(!inbox.answered(104));
    }

    #[test]
    fn a_restarted_commander_may_count_from_zero_again() {
        let mut inbox = inbox();
        accept(&mut inbox, &drive(1000, 0.1)).unwrap();
        let mut again = drive(0, 0.2);
        again.header.as_mut().unwrap().run_id = "new".into();
        accept(&mut inbox, &again).unwrap();
    }

    #[test]
    fn a_flood_costs_no_memory_and_the_newest_counts() {
        let mut inbox = inbox();
        for i in 1..10_000 {
            accept(&mut inbox, &drive(i, (i % 7) as f64 * 0.01)).unwrap();
        }
        assert!(inbox.pending.len() <= 256);
        let newest = (9_999 % 7) as f64 * 0.01;
        assert_eq!(inbox.take(0, 0.0).input.base.unwrap().linear, newest);
    }
}
