//! State and decisions of the gateway. Input: pages, their intents, samples and time.
//! Output: commands, pending operations and answers. Pure: no socket, no network, no
//! clock of its own; times are seconds of the caller's clock.
//!
//! At most one page is in control. Its intents become commands by [`crate::motion`];
//! an intent of any other page is accepted only when it is a stop.

mod control;
mod goals;
mod requests;

use std::collections::{BTreeMap, VecDeque};

use serde_json::{Value, json};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::v1;
use wheelarm_proto::v1::RefusalCode;

use crate::motion::{Motion, Now, Out};
use crate::pending_operation::Operation;
use crate::protocol::{Action, Intent};
use crate::visitor::Visitor;
use crate::watch::{Connection, Situation};

pub use self::control::Control;
pub use self::goals::{Candidate, Goal, GoalRequest, PendingPick};
pub use self::requests::Answered;

/// A page without sockets is removed after this long, s; until then it keeps
/// control, which moves nothing.
const FORGOTTEN: f64 = 10.0;
/// Commands whose intent number is stored.
const SENT: usize = 256;

/// Actions for the hub to execute.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Send a command that answers the state of the header.
    Send(Box<v1::Header>, Box<v1::Command>),
    /// Send a message to a page at once.
    Say(String, Value),
    /// Start a pending operation under this name.
    Operation(Operation, String),
    /// Release control.
    Release,
    /// Request the object at a pixel.
    Pick(PendingPick),
    /// Start a skill.
    Goal(GoalRequest),
    /// End the skill of this number.
    EndGoal(u64),
    /// Write a line of the audit.
    Audit(Value),
}

/// A socket of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Socket {
    /// State and questions.
    State,
    /// Images.
    Video,
    /// Commands, one of two.
    Control(u8),
}

/// A page that is open, or was until recently.
#[derive(Debug)]
pub(crate) struct Page {
    pub(crate) visitor: Visitor,
    pub(crate) motion: Motion,
    sockets: Vec<Socket>,
    /// When its last socket closed, s.
    empty: f64,
}

impl Page {
    fn lanes(&self) -> usize {
        let lanes = self.sockets.iter();
        lanes
            .filter(|socket| matches!(socket, Socket::Control(_)))
            .count()
    }

    pub(crate) fn is_open(&self) -> bool {
        !self.sockets.is_empty()
    }
}

/// A command that results from an intent.
#[derive(Clone, Debug, PartialEq)]
struct Number {
    /// The command's own number.
    command: u64,
    /// The page, and its number.
    page: String,
    seq: u32,
    /// Whether it stops everything.
    stop: bool,
}

/// State of the gateway.
#[derive(Debug, Default)]
pub struct Model {
    /// The newest samples and status.
    pub situation: Situation,
    pub(crate) pages: BTreeMap<String, Page>,
    pub(crate) control: Control,
    /// Users that requested control, first come first.
    pub(crate) control_requests: Vec<String>,
    /// The pending operation, its word, and the page and number of the request.
    pub(crate) busy: Option<(&'static str, Option<(String, u64)>)>,
    pub(crate) goal: Option<Goal>,
    pub(crate) candidates: BTreeMap<String, Candidate>,
    /// Skills that were begun (count).
    goals: u64,
    picks: u64,
    /// Size of the running recording on this host, bytes, where it is known.
    pub(crate) recorded_bytes: Option<u64>,
    robot: Option<v1::RobotDescription>,
    /// Commands sent since control was granted (count).
    sent: u64,
    /// The page's numbers of the newest commands, by the commands' own.
    numbers: VecDeque<Number>,
    /// Own commands that were rejected (count).
    pub(crate) refused: u64,
    arm_problem: String,
}

impl Model {
    /// A user opened a socket of a page.
    pub fn joined(&mut self, page: &str, visitor: &Visitor, socket: Socket, now: f64) {
        let robot = self.robot.clone();
        let known = self.pages.entry(page.to_owned()).or_insert_with(|| {
            let mut motion = Motion::default();
            if let Some(robot) = &robot {
                motion.fit(robot);
            }
            Page {
                visitor: visitor.clone(),
                motion,
                sockets: Vec::new(),
                empty: now,
            }
        });
        // After a new login the former role no longer counts.
        known.visitor.clone_from(visitor);
        known.sockets.push(socket);
    }

    /// The session of a page ended: everything stops and control is released at
    /// server at once.
    pub fn signed_out(&mut self, page: &str, why: &str, now: f64) -> Vec<Effect> {
        let mut effects = self.end_goal_of(page, why, now);
        effects.extend(self.cut(page, why, now));
        effects.extend(self.take_back(page, why));
        effects
    }

