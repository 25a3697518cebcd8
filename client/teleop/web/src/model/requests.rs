//! Requests of pages on the state socket: control, tasks, scenarios, episodes, time.

use serde_json::{Value, json};
use wheelarm_proto::label;

use super::{Control, Effect, Model};
use crate::pending_operation::{Done, Operation, Start};
use crate::protocol::{Request, RequestKind};
use crate::watch::Connection;

/// Name of the operation during which silence of the server is expected.
pub(super) const LISTING: &str = "listing the tasks";

/// Result of a request: further fields of the answer, or the error text.
pub type Answered = Result<Value, String>;

impl Model {
    /// Handles a request of a page.
    pub fn handle_request(&mut self, page: &str, request: &Request, time: f64) -> Vec<Effect> {
        let id = request.id;
        match &request.kind {
            RequestKind::LeaseRequest => return self.request_lease(page, id, false, time),
            RequestKind::LeaseTake => return self.request_lease(page, id, true, time),
            RequestKind::LeaseGive { to } => return self.give_lease(page, id, to.as_deref(), time),
            RequestKind::Tasks => {
                let known = self.pages.get(page);
                if !known.is_some_and(|page| page.visitor.role.may_drive()) {
                    let words = "the tasks are for those who may drive";
                    return self.answer(page, id, Err(words.to_owned()));
                }
                return self.start_operation(page, id, LISTING, Operation::Tasks);
            }
            RequestKind::Unknown => {
                return self.answer(
                    page,
                    id,
                    Err("unknown request: load the page again".to_owned()),
                );
            }
            _ => {}
        }
        if self.control.page() != Some(page) {
            let words = "this page is not in control; take control first";
            return self.answer(page, id, Err(words.to_owned()));
        }
        let running = self.situation.episode().cloned();
        let scenario = self.situation.scenario().cloned().unwrap_or_default();
        let none = || Err("no episode runs".to_owned());
        let runs = || Err("an episode runs; finish or discard it first".to_owned());
        let (word, operation) = match (&request.kind, running) {
            (RequestKind::Reset { .. } | RequestKind::Start { .. }, Some(_)) => {
                return self.answer(page, id, runs());
            }
            (RequestKind::Reset { task, seed }, None) => {
                let (task, seed) = (task.clone(), *seed);
                ("setting up", Operation::Reset { task, seed })
            }
            (
                RequestKind::Start {
                    label,
                    instruction,
                    recorders,
                },
                None,
            ) => {
                let start = Start {
                    numbered: label.trim().is_empty(),
                    label: match label.trim() {
                        "" => label::for_scenario(&scenario),
                        label => label.to_owned(),
                    },
                    instruction: match instruction.trim() {
                        "" => scenario.instruction().to_owned(),
                        words => words.to_owned(),
                    },
                    recorders: *recorders,
                };
                ("starting", Operation::Start(start))
            }
            (RequestKind::Finish | RequestKind::Discard | RequestKind::Redo, None) => {
                return self.answer(page, id, none());
            }
            (RequestKind::Finish, Some(_)) => ("finishing", Operation::Stop { discard: false }),
            (RequestKind::Discard, Some(_)) => ("discarding", Operation::Stop { discard: true }),
            (RequestKind::Redo, Some(running)) => {
                let start = Start {
                    label: running.label,
                    // A recorder that failed may have left the log of this label.
                    numbered: true,
                    instruction: running.instruction,
                    recorders: u32::from(!running.practice),
                };
                ("restarting", Operation::Redo(start))
            }
            (RequestKind::Pause, _) => ("pausing", Operation::Pause(true)),
            (RequestKind::Resume, _) => ("resuming", Operation::Pause(false)),
            (RequestKind::Pick { camera, tick, u, v }, _) => {
                return self.pick(page, id, *camera, *tick, [*u, *v]);
            }
            (RequestKind::GoalStart { candidate, action }, _) => {
                return self.start_goal(page, id, candidate, action, time);
            }
            (RequestKind::GoalCancel, _) => {
                let mut effects = self.end_goal("cancelled", time);
                effects.extend(self.answer(page, id, Ok(json!({}))));
                return effects;
            }
            (
                RequestKind::LeaseRequest
                | RequestKind::LeaseTake
                | RequestKind::LeaseGive { .. }
                | RequestKind::Tasks
                | RequestKind::Unknown,
                _,
            ) => return Vec::new(),
        };
        // Motion stops while the scene changes.
        let mut effects = self.end_goal(word, time);
        effects.extend(self.cut(page, word, time));
        effects.push(self.audit(page, "episode", word));
        effects.extend(self.start_operation(page, id, word, operation));
        effects
    }

