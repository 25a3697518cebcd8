//! State and decisions of teleoperation. Input: keys, samples and time. Output:
//! commands and pending operations. Pure: no terminal, no network, no clock of
//! its own; times are seconds of the caller's clock.

mod commands;
mod control;
mod episode;

use wheelarm_proto::topic::Sample;
use wheelarm_proto::v1;
use wheelarm_proto::v1::RefusalCode;

use wheelarm_teleop_web::arm::{self, Arm};

use crate::drive::Drive;
use crate::form::{Answer, Form, Leaving};
use crate::keys::Key;
use wheelarm_teleop_web::watch::{Connection, Situation};

pub use control::Control;
pub use wheelarm_teleop_web::pending_operation::{Done, Operation, Start};

/// A second press within this time confirms, s.
const CONFIRM: f64 = 2.5;
/// A message stays this long in the message line, s.
const MESSAGE: f64 = 8.0;
/// Round trip of a person's control tick in lock-step, s.
const TICK: f64 = 1.0 / 60.0;

/// Actions for the event loop to execute.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Send a command that answers the tick of the header.
    Send(Box<v1::Header>, Box<v1::Command>),
    /// Start a pending operation.
    Operation(Operation),
    /// End the program.
    Quit,
}

/// Settings of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Name under which commands are sent.
    pub commander: String,
    /// Take control at the start from its current holder.
    pub take: bool,
    /// Label of the first episode; from task and seed when empty.
    pub label: String,
    /// Instruction of the first episode; the scenario's when empty.
    pub instruction: String,
    /// Recorders that must be ready; 0 is practice.
    pub recorders: u32,
    /// Keep to the reach shell of WheelArm-Sim.
    pub shell: bool,
    /// The chair stops this long after its last key, s.
    pub dead_man: Option<f64>,
    /// Show the position of the task's object.
    pub target_hint: bool,
}

/// A line for the person.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// When, s.
    pub at: f64,
    /// Whether it is a refusal or a problem.
    pub bad: bool,
    /// Text.
    pub text: String,
}

/// An action that needs a second press to confirm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Twice {
    Redo,
    Discard,
}

/// State of teleoperation.
#[derive(Debug)]
pub struct Model {
    /// Settings of this run.
    pub settings: Settings,
    /// The newest samples and status.
    pub situation: Situation,
    /// The chair's keys.
    pub drive: Drive,
    /// The arm's keys.
    pub arm: Arm,
    /// Holder of control.
    pub control: Control,
    /// Form that covers the controls.
    pub form: Option<Form>,
    /// Whether the help is shown.
    pub help: bool,
    /// Message for the person.
    pub message: Option<Message>,
    /// Word of the pending operation.
    pub busy: Option<&'static str>,
    /// Time from sending a command to its echo, s, and when the echo arrived, s.
    pub echo: Option<(f64, f64)>,
    /// Own commands that were rejected (count).
    pub refused: u64,
    /// Reason of the newest rejection, and its time, s.
    pub last_refusal: Option<(f64, String)>,
    /// Address of the preview page.
    pub page: String,
    /// Consecutive keys without a function (count).
    twice: Option<(Twice, f64)>,
    start: Start,
    leaving: bool,
    last_request: f64,
    /// When control was granted, s.
    leased_at: f64,
    arm_problem: String,
    /// Lock-step: command of the next answer.
    pending: v1::Command,
    /// Lock-step: tick to answer and when, s.
    answer_due: Option<(v1::Header, f64)>,
    answered: Option<u64>,
    answered_at: f64,
}