    /// A socket of a page was closed.
    pub fn left(&mut self, page: &str, socket: Socket, now: f64) -> Vec<Effect> {
        let Some(known) = self.pages.get_mut(page) else {
            return Vec::new();
        };
        if let Some(at) = known.sockets.iter().position(|s| *s == socket) {
            known.sockets.remove(at);
        }
        if known.sockets.is_empty() {
            known.empty = now;
        }
        if matches!(socket, Socket::Control(_)) && known.lanes() == 0 {
            let mut effects = self.cut(page, "the page is gone: everything stops", now);
            effects.extend(self.end_goal_of(page, "the page is gone", now));
            return effects;
        }
        Vec::new()
    }

    /// Whether a page is open, or was until recently.
    #[must_use]
    pub fn knows(&self, page: &str) -> bool {
        self.pages.contains_key(page)
    }

    /// Pages that have a socket (count).
    #[must_use]
    pub fn open_pages(&self) -> usize {
        self.pages.values().filter(|page| page.is_open()).count()
    }

    /// Names of the pages that have a socket.
    pub fn page_names(&self) -> impl Iterator<Item = &String> {
        let open = self.pages.iter().filter(|(_, page)| page.is_open());
        open.map(|(name, _)| name)
    }

    fn now<'a>(
        situation: &'a Situation,
        control: &Control,
        goal: bool,
        page: &str,
        time: f64,
    ) -> Now<'a> {
        Now {
            time,
            situation,
            in_control: control.page() == Some(page),
            goal,
            lock_step: false,
        }
    }

    /// Handles an intent of a page.
    pub fn intent(&mut self, page: &str, intent: &Intent, time: f64) -> Vec<Effect> {
        let (goal, lock_step) = (self.goal.is_some(), self.lock_step());
        let Some(known) = self.pages.get_mut(page) else {
            return Vec::new();
        };
        if !known.visitor.role.may_drive() {
            return Vec::new();
        }
        let now = Self::now(&self.situation, &self.control, goal, page, time);
        let now = Now {
            in_control: now.in_control && self.situation.connection == Connection::Open,
            lock_step,
            ..now
        };
        let out = known.motion.take(intent, now);
        let stops = intent.action == Action::Stop && !out.is_empty();
        let mut effects = self.carry_out(page, out, time);
        if stops {
            effects.extend(self.stopped_by(page, time));
            effects.extend(self.stop_program(page));
        }
        effects
    }

    /// A user stopped everything: the page in control gets a note.
    fn stopped_by(&mut self, page: &str, time: f64) -> Vec<Effect> {
        let holder = self.control.page().filter(|holder| *holder != page);
        let Some(holder) = holder.map(str::to_owned) else {
            return Vec::new();
        };
        let name = self.pages.get(page).map(|p| p.visitor.name.clone());
        let words = format!("{} stopped everything", name.unwrap_or_default());
        self.cut(&holder, &words, time)
    }

    /// Ends the motion of a page.
    pub(crate) fn cut(&mut self, page: &str, why: &str, time: f64) -> Vec<Effect> {
        let goal = self.goal.is_some();
        let Some(known) = self.pages.get_mut(page) else {
            return Vec::new();
        };
        let now = Self::now(&self.situation, &self.control, goal, page, time);
        let out = known.motion.cut(why, now);
        self.carry_out(page, out, time)
    }

    /// Executes the outputs of a page's motion.
    fn carry_out(&mut self, page: &str, out: Vec<Out>, time: f64) -> Vec<Effect> {
        let mut effects = Vec::new();
        let in_control = self.control.page() == Some(page);
        for one in out {
            match one {
                Out::Send {
                    command,
                    shown,
                    seq,
                } => {
                    let stops = wheelarm_proto::check::stops(&command);
                    // Every operator may stop; motion is accepted only from the holder of control.
                    let its_own = stops && self.control.is_ours();
                    if !(in_control || its_own) {
                        continue;
                    }
                    let mut header = self.situation.header.clone();
                    header.tick = shown.unwrap_or(header.tick);
                    let is_stop = stops && seq.is_some();
                    if let Some(seq) = seq {
                        self.number(page, seq, is_stop);
                    }
                    effects.push(self.send(header, *command));
                }
                Out::Refuse { seq, code, reason } => {
                    let message =
                        json!({"t": "refusal", "seq": seq, "code": code, "reason": reason});
                    effects.push(Effect::Say(page.to_owned(), message));
                    effects.push(self.audit(page, "refused", &reason));
                }
                Out::Note(text) => effects.push(note(page, true, &text)),
                Out::EndGoal => effects.extend(self.end_goal("stopped", time)),
            }
        }
        effects
    }

    /// Records that the next command results from an intent.
    fn number(&mut self, page: &str, seq: u32, stop: bool) {
        if self.numbers.len() == SENT {
            self.numbers.pop_front();
        }
        self.numbers.push_back(Number {
            command: self.sent,
            page: page.to_owned(),
            seq,
            stop,
        });
    }

    fn send(&mut self, header: v1::Header, command: v1::Command) -> Effect {
        self.sent += 1;
        Effect::Send(Box::new(header), Box::new(command))
    }

    /// A command could not be queued because the connection stalls.
    pub fn not_sent(&mut self, time: f64) -> Vec<Effect> {
        self.sent = self.sent.saturating_sub(1);
        let sent = self.sent;
        self.numbers.retain(|number| number.command < sent);
        self.situation.fall_silent(time);
        self.halt("the connection to the simulation stalls", time)
    }

    /// No command can be sent: every motion is cleared.
    fn halt(&mut self, why: &str, time: f64) -> Vec<Effect> {
        let mut effects = self.end_goal(why, time);
        for (name, page) in &mut self.pages {
            if page.motion.is_moving() {
                effects.push(note(name, true, &format!("{why}: everything stops")));
            }
            page.motion.forget();
        }
        effects
    }

    /// Advances the clock to `time` and does what is due.
    pub fn tick(&mut self, time: f64) -> Vec<Effect> {
        let mut effects = Vec::new();
        let open = self.situation.connection == Connection::Open;
        let names: Vec<String> = self.pages.keys().cloned().collect();
        for name in names {
            let goal = self.goal.is_some();
            let Some(page) = self.pages.get_mut(&name) else {
                continue;
            };
            if open {
                let now = Self::now(&self.situation, &self.control, goal, &name, time);
                let out = page.motion.tick(now);
                effects.extend(self.carry_out(&name, out, time));
            }
        }
        effects.extend(self.watch_goal(time));
        effects.extend(self.forget_pages(time));
        self.candidates.retain(|_, one| time < one.until);
        effects
    }

    /// Whether motion is active, so that [`Model::tick`] must be called often.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        let moving = self.pages.values().any(|page| page.motion.is_moving());
        moving || self.goal.is_some()
    }

    fn forget_pages(&mut self, time: f64) -> Vec<Effect> {
        let gone = |page: &Page| !page.is_open() && time - page.empty > FORGOTTEN;
        let holder = self.control.page().map(str::to_owned);
        let gives = holder.is_some_and(|holder| self.pages.get(&holder).is_none_or(gone));
        let effects = match gives {
            true => self.give_up("the page that was in control is gone"),
            false => Vec::new(),
        };
        self.pages.retain(|_, page| !gone(page));
        effects
    }

    /// Stores the description of the simulated robot.
    pub fn robot(&mut self, robot: &v1::RobotDescription) {
        self.situation.take_robot(robot);
        for page in self.pages.values_mut() {
            page.motion.fit(robot);
        }
        self.robot = Some(robot.clone());
    }

    /// Handles a sample of a stream.
    pub fn sample(&mut self, sample: Sample, time: f64) -> Vec<Effect> {
        let mut effects = Vec::new();
        match &sample {
            Sample::Refusal(refusal) => effects = self.refusal(refusal, time),
            Sample::Command(log) => effects = self.taken(log),
            Sample::Event(event) => {
                let touched = [v1::EventKind::Collision, v1::EventKind::PersonContact];
                if touched.contains(&event.kind()) {
                    effects = self.contact(&event.text, time);
                }
            }
            Sample::Applied(applied) if applied.arm_problem != self.arm_problem => {
                self.arm_problem.clone_from(&applied.arm_problem);
                if !self.arm_problem.is_empty()
                    && let Some(holder) = self.control.page()
                {
                    effects.push(note(holder, true, &format!("arm: {}", applied.arm_problem)));
                }
            }
            Sample::EpisodeStop(_) => {
                effects = self.end_goal("the episode is over", time);
                if let Some(status) = &mut self.situation.status {
                    status.episode = None;
                }
            }
            _ => {}
        }
        self.situation.take(sample, time);
        effects
    }

    /// A contact ends any motion, so that a user cannot keep driving against a wall.
    fn contact(&mut self, words: &str, time: f64) -> Vec<Effect> {
        let Some(holder) = self.control.page().map(str::to_owned) else {
            return Vec::new();
        };
        let moving = self.pages.get(&holder);
        if !moving.is_some_and(|page| page.motion.is_moving()) {
            return Vec::new();
        }
        self.cut(&holder, &format!("contact: {words}"), time)
    }

    /// The server accepted a command: a stop is in force.
    fn taken(&mut self, log: &v1::CommandLog) -> Vec<Effect> {
        let command = log.command.clone().unwrap_or_default();
        if !self.control.is_named(&command.commander) {
            return Vec::new();
        }
        let sequence = command.header.map_or(0, |h| h.sequence);
        let mut effects = Vec::new();
        while let Some(first) = self.numbers.front() {
            if first.command > sequence {
                break;
            }
            if first.stop && first.command == sequence {
                let message = json!({"t": "stopped", "seq": first.seq});
                effects.push(Effect::Say(first.page.clone(), message));
            }
            self.numbers.pop_front();
        }
        effects
    }

    fn refusal(&mut self, refusal: &v1::Refusal, time: f64) -> Vec<Effect> {
        if !self.control.is_named(&refusal.commander) {
            return Vec::new();
        }
        // Another client sent it under this name: our commands are not affected.
        let foreign = [
            RefusalCode::Seal,
            RefusalCode::Foreign,
            RefusalCode::Version,
        ];
        if foreign.contains(&refusal.code()) {
            let page = self.control.page().unwrap_or_default();
            return vec![self.audit(page, "foreign", &refusal.reason)];
        }
        self.refused += refusal.count.max(1);
        let Some(holder) = self.control.page().map(str::to_owned) else {
            return Vec::new();
        };
        let mut numbers = self.numbers.iter();
        let number = numbers.find(|number| number.command == refusal.sequence);
        let seq = number.map_or(0, |number| number.seq);
        let mut effects = self.end_goal("a command was refused", time);
        effects.extend(self.cut(&holder, "a command was refused", time));
        let message = json!({
            "t": "refusal",
            "seq": seq,
            "code": code_name(refusal.code()),
            "reason": refusal.reason,
        });
        effects.push(Effect::Say(holder.clone(), message));
        effects.push(self.audit(&holder, "refused", &refusal.reason));
        let lost = [
            RefusalCode::NoControl,
            RefusalCode::ControlHeld,
            RefusalCode::Sequence,
        ];
        if lost.contains(&refusal.code()) {
            effects.extend(self.ask_again(&holder, time));
        }
        effects
    }

    /// Directions in which the page in control moves the hand now.
    pub(crate) fn hand_directions(&self) -> Vec<&'static str> {
        let page = self.control.page().and_then(|page| self.pages.get(page));
        page.map_or_else(Vec::new, |page| page.motion.hand_directions())
    }

    /// Whether a body of a contact is part of the robot.
    pub(crate) fn is_robot(&self, body: &str) -> bool {
        let joints = self.robot.as_ref().map_or(&[][..], |robot| &robot.joints);
        let mut links = joints.iter();
        links.any(|joint| joint.child_link == body || joint.parent_link == body)
    }

    /// Whether a body of a contact is the chair without its arm.
    pub(crate) fn is_chair(&self, body: &str) -> bool {
        let joints = self.robot.as_ref().map_or(&[][..], |robot| &robot.joints);
        let mut link = body;
        // Up to the root; bodies that move with the arm hang on one of its joints.
        for _ in 0..=joints.len() {
            let Some(joint) = joints.iter().find(|joint| joint.child_link == link) else {
                return self.is_robot(body);
            };
            if matches!(joint.role(), v1::JointRole::Arm | v1::JointRole::Knuckle) {
                return false;
            }
            link = &joint.parent_link;
        }
        false
    }

    /// Widest opening of the fingers, m.
    pub(crate) fn stroke(&self) -> Option<f64> {
        Some(self.robot.as_ref()?.gripper.as_ref()?.stroke)
    }

    fn audit(&self, page: &str, what: &str, text: &str) -> Effect {
        let name = self.pages.get(page).map(|p| p.visitor.name.clone());
        Effect::Audit(json!({
            "what": what,
            "who": name.unwrap_or_default(),
            "tick": self.situation.header.tick,
            "episode": self.situation.header.episode,
            "text": text,
        }))
    }
}

fn code_name(code: RefusalCode) -> &'static str {
    code.as_str_name()
        .strip_prefix("REFUSAL_CODE_")
        .unwrap_or("UNSPECIFIED")
}

/// A note for a page.
pub(crate) fn note(page: &str, bad: bool, text: &str) -> Effect {
    Effect::Say(
        page.to_owned(),
        json!({"t": "note", "bad": bad, "text": text}),
    )
}

#[cfg(test)]
mod tests;
