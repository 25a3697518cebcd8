//! Requests of pages on the state socket: control, tasks, scenarios, episodes, time.

use serde_json::{Value, json};
use wheelarm_proto::label;

use super::{Control, Effect, Model};
use crate::errand::{Done, Errand, Start};
use crate::protocol::{Ask, Asked};
use crate::watch::Connection;

/// Name of the operation during which silence of the server is expected.
pub(super) const LISTING: &str = "listing the tasks";

/// Result of a request: further fields of the answer, or the error text.
pub type Answered = Result<Value, String>;

impl Model {
    /// Handles a request of a page.
    pub fn asked(&mut self, page: &str, asked: &Asked, time: f64) -> Vec<Effect> {
        let id = asked.id;
        match &asked.ask {
            Ask::LeaseAsk => return self.ask_lease(page, id, false, time),
            Ask::LeaseTake => return self.ask_lease(page, id, true, time),
            Ask::LeaseGive { to } => return self.give_lease(page, id, to.as_deref(), time),
            Ask::Tasks => {
                let known = self.pages.get(page);
                if !known.is_some_and(|page| page.visitor.role.may_drive()) {
                    let words = "the tasks are for those who may drive";
                    return self.answer(page, id, Err(words.to_owned()));
                }
                return self.errand(page, id, LISTING, Errand::Tasks);
            }
            Ask::Unknown => return self.answer(page, id, Err("nobody knows this".to_owned())),
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
        let (word, errand) = match (&asked.ask, running) {
            (Ask::Reset { .. } | Ask::Start { .. }, Some(_)) => {
                return self.answer(page, id, runs());
            }
            (Ask::Reset { task, seed }, None) => {
                let (task, seed) = (task.clone(), *seed);
                ("setting up", Errand::Reset { task, seed })
            }
            (
                Ask::Start {
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
                ("starting", Errand::Start(start))
            }
            (Ask::Finish | Ask::Discard | Ask::Redo, None) => return self.answer(page, id, none()),
            (Ask::Finish, Some(_)) => ("finishing", Errand::Stop { discard: false }),
            (Ask::Discard, Some(_)) => ("discarding", Errand::Stop { discard: true }),
            (Ask::Redo, Some(running)) => {
                let start = Start {
                    label: running.label,
                    // A recorder that failed may have left the log of this label.
                    numbered: true,
                    instruction: running.instruction,
                    recorders: u32::from(!running.practice),
                };
                ("starting anew", Errand::Redo(start))
            }
            (Ask::Pause, _) => ("pausing", Errand::Pause(true)),
            (Ask::Resume, _) => ("resuming", Errand::Pause(false)),
            (Ask::Pick { camera, tick, u, v }, _) => {
                return self.pick(page, id, *camera, *tick, [*u, *v]);
            }
            (Ask::GoalStart { candidate, action }, _) => {
                return self.start_goal(page, id, candidate, action, time);
            }
            (Ask::GoalCancel, _) => {
                let mut effects = self.end_goal("cancelled", time);
                effects.extend(self.answer(page, id, Ok(json!({}))));
                return effects;
            }
            (
                Ask::LeaseAsk | Ask::LeaseTake | Ask::LeaseGive { .. } | Ask::Tasks | Ask::Unknown,
                _,
            ) => return Vec::new(),
        };
        // Motion stops while the scene changes.
        let mut effects = self.end_goal(word, time);
        effects.extend(self.cut(page, word, time));
        effects.push(self.audit(page, "episode", word));
        effects.extend(self.errand(page, id, word, errand));
        effects
    }

    fn errand(&mut self, page: &str, id: u64, word: &'static str, errand: Errand) -> Vec<Effect> {
        if let Some((busy, _)) = &self.busy {
            let words = format!("wait: {busy}");
            return self.answer(page, id, Err(words));
        }
        if self.situation.connection != Connection::Open {
            let words = "there is no connection to the simulation";
            return self.answer(page, id, Err(words.to_owned()));
        }
        self.busy = Some((word, Some((page.to_owned(), id))));
        let name = match &self.control {
            Control::Ours { name, .. } => name.clone(),
            Control::None | Control::Asking { .. } => String::new(),
        };
        vec![Effect::Errand(errand, name)]
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

    pub(super) fn answer_errand(&mut self, answered: Answered) -> Vec<Effect> {
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
        self.answer_errand(answered)
    }
}