    fn start_operation(
        &mut self,
        page: &str,
        id: u64,
        word: &'static str,
        operation: Operation,
    ) -> Vec<Effect> {
        if let Some((busy, _)) = &self.busy {
            let words = format!("wait: {busy}");
            return self.answer(page, id, Err(words));
        }
        if self.situation.connection != Connection::Open {
            let words = "no connection to the simulation: wait until it is back";
            return self.answer(page, id, Err(words.to_owned()));
        }
        self.busy = Some((word, Some((page.to_owned(), id))));
        let name = match &self.control {
            Control::Ours { name, .. } => name.clone(),
            Control::None | Control::Requested { .. } => String::new(),
        };
        vec![Effect::Operation(operation, name)]
    }

    /// Answers a page's request.
    pub(crate) fn answer(&self, page: &str, id: u64, answered: Answered) -> Vec<Effect> {
        let mut answer = json!({"t": "answer", "id": id, "ok": answered.is_ok()});
        match answered {
            Ok(Value::Object(fields)) => {
                if let Value::Object(answer) = &mut answer {
                    answer.extend(fields);
                }
            }
            Ok(_) => {}
            Err(why) => answer["error"] = Value::String(why),
        }
        vec![Effect::Say(page.to_owned(), answer)]
    }

    pub(super) fn answer_operation(&mut self, answered: Answered) -> Vec<Effect> {
        match self.busy.take() {
            Some((_, Some((page, id)))) => self.answer(&page, id, answered),
            _ => Vec::new(),
        }
    }

    /// Handles the result of a pending operation.
    pub fn done(&mut self, done: Done, time: f64) -> Vec<Effect> {
        let answered = match done {
            Done::Lease(result) => return self.leased(result, time),
            Done::Scene(_) => return Vec::new(),
            Done::Started(Ok(started)) => {
                let number = started.header.as_ref().map_or(0, |h| h.episode);
                let answer = json!({
                    "number": number, "label": started.label, "practice": started.practice,
                });
                self.situation.began(*started);
                Ok(answer)
            }
            Done::Stopped(Ok(stopped)) => {
                let success = stopped.evaluation.as_ref().is_some_and(|e| e.success);
                let text = self.situation.ended(&stopped, time);
                Ok(json!({"success": success, "text": text}))
            }
            Done::Reset(Ok(scenario)) => {
                let answer = json!({"task": scenario.task(), "seed": scenario.seed()});
                if let Some(status) = &mut self.situation.status {
                    status.scenario = Some(*scenario);
                    status.evaluation = None;
                }
                self.situation.evaluation = None;
                self.candidates.clear();
                Ok(answer)
            }
            Done::Paused(Ok(paused)) => {
                if let Some(status) = &mut self.situation.status {
                    status.paused = paused;
                }
                Ok(json!({"paused": paused}))
            }
            Done::Tasks(Ok(tasks)) => {
                let tasks: Vec<Value> = tasks
                    .iter()
                    .map(|task| {
                        let words = task.instructions.first().cloned().unwrap_or_default();
                        json!({"name": task.name, "instruction": words})
                    })
                    .collect();
                Ok(json!({"tasks": tasks}))
            }
            Done::Started(Err(why)) | Done::Stopped(Err(why)) => {
                self.situation.refused(&why, time);
                Err(why)
            }
            Done::Reset(Err(why)) | Done::Paused(Err(why)) | Done::Tasks(Err(why)) => {
                self.situation.note(time, true, why.clone());
                Err(why)
            }
        };
        self.answer_operation(answered)
    }
}