impl Model {
    /// The initial state.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Self {
            drive: Drive::new(settings.dead_man),
            arm: Arm::new(settings.shell),
            start: Start {
                label: settings.label.clone(),
                numbered: false,
                instruction: settings.instruction.clone(),
                recorders: settings.recorders,
            },
            settings,
            situation: Situation::default(),
            control: Control::None,
            form: None,
            help: false,
            message: None,
            busy: None,
            echo: None,
            refused: 0,
            last_refusal: None,
            page: String::new(),
            twice: None,
            leaving: false,
            last_request: f64::NEG_INFINITY,
            leased_at: f64::NEG_INFINITY,
            arm_problem: String::new(),
            pending: v1::Command::default(),
            answer_due: None,
            answered: None,
            answered_at: f64::NEG_INFINITY,
        }
    }

    fn say(&mut self, now: f64, text: impl Into<String>) {
        self.show_message(now, false, text.into());
    }

    fn warn(&mut self, now: f64, text: impl Into<String>) {
        self.show_message(now, true, text.into());
    }

    fn show_message(&mut self, at: f64, bad: bool, text: String) {
        self.message = Some(Message { at, bad, text });
    }

    /// Whether commands would be accepted; the reason if not.
    ///
    /// # Errors
    /// The reason, for the message line.
    pub fn can_command(&self, now: f64) -> Result<(), String> {
        match &self.situation.connection {
            Connection::Open => {}
            Connection::Opening => return Err("not connected yet: nothing is sent".to_owned()),
            Connection::Silent(since) => {
                return Err(format!(
                    "no answer for {:.1} s: nothing is sent",
                    now - since
                ));
            }
            Connection::Lost(..) => {
                return Err("the connection is lost: nothing is sent".to_owned());
            }
        }
        match &self.control {
            Control::Ours => Ok(()),
            Control::None | Control::Requested => Err("control is not ours yet".to_owned()),
            Control::Held(holder) => Err(format!("{holder} holds control; ! takes it over")),
        }
    }

    /// Handles a key. While a direction is latched, every key without a function stops the
    /// robot: a hurried press of the stop key may arrive as another character because of the
    /// keyboard layout or Caps Lock.
    pub fn key(&mut self, key: &Key, now: f64) -> Vec<Effect> {
        if self.form.is_some() {
            // Motion stops while the person types.
            let mut effects = self.stop_latched(now);
            if let Some(form) = &mut self.form {
                let answer = form.key(key);
                effects.extend(self.answer(answer, now));
            }
            return effects;
        }
        if self.help {
            self.help = false;
            if !matches!(key, Key::Char('k') | Key::Escape | Key::Ctrl('c')) {
                return self.stop_latched(now);
            }
        }
        match key {
            Key::Char('?') => self.help = true,
            Key::Char(' ') => {
                self.arm.turning = !self.arm.turning;
                let mode = if self.arm.turning { "turn" } else { "move" };
                self.say(now, format!("arm keys {mode} the hand"));
            }
            Key::Char(character) => {
                return match self.character(*character, now) {
                    Some(effects) => effects,
                    None if character.is_uppercase() => {
                        let small = character.to_lowercase();
                        let words = format!(
                            "{character} is not a key; is Caps Lock on? The key is {small}"
                        );
                        self.unknown(&words, now)
                    }
                    None => {
                        self.unknown(&format!("{character} is not a key; ? shows the keys"), now)
                    }
                };
            }
            Key::Escape => return self.stop_everything(now),
            Key::Ctrl('c') => return self.leave(now),
            Key::Right => return self.finish(now),
            Key::Left => return self.redo(now),
            Key::Ctrl('l') => {}
            Key::Paste(_) => {
                return self.unknown("pasted text is not driven; s opens the text fields", now);
            }
            Key::Enter => {
                // The key acknowledges the alarm.
                self.situation.alarm = None;
                return self.stop_latched(now);
            }
            Key::Tab | Key::BackTab | Key::Up | Key::Down => return self.stop_latched(now),
            _ => return self.unknown("unknown key; ? shows the keys", now),
        }
        Vec::new()
    }

    /// Stops the robot if a direction is latched.
    fn stop_latched(&mut self, now: f64) -> Vec<Effect> {
        match self.drive.direction {
            Some(_) => self.stop_everything(now),
            None => Vec::new(),
        }
    }

    /// A key without a function.
    fn unknown(&mut self, words: &str, now: f64) -> Vec<Effect> {
        let stopped = match self.drive.direction {
            Some(_) => "everything stops: ",
            None => "",
        };
        let effects = self.stop_latched(now);
        self.warn(now, format!("{stopped}{words}"));
        effects
    }

    /// Handles a character key.
    fn character(&mut self, key: char, now: f64) -> Option<Vec<Effect>> {
        let effects = match key {
            's' => self.open_start(now),
            'd' => self.discard(now),
            't' => self.open_reset(now),
            'p' => self.pause(now),
            '!' => self.open_take(now),
            'a' => {
                self.arm.shell = !self.arm.shell;
                let state = if self.arm.shell { "on" } else { "off" };
                self.say(now, format!("reach shell {state}"));
                Vec::new()
            }
            '-' | '=' | '+' => {
                self.resize(key != '-', now);
                Vec::new()
            }
            'r' | 'y' => self.gripper(key == 'r', now),
            _ => match arm::KEYS.iter().find(|(k, ..)| *k == key) {
                Some((_, axis, sign)) => self.arm(*axis, *sign, now),
                None => return self.chair(key, now),
            },
        };
        Some(effects)
    }

    /// Brakes the chair and holds the arm.
    pub fn stop_everything(&mut self, now: f64) -> Vec<Effect> {
        self.drive.stop(now);
        self.arm.forget();
        self.say(now, "everything stops");
        if self.can_command(now).is_err() {
            self.drive.forget();
            return Vec::new();
        }
        let base = self.drive.due(now);
        let arm = Some(v1::ArmCommand {
            target: Some(v1::arm_command::Target::Hold(true)),
        });
        let command = v1::Command {
            arm,
            base,
            ..v1::Command::default()
        };
        self.command(command, None)
    }

    fn answer(&mut self, answer: Answer, now: f64) -> Vec<Effect> {
        if answer != Answer::Stay {
            self.form = None;
        }
        match answer {
            Answer::Stay | Answer::Close => Vec::new(),
            Answer::Start {
                label,
                instruction,
                recorders,
            } => {
                self.start = Start {
                    numbered: self.start.numbered && self.start.label == label,
                    label,
                    instruction,
                    recorders,
                };
                self.start_operation("starting", Operation::Start(self.start.clone()), now)
            }
            Answer::Reset { task, seed } => {
                self.start_operation("setting up", Operation::Reset { task, seed }, now)
            }
            Answer::Take => {
                self.control = Control::Requested;
                vec![Effect::Operation(Operation::Lease { take: true })]
            }
            Answer::Leave(leaving) => self.leave_so(leaving, now),
        }
    }

    fn start_operation(
        &mut self,
        word: &'static str,
        operation: Operation,
        now: f64,
    ) -> Vec<Effect> {
        if let Some(busy) = self.busy {
            self.warn(now, format!("wait: {busy}"));
            return Vec::new();
        }
        if !matches!(self.situation.connection, Connection::Open) {
            self.warn(now, "no connection: nothing is sent");
            return Vec::new();
        }
        self.busy = Some(word);
        if matches!(
            operation,
            Operation::Start(_) | Operation::Stop { .. } | Operation::Redo(_)
        ) {
            // The number of the episode changes: a repeated stop would
            // carry the wrong one.
            self.drive.forget();
        }
        vec![Effect::Operation(operation)]
    }

    fn leave(&mut self, now: f64) -> Vec<Effect> {
        let mut effects = self.stop_everything(now);
        let connected = matches!(self.situation.connection, Connection::Open);
        let ours = self.control == Control::Ours;
        if connected && ours && self.situation.episode().is_some() {
            self.form = Some(Form::Leave);
        } else {
            effects.push(Effect::Quit);
        }
        effects
    }

    fn leave_so(&mut self, leaving: Leaving, now: f64) -> Vec<Effect> {
        if leaving == Leaving::Run {
            return vec![Effect::Quit];
        }
        let discard = leaving == Leaving::Discard;
        let effects = self.start_operation("ending", Operation::Stop { discard }, now);
        self.leaving = !effects.is_empty();
        effects
    }

    /// Advances the clock to `now` and sends what is due.
    pub fn tick(&mut self, now: f64) -> Vec<Effect> {
        if self.message.as_ref().is_some_and(|m| now - m.at > MESSAGE) {
            self.message = None;
        }
        if self.can_command(now).is_err() {
            self.drive.forget();
            return Vec::new();
        }
        let driving = self.drive.direction.is_some();
        let mut effects = match self.drive.due(now) {
            Some(base) => {
                let base = Some(base);
                let command = v1::Command {
                    base,
                    ..v1::Command::default()
                };
                self.command(command, None)
            }
            None => Vec::new(),
        };
        if driving && self.drive.direction.is_none() {
            self.warn(now, "the chair stopped: no key for too long");
        }
        if let Some((header, due)) = self.answer_due.take() {
            if now >= due {
                self.answered = Some(header.tick);
                // A late answer is not followed by a burst of quick ones.
                self.answered_at = due.max(now - TICK);
                let command = std::mem::take(&mut self.pending);
                effects.push(Effect::Send(Box::new(header), Box::new(command)));
            } else {
                self.answer_due = Some((header, due));
            }
        }
        effects
    }

    /// Latest time for the next [`Model::tick`], s.
    #[must_use]
    pub fn next_tick(&self, now: f64) -> f64 {
        let idle = now + 0.05;
        let drive = if self.drive.direction.is_some() {
            now + 0.02
        } else {
            idle
        };
        self.answer_due
            .as_ref()
            .map_or(drive, |(_, due)| due.min(drive))
    }

    /// Stores the description of the simulated robot.
    pub fn robot(&mut self, robot: &v1::RobotDescription) -> Vec<Effect> {
        self.situation.take_robot(robot);
        self.arm.fit(robot);
        Vec::new()
    }

    /// Handles a sample of a stream.
    pub fn sample(&mut self, sample: Sample, now: f64) -> Vec<Effect> {
        match &sample {
            Sample::Refusal(refusal) => return self.refusal(refusal, now),
            Sample::Applied(applied) if applied.arm_problem != self.arm_problem => {
                self.arm_problem.clone_from(&applied.arm_problem);
                if !self.arm_problem.is_empty() {
                    // The next step starts from the measured pose of the arm.
                    self.arm.forget();
                    self.warn(now, format!("arm: {}", applied.arm_problem));
                }
            }
            Sample::Clock(clock) => {
                let header = clock.header.clone().unwrap_or_default();
                let is_new = self.answered.is_none_or(|tick| header.tick > tick);
                if self.lock_step() && is_new && header.episode != 0 {
                    let due = (self.answered_at + TICK).clamp(now, now + TICK);
                    self.answer_due = Some((header, due));
                }
            }
            _ => {}
        }
        self.situation.take(sample, now);
        Vec::new()
    }

    fn refusal(&mut self, refusal: &v1::Refusal, now: f64) -> Vec<Effect> {
        if refusal.commander != self.settings.commander {
            return Vec::new();
        }
        self.refused += refusal.count.max(1);
        self.last_refusal = Some((now, refusal.reason.clone()));
        self.warn(now, format!("refused: {}", refusal.reason));
        self.situation
            .note(now, true, format!("refused: {}", refusal.reason));
        if lost_control(refusal.code()) && now - self.last_request > 1.0 {
            self.last_request = now;
            self.drive.forget();
            self.control = Control::Requested;
            return vec![Effect::Operation(Operation::Lease { take: false })];
        }
        Vec::new()
    }

    /// The echo of a command arrived `delay` seconds after it was sent.
    pub fn echo(&mut self, delay: f64, now: f64) {
        // Smoothed, so that it can be read.
        let smooth = self
            .echo
            .map_or(delay, |(old, _)| old + 0.2 * (delay - old));
        self.echo = Some((smooth, now));
    }
}

/// Whether requesting control again may resolve a refusal.
fn lost_control(code: RefusalCode) -> bool {
    matches!(
        code,
        RefusalCode::NoControl | RefusalCode::ControlHeld | RefusalCode::Sequence
    )
}

#[cfg(test)]
mod tests;
