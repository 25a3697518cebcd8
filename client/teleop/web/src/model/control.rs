//! Control: held by one page, through one lease of the server.

use serde_json::json;
use wheelarm_proto::v1;

use super::requests::LISTING;
use super::{Effect, Model, note};
use crate::motion::rest;
use crate::pending_operation::Operation;
use crate::watch::{Connection, Verdict};

/// A status may be older than the lease for this long after control was granted, s.
const FRESH: f64 = 2.0;
/// Time between two attempts to regain lost control, s.
const AGAIN: f64 = 1.0;

/// Page name after the session of the requesting page ended; real pages never have an
/// empty name.
const SIGNED_OUT: &str = "";

/// The page in control.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Control {
    /// No page.
    #[default]
    None,
    /// Control was requested from the server for a page.
    Requested {
        /// The page.
        page: String,
        /// Name under which it will command.
        name: String,
        /// Number of the page's request, if it sent one.
        id: Option<u64>,
        /// Control is taken for a STOP: the robot rests as soon as the lease is ours.
        stops: bool,
    },
    /// A page.
    Ours {
        /// The page.
        page: String,
        /// Name under which it commands.
        name: String,
        /// When control was given, s.
        since: f64,
    },
}

impl Control {
    /// The page in control.
    #[must_use]
    pub fn page(&self) -> Option<&str> {
        match self {
            Self::Ours { page, .. } => Some(page),
            Self::None | Self::Requested { .. } => None,
        }
    }

    /// Whether this gateway commands.
    #[must_use]
    pub fn is_ours(&self) -> bool {
        matches!(self, Self::Ours { .. })
    }

    /// Whether this gateway commands under `name`.
    #[must_use]
    pub fn is_named(&self, name: &str) -> bool {
        matches!(self, Self::Ours { name: ours, .. } if ours == name)
    }
}

impl Model {
    /// The connection is open.
    pub fn connected(&mut self, time: f64) -> Vec<Effect> {
        self.situation.connection = Connection::Open;
        self.situation.note(time, false, "connected".to_owned());
        match self.control.page().map(str::to_owned) {
            Some(page) => self.ask_again(&page, time),
            None => Vec::new(),
        }
    }

    /// The connection is lost; it reconnects by itself.
    pub fn lost(&mut self, reason: &str, time: f64) -> Vec<Effect> {
        self.situation.lose(time, reason);
        let mut effects = self.halt("the connection to the simulation is lost", time);
        effects.extend(self.answer_operation(Err("the connection was lost".to_owned())));
        if let Control::Requested { page, id, .. } = self.control.clone() {
            self.control = Control::None;
            effects.extend(self.refuse_request(&page, id, "the connection was lost"));
        }
        effects
    }

    /// The server did not answer in time.
    pub fn silent(&mut self, time: f64) -> Vec<Effect> {
        // While the server works on an operation its silence is expected.
        if self.busy.as_ref().is_some_and(|(word, _)| *word != LISTING) {
            return Vec::new();
        }
        self.situation.fall_silent(time);
        self.halt("the simulation does not answer", time)
    }

    /// The server's status, and the round trip it took, s.
    pub fn status(&mut self, status: v1::Status, round_trip: f64, time: f64) -> Vec<Effect> {
        let holder = status.holder.clone();
        let verdicts = self.situation.take_status(status, round_trip, time);
        let mut effects = self.tell_verdicts(&verdicts);
        let Control::Ours { page, name, since } = &self.control else {
            return effects;
        };
        if time - since < FRESH || holder == *name {
            return effects;
        }
        let page = page.clone();
        if holder.is_empty() {
            effects.extend(self.ask_again(&page, time));
            return effects;
        }
        effects.extend(self.halt(&format!("{holder} took control"), time));
        effects.push(note(&page, true, &format!("{holder} took control")));
        effects.push(self.audit(&page, "lost", &holder));
        effects.push(Effect::Release);
        self.control = Control::None;
        effects
    }

    /// Notifies every page that may drive of the state of an episode's file.
    fn tell_verdicts(&self, verdicts: &[Verdict]) -> Vec<Effect> {
        let driving = self
            .pages
            .iter()
            .filter(|(_, page)| page.visitor.role.may_drive());
        driving
            .flat_map(|(name, _)| verdicts.iter().map(move |v| note(name, v.bad, &v.text)))
            .collect()
    }

