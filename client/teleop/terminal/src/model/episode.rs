//! Episodes and scenarios by keys: start, finish, discard, redo, reset, pause.

use wheelarm_proto::{label, v1};

use super::{CONFIRM, Done, Effect, Form, Model, Operation, Start, Twice};

impl Model {
    pub(super) fn open_start(&mut self, now: f64) -> Vec<Effect> {
        if let Some(running) = self.situation.episode() {
            let label = running.label.clone();
            self.warn(
                now,
                format!("episode {label} runs; → finishes, ← does it again"),
            );
            return Vec::new();
        }
        let scenario = self.situation.scenario().cloned().unwrap_or_default();
        if self.start.label.is_empty() {
            self.start.label = label::for_scenario(&scenario);
            self.start.numbered = true;
        }
        let label = self.start.label.clone();
        let instruction = if self.start.instruction.is_empty() {
            scenario.instruction().to_owned()
        } else {
            self.start.instruction.clone()
        };
        // Motion stops while the person types.
        let effects = self.stop_everything(now);
        self.message = None;
        self.form = Some(Form::start(&label, &instruction, self.start.recorders));
        effects
    }

    pub(super) fn finish(&mut self, now: f64) -> Vec<Effect> {
        if self.situation.episode().is_none() {
            self.warn(now, "no episode runs; s starts one");
            return Vec::new();
        }
        let mut effects = self.stop_everything(now);
        effects.extend(self.start_operation("finishing", Operation::Stop { discard: false }, now));
        effects
    }

    /// Whether this is the second press; shows a message at the first.
    fn confirmed(&mut self, what: Twice, words: &str, now: f64) -> bool {
        let again = self
            .twice
            .take()
            .is_some_and(|(pending, at)| pending == what && now - at < CONFIRM);
        if !again {
            self.twice = Some((what, now));
            self.warn(now, words);
        }
        again
    }

    pub(super) fn discard(&mut self, now: f64) -> Vec<Effect> {
        if self.situation.episode().is_none() {
            self.warn(now, "no episode runs: nothing to discard");
            return Vec::new();
        }
        if !self.confirmed(Twice::Discard, "d again throws this episode away", now) {
            return Vec::new();
        }
        let mut effects = self.stop_everything(now);
        effects.extend(self.start_operation("discarding", Operation::Stop { discard: true }, now));
        effects
    }

    pub(super) fn redo(&mut self, now: f64) -> Vec<Effect> {
        let Some(running) = self.situation.episode() else {
            self.warn(now, "no episode runs; t sets the scene up, s starts");
            return Vec::new();
        };
        let again = Start {
            label: running.label.clone(),
            // A recorder that failed may have left the log of this label.
            numbered: true,
            instruction: running.instruction.clone(),
            recorders: match running.practice {
                true => 0,
                false => self.start.recorders.max(1),
            },
        };
        if !self.confirmed(
            Twice::Redo,
            "← again throws this episode away and starts it anew",
            now,
        ) {
            return Vec::new();
        }
        let mut effects = self.stop_everything(now);
        effects.extend(self.start_operation("restarting", Operation::Redo(again), now));
        effects
    }

    pub(super) fn open_reset(&mut self, now: f64) -> Vec<Effect> {
        if self.situation.episode().is_some() {
            self.warn(now, "an episode runs; → finishes it, dd discards it");
            return Vec::new();
        }
        let mut effects = self.stop_everything(now);
        effects.extend(self.start_operation("listing the tasks", Operation::Tasks, now));
        effects
    }

    pub(super) fn pause(&mut self, now: f64) -> Vec<Effect> {
        let paused = self.situation.status.as_ref().is_some_and(|s| s.paused);
        let mut effects = self.stop_everything(now);
        let word = if paused { "resuming" } else { "pausing" };
        effects.extend(self.start_operation(word, Operation::Pause(!paused), now));
        effects
    }

    /// Handles the result of a pending operation.
    pub fn done(&mut self, done: Done, now: f64) -> Vec<Effect> {
        if let Done::Lease(result) = done {
            self.leased(result, now);
            return Vec::new();
        }
        if !matches!(done, Done::Scene(_)) {
            self.busy = None;
        }
        match done {
            Done::Lease(_) => {}
            Done::Started(Ok(started)) => {
                let number = started.header.as_ref().map_or(0, |h| h.episode);
                let practice = match started.practice {
                    true => ": practice, nothing is recorded",
                    false => "",
                };
                self.say(
                    now,
                    format!("episode {number} {} runs{practice}", started.label),
                );
                self.situation.began(*started);
                self.arm.forget();
                self.answered = None;
            }
            Done::Stopped(Ok(stopped)) => {
                self.ended(&stopped, now);
                if self.leaving {
                    return vec![Effect::Quit];
                }
            }
            Done::Reset(Ok(scenario)) => {
                self.say(
                    now,
                    format!("set up {} with seed {}", scenario.task(), scenario.seed()),
                );
                self.arm.forget();
                self.start.label.clear();
                self.start.instruction.clear();
                if let Some(status) = &mut self.situation.status {
                    status.scenario = Some(*scenario);
                    status.evaluation = None;
                }
                self.situation.evaluation = None;
                if self.settings.target_hint {
                    return vec![Effect::Operation(Operation::Scene)];
                }
            }
            Done::Paused(Ok(paused)) => {
                if let Some(status) = &mut self.situation.status {
                    status.paused = paused;
                }
                self.say(
                    now,
                    if paused {
                        "time is paused; p resumes"
                    } else {
                        "time resumes"
                    },
                );
            }
            Done::Tasks(Ok(tasks)) => {
                let scenario = self.situation.scenario().cloned().unwrap_or_default();
                let effects = match self.drive.direction {
                    // Pressed while the list was loading: motion stops while the person types.
                    Some(_) => self.stop_everything(now),
                    None => Vec::new(),
                };
                self.form = Some(Form::reset(tasks, scenario.task(), scenario.seed()));
                return effects;
            }
            Done::Scene(Ok(scene)) => {
                self.situation.take_scene(&scene);
                if let Some(robot) = &scene.robot {
                    self.arm.fit(robot);
                }
            }
            Done::Started(Err(why)) | Done::Stopped(Err(why)) => {
                self.leaving = false;
                self.situation.refused(&why, now);
                self.warn(now, why);
            }
            Done::Reset(Err(why))
            | Done::Paused(Err(why))
            | Done::Tasks(Err(why))
            | Done::Scene(Err(why)) => {
                self.leaving = false;
                self.warn(now, why.clone());
                self.situation.note(now, true, why);
            }
        }
        Vec::new()
    }

    fn ended(&mut self, stopped: &v1::EpisodeStopped, now: f64) {
        let label = self.situation.episode().map(|e| e.label.clone());
        let text = self.situation.ended(stopped, now);
        self.say(now, text);
        if !stopped.discard {
            self.start.label = label::next(&label.unwrap_or_default());
            self.start.numbered = true;
        }
        self.answer_due = None;
        self.pending = v1::Command::default();
    }
}
