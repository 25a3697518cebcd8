//! The connection and the control lease.

use wheelarm_proto::v1;

use super::{Effect, Form, Model, Operation};
use wheelarm_teleop_web::watch::Connection;

/// A status may be older than the lease for this long after control was granted, s.
const FRESH: f64 = 2.0;

/// The holder of control.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Control {
    /// Control was not requested.
    None,
    /// The request is pending.
    Requested,
    /// This program.
    Ours,
    /// Another client, by name.
    Held(String),
}

impl Model {
    /// The connection is open.
    pub fn connected(&mut self, now: f64) -> Vec<Effect> {
        self.situation.connection = Connection::Open;
        self.situation.note(now, false, "connected".to_owned());
        self.control = Control::Requested;
        self.busy = None;
        self.arm.forget();
        self.drive.forget();
        self.answered = None;
        self.answer_due = None;
        let mut effects = vec![Effect::Operation(Operation::Lease {
            take: std::mem::take(&mut self.settings.take),
        })];
        if self.settings.target_hint {
            effects.push(Effect::Operation(Operation::Scene));
        }
        effects
    }

    /// The connection is lost; it reconnects by itself.
    pub fn lost(&mut self, reason: &str, now: f64) {
        self.situation.lose(now, reason);
        self.drive.forget();
        self.arm.forget();
        self.control = Control::None;
        self.busy = None;
        self.echo = None;
    }

    /// The server did not answer in time.
    pub fn silent(&mut self, now: f64) {
        // While the server works on an operation its silence is expected.
        if self.busy.is_none() {
            self.situation.fall_silent(now);
        }
    }

    /// The server's status, and the round trip it took, s.
    pub fn status(&mut self, status: v1::Status, round_trip: f64, now: f64) -> Vec<Effect> {
        let holder = status.holder.clone();
        for verdict in self.situation.take_status(status, round_trip, now) {
            self.show_message(now, verdict.bad, verdict.text);
        }
        match &self.control {
            // A status from before control was granted is outdated.
            Control::Ours if now - self.leased_at < FRESH => {}
            Control::Ours if holder != self.settings.commander => {
                self.drive.forget();
                if holder.is_empty() {
                    // The server started anew or gave the lease up.
                    self.control = Control::Requested;
                    return vec![Effect::Operation(Operation::Lease { take: false })];
                }
                self.warn(now, format!("{holder} took control; ! takes it back"));
                self.control = Control::Held(holder);
            }
            Control::Held(_) if holder.is_empty() => {
                self.say(now, "control is free: press ! to take it");
                self.control = Control::Requested;
                return vec![Effect::Operation(Operation::Lease { take: false })];
            }
            Control::Held(known) if *known != holder => self.control = Control::Held(holder),
            _ => {}
        }
        Vec::new()
    }

    /// Result of the control request.
    pub(super) fn leased(&mut self, result: Result<(), String>, now: f64) {
        match result {
            Ok(()) => {
                self.control = Control::Ours;
                self.leased_at = now;
                self.say(now, "control is yours; ? shows the keys");
            }
            Err(why) => {
                let holder = self.situation.status.as_ref().map(|s| s.holder.clone());
                let holder = holder.filter(|h| !h.is_empty());
                self.control = Control::Held(holder.unwrap_or_else(|| "another client".to_owned()));
                self.warn(now, why);
            }
        }
    }

    pub(super) fn open_take(&mut self, now: f64) -> Vec<Effect> {
        match &self.control {
            Control::Held(holder) => {
                self.form = Some(Form::Take {
                    holder: holder.clone(),
                });
            }
            Control::Ours => self.say(now, "control is yours"),
            Control::None | Control::Requested => self.warn(now, "not connected yet"),
        }
        Vec::new()
    }
}