    /// A page requests control, or takes it.
    pub(super) fn request_lease(
        &mut self,
        page: &str,
        id: u64,
        take: bool,
        time: f64,
    ) -> Vec<Effect> {
        let Some(requester) = self.pages.get(page).map(|p| p.visitor.clone()) else {
            return Vec::new();
        };
        if !requester.role.may_drive() {
            return self.refuse_request(page, Some(id), "a viewer cannot drive");
        }
        if self.situation.connection != Connection::Open {
            return self.refuse_request(
                page,
                Some(id),
                "no connection to the simulation: wait until it is back",
            );
        }
        match self.control.clone() {
            Control::Requested { .. } => self.refuse_request(
                page,
                Some(id),
                "another request for control is pending: ask again",
            ),
            Control::Ours { page: holder, .. } if holder == page => self.mine(page, Some(id)),
            // A reloaded page is another page of the same person.
            Control::Ours { page: holder, .. } if !take && self.is_open(&holder) => {
                let owner = self.pages.get(&holder).map(|p| p.visitor.name.clone());
                let owner = owner.unwrap_or_default();
                if !self.control_requests.contains(&requester.name) {
                    self.control_requests.push(requester.name.clone());
                }
                let mut effects = vec![
                    note(
                        &holder,
                        false,
                        &format!("{} asks for control", requester.name),
                    ),
                    self.audit(page, "requested", &owner),
                ];
                effects.extend(self.refuse_request(
                    page,
                    Some(id),
                    &format!("{owner} is in control and was notified of your request"),
                ));
                effects
            }
            Control::Ours {
                page: holder, name, ..
            } => {
                let words = format!("{} took control", requester.name);
                let mut effects = self.end_goal(&words, time);
                effects.extend(self.cut(&holder, &words, time));
                effects.push(note(&holder, true, &words));
                effects.push(self.audit(page, "took", &name));
                if name == requester.name {
                    self.control = Control::Ours {
                        page: page.to_owned(),
                        name,
                        since: time,
                    };
                    self.forget_motion(page);
                    effects.extend(self.mine(page, Some(id)));
                    return effects;
                }
                effects.extend(self.ask_server(page, &requester.name, Some(id), true));
                effects
            }
            Control::None => {
                let mut effects =
                    vec![self.audit(page, if take { "took" } else { "requested" }, "")];
                effects.extend(self.ask_server(page, &requester.name, Some(id), take));
                effects
            }
        }
    }

    fn is_open(&self, page: &str) -> bool {
        self.pages.get(page).is_some_and(|page| page.is_open())
    }

    /// STOP while a program commands the server without this gateway: control is taken
    /// from it, which ends its commands, and the robot rests.
    pub(super) fn stop_program(&mut self, page: &str) -> Vec<Effect> {
        let status = self.situation.status.as_ref();
        let holder = status.map_or_else(String::new, |status| status.holder.clone());
        let is_open = self.situation.connection == Connection::Open;
        let requester = self.pages.get(page).map(|p| p.visitor.name.clone());
        let Some(requester) = requester.filter(|_| is_open && !holder.is_empty()) else {
            return Vec::new();
        };
        if self.control != Control::None {
            return Vec::new();
        }
        let words = format!("STOP takes control from {holder}");
        let mut effects = vec![note(page, true, &words), self.audit(page, "took", &holder)];
        effects.extend(self.ask_server(page, &requester, None, true));
        if let Control::Requested { stops, .. } = &mut self.control {
            *stops = true;
        }
        effects
    }

    fn ask_server(&mut self, page: &str, name: &str, id: Option<u64>, take: bool) -> Vec<Effect> {
        self.control = Control::Requested {
            page: page.to_owned(),
            name: name.to_owned(),
            id,
            stops: false,
        };
        vec![Effect::Operation(
            Operation::Lease { take },
            name.to_owned(),
        )]
    }

    /// This page lost control without a takeover.
    pub(super) fn ask_again(&mut self, page: &str, time: f64) -> Vec<Effect> {
        let Control::Ours { name, since, .. } = &self.control else {
            return Vec::new();
        };
        if time - since < AGAIN {
            return Vec::new();
        }
        let name = name.clone();
        self.forget_motion(page);
        self.ask_server(page, &name, None, false)
    }

    /// A press from before control was granted moves nothing.
    fn forget_motion(&mut self, page: &str) {
        if let Some(page) = self.pages.get_mut(page) {
            page.motion.forget();
        }
    }

    /// Result of the lease request.
    pub(super) fn leased(&mut self, result: Result<(), String>, time: f64) -> Vec<Effect> {
        let Control::Requested {
            page,
            name,
            id,
            stops,
        } = std::mem::take(&mut self.control)
        else {
            return Vec::new();
        };
        match result {
            Ok(()) => {
                self.sent = 0;
                self.numbers.clear();
                self.control_requests.retain(|waiting| *waiting != name);
                self.control = Control::Ours {
                    page: page.clone(),
                    name,
                    since: time,
                };
                self.forget_motion(&page);
                let mut effects = vec![self.audit(&page, "control", "")];
                if stops {
                    let header = self.situation.header.clone();
                    effects.push(self.send(header, rest(true, true)));
                }
                effects.extend(self.mine(&page, id));
                if page == SIGNED_OUT {
                    effects.extend(self.give_up("the page signed out"));
                }
                effects
            }
            Err(why) => {
                let mut effects = vec![note(&page, true, &why)];
                effects.extend(self.refuse_request(&page, id, &why));
                effects
            }
        }
    }

    fn mine(&self, page: &str, id: Option<u64>) -> Vec<Effect> {
        let answer = id.map(|id| json!({"t": "answer", "id": id, "ok": true, "mine": true}));
        let say = answer.map(|answer| Effect::Say(page.to_owned(), answer));
        say.into_iter().collect()
    }

    fn refuse_request(&self, page: &str, id: Option<u64>, why: &str) -> Vec<Effect> {
        let answer = id.map(|id| json!({"t": "answer", "id": id, "ok": false, "error": why}));
        let say = answer.map(|answer| Effect::Say(page.to_owned(), answer));
        say.into_iter().collect()
    }

    /// The page in control gives it up, and offers it to another user.
    pub(super) fn give_lease(
        &mut self,
        page: &str,
        id: u64,
        to: Option<&str>,
        time: f64,
    ) -> Vec<Effect> {
        if self.control.page() != Some(page) {
            return self.refuse_request(page, Some(id), "this page is not in control");
        }
        let mut effects = self.end_goal("control was given back", time);
        effects.extend(self.cut(page, "control was given back", time));
        effects.push(self.audit(page, "gave", to.unwrap_or_default()));
        effects.extend(self.give_up("control was given back"));
        let offered = to
            .map(str::to_owned)
            .or_else(|| self.control_requests.first().cloned());
        if let Some(offered) = offered {
            self.control_requests.retain(|name| *name != offered);
            let pages = self.pages.iter();
            let theirs = pages.filter(|(_, p)| p.is_open() && p.visitor.name == offered);
            for (name, _) in theirs {
                effects.push(note(name, false, "control is offered to you: take it"));
            }
        }
        let answer = json!({"t": "answer", "id": id, "ok": true, "mine": false});
        effects.push(Effect::Say(page.to_owned(), answer));
        effects
    }

    /// Releases control of a page, also while the request for it is pending.
    pub(super) fn take_back(&mut self, page: &str, why: &str) -> Vec<Effect> {
        match &mut self.control {
            Control::Ours { page: holder, .. } if holder == page => self.give_up(why),
            Control::Requested {
                page: requester, ..
            } if requester == page => {
                SIGNED_OUT.clone_into(requester);
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    pub(super) fn give_up(&mut self, why: &str) -> Vec<Effect> {
        let Control::Ours { page, .. } = std::mem::take(&mut self.control) else {
            return Vec::new();
        };
        self.forget_motion(&page);
        vec![self.audit(&page, "released", why), Effect::Release]
    }

    /// The gateway shuts down: everything stops and control is released.
    pub fn farewell(&mut self, time: f64) -> Vec<Effect> {
        let mut effects = self.end_goal("the gateway ends", time);
        if let Some(page) = self.control.page().map(str::to_owned) {
            let command = v1::Command {
                base: Some(v1::BaseCommand::default()),
                arm: Some(v1::ArmCommand {
                    target: Some(v1::arm_command::Target::Hold(true)),
                }),
                ..v1::Command::default()
            };
            effects.push(self.send(self.situation.header.clone(), command));
            self.forget_motion(&page);
        }
        effects
    }
}
